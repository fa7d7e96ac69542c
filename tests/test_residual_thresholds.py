"""Every threshold by which a fit is called noise, on either side of it."""

from __future__ import annotations

from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest
from misfits import noise_of, record
from scipy import stats
from scipy.integrate import quad
from scipy.optimize import brentq

from ctrlgen.estimation import residual_tests
from ctrlgen.estimation.held_out import HeldOutRefit
from ctrlgen.estimation.noise import cross_correlation
from ctrlgen.estimation.residual_tests import ResidualTests, run_residual_tests
from ctrlgen.recordings.recording import Recording


def residual_tests_of(fitter, fit, penalty: float = 0.0) -> ResidualTests:
    """With parameters that the held-out records leave as they were, at a given penalty."""
    refit = HeldOutRefit(fit, penalty, 0.0)
    with patch.object(residual_tests, "refit_to_held_out", lambda *_: refit):
        return run_residual_tests(fitter, fit)


def judged(
    white: np.ndarray,
    *,
    fitted_ratio: float = 1.0,
    count: float = np.inf,
    price: float = 0.0,
    drive=None,
    n_fit: int = 100_000,
    rest: np.ndarray | None = None,
):
    """The tests of held-out readings (n, n_y), which the model predicts as zero; of those fitted, the root mean square of the loss
    is `fitted_ratio` on `n_fit` samples more than the three numbers."""
    n_y = white.shape[1]
    noise = noise_of(n_y, count=count)
    channels = tuple(f"reading.{i}" for i in range(n_y))
    held = record("hold_out", len(white), n_y, white, drive)
    fitted_white = sized(fitted_ratio * np.sqrt(n_fit / (n_fit + 3)), n_fit + 3, n_y)
    fit_record = record("fit", n_fit + 3, n_y, fitted_white)
    still = [] if rest is None else [record("rest", len(rest), n_y, rest)]
    recording = Recording("t", "any", "series", channels, ("um",) * n_y, (1.0,) * n_y, (fit_record, held, *still), ())
    fitter = SimpleNamespace(
        noise=noise,
        fit_records=[fit_record],
        held_out_records=[held],
        recording=recording,
        predict=lambda fit, r: np.zeros(r.observed.shape),
        whitened_residual=lambda fit, r: r.observed,
    )
    return residual_tests_of(fitter, SimpleNamespace(theta=np.zeros(3)), price)


def huber_loss(e: np.ndarray | float) -> np.ndarray:
    """Squares up to three deviations, then 6 |e| - 9."""
    return np.where(np.abs(e) <= 3, np.square(e), 6 * np.abs(e) - 9)


NORMAL = quad(lambda e: float(huber_loss(e)) * stats.norm.pdf(e), -12, 12, points=[-3, 3])[0]


def scaled(white: np.ndarray, ratio: float) -> np.ndarray:
    """`white` (n,) times what makes the root of its mean loss `ratio` times that of normal noise."""

    def beyond(size: float) -> float:
        return float(np.mean(huber_loss(size * white))) / NORMAL - ratio**2

    return white * brentq(beyond, 1e-3, 1e3, xtol=1e-14)


def sized(ratio: float, n: int = 20000, n_y: int = 1) -> np.ndarray:
    """White noise, by the root of its mean loss exactly `ratio`."""
    white = np.random.default_rng(5).standard_normal((n, n_y))
    return np.column_stack([scaled(e, ratio) for e in white.T])


@pytest.mark.parametrize("ratio, passes", [(1.099, True), (1.101, False)])
def test_held_out_noise_may_be_a_tenth_larger_than_expected(ratio, passes):
    found = judged(sized(ratio))
    assert found.ratio == pytest.approx((ratio,)) and found.worst == pytest.approx(ratio) and found.passed == passes


@pytest.mark.parametrize("ratio, passes", [(1.099, True), (1.101, False)])
def test_what_was_fitted_may_be_a_tenth_larger_too(ratio, passes):
    assert judged(sized(1.0), fitted_ratio=ratio).passed == passes


def test_one_channel_of_several_is_enough():
    two = np.hstack([sized(1.0), sized(1.2)])
    found = judged(two)
    assert found.ratio == pytest.approx((1.0, 1.2)) and not found.passed


def test_what_the_numbers_cost_counts_as_squares():
    n = 20000
    assert judged(sized(1.0), price=0.205 * n).passed and not judged(sized(1.0), price=0.215 * n).passed


@pytest.mark.parametrize("p, passes", [(2e-3, True), (5e-4, False)])
def test_few_samples_are_large_by_chance_once_in_a_thousand(p, passes):
    n = 40
    ratio = np.sqrt(stats.chi2.isf(p, n) / n)
    assert ratio > 1.1
    found = judged(sized(ratio, n))
    assert found.p_values["size"] == pytest.approx(p, rel=1e-6) and found.passed == passes
    assert judged(sized(1.0), fitted_ratio=ratio, n_fit=n).passed == passes


@pytest.mark.parametrize("side, passes", [(-1e-3, True), (1e-3, False)])
def test_a_noise_that_is_poorly_known_itself_is_granted_2_6_deviations(side, passes):
    count = 200.0
    granted = 1.1 * (1 + 2.6 / np.sqrt(2 * count))
    assert judged(sized(granted + side), count=count).passed == passes
    assert judged(sized(1.0), fitted_ratio=granted + side, count=count).passed == passes


def test_the_chance_of_an_error_is_that_of_its_squares_in_units_of_the_noise_as_known():
    count, n, ratio = 200.0, 500, 1.2
    doubt = 1 + 2.6 / np.sqrt(2 * count)
    found = judged(sized(ratio, n), fitted_ratio=ratio, count=count, n_fit=n).p_values
    wanted = stats.chi2.sf(n * (ratio / doubt) ** 2, n)
    assert 1e-3 < wanted < 0.5 and [found["size"], found["fitted"]] == pytest.approx([wanted, wanted], rel=1e-9)


def spectrum(power: np.ndarray, rms: float) -> np.ndarray:
    """A signal (n, 1) of this power spectrum, random phases."""
    n = 2 * len(power) - 2
    phase = np.exp(2j * np.pi * np.random.default_rng(2).random(len(power)))
    y = np.fft.irfft(np.sqrt(power) * phase, n)
    return scaled(y / np.std(y), rms)[:, None]


@pytest.mark.parametrize("rms, passes", [(1.019, True), (1.021, False)])
def test_noise_with_a_memory_is_rejected_where_it_is_a_fiftieth_larger_too(rms, passes):
    """Correlations at lag one of a tenth."""
    w = np.linspace(0, np.pi, 10001)
    found = judged(spectrum(1 + 0.2 * np.cos(w), rms))
    assert found.p_values["memory"] < 1e-6 and found.passed == passes


@pytest.mark.parametrize("target, passes", [(3e-4, True), (3e-5, False)])
def test_a_test_of_whiteness_rejects_below_one_in_ten_thousand(target, passes):
    """p of the test with its drive: 2 (lags + 1) sf(z) for the one drive."""
    n, e = 20000, sized(1.05)[:, 0]
    z = stats.norm.isf(target / (2 * 21))
    u = np.random.default_rng(6).standard_normal(n)
    u -= u.mean()
    cut = np.clip(e, -3, 3)  # as the tests see it
    cut -= cut.mean()
    u -= cut * (cut @ u) / (cut @ cut)
    drive = (u / np.linalg.norm(u) + z / np.sqrt(n) * cut / np.linalg.norm(cut))[:, None]
    found = judged(e[:, None], drive=drive)
    assert found.p_values["drive"] == pytest.approx(target, rel=0.02) and found.passed == passes
    assert found.p_values["memory"] > 1e-3 and found.p_values["variance"] > 1e-3


def test_too_few_samples_are_not_tested_for_a_memory():
    rising = np.linspace(-1, 1, 101)[:, None] * np.sqrt(3)
    assert "memory" in judged(rising).p_values and "memory" not in judged(rising[:100]).p_values


def test_size_that_comes_and_goes_is_no_noise():
    n = 20000
    e = np.random.default_rng(7).standard_normal(n) * (1 + 0.5 * np.sin(np.arange(n) / 50))
    found = judged((1.05 * e / np.sqrt(np.mean(e**2)))[:, None])
    assert found.p_values["memory"] > 1e-4 and found.p_values["variance"] < 1e-6 and not found.passed


def test_a_correlation_with_the_drive_is_rejected_as_often_as_it_says(rng):
    """Bonferroni over 21 lags: of 400 independent pairs p < 0.2 in at most a fifth, and nearly that."""
    p = np.array([cross_correlation(rng.standard_normal(300), rng.standard_normal((300, 1))) for _ in range(400)])
    seen = np.mean(p < 0.2)
    assert 0.2 - 4 * 0.02 - 0.02 < seen < 0.2 + 4 * 0.02  # binomial deviation 0.02; Bonferroni's bound costs as much
    assert cross_correlation(rng.standard_normal(300), np.zeros((300, 1))) == 1.0


@pytest.mark.parametrize("tails, moves", [(2.2, True), (50.0, False)])
def test_tails_at_rest_that_noise_has_not_are_no_noise(tails, moves):
    """Student's noise of few degrees of freedom; of fifty it is all but normal."""
    found = judged(sized(1.0), rest=stats.t.rvs(tails, size=(4000, 1), random_state=3))
    assert found.restless == (("reading.0",) if moves else ()) and found.passed == (not moves)


@pytest.mark.parametrize("share, moves", [(0.004, False), (0.006, True)])
def test_rare_spikes_at_rest_are_no_motion(share, moves):
    """Up to half a per cent of samples beyond 3.9 deviations are faults of a sensor."""
    rng, n = np.random.default_rng(8), 4000
    rest = np.clip(rng.standard_normal((n, 1)), -3.5, 3.5)
    spikes = rng.choice(n, int(share * n), replace=False)
    rest[spikes, 0] = 6.0 * np.where(np.arange(len(spikes)) % 2, 1, -1)
    assert judged(sized(1.0), rest=rest).passed == (not moves)


def test_spikes_are_cut_where_a_memory_is_tested():
    """One sample of a thousand at six deviations, in pairs: their squares would remember one another."""
    white, rng = sized(1.03), np.random.default_rng(4)
    at = rng.choice(len(white) - 1, 10, replace=False)
    for k in at:
        white[k : k + 2, 0] = 40.0
    assert judged(white).p_values["memory"] > 1e-4

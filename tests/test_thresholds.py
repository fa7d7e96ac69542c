"""Every threshold by which structures are weighed and a fit is found adequate, at its two sides; fits are numbers here."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest
from axis_records import AXIS
from misfits import BLOCKS, errors_of, left, noise_of, weighed_by
from scipy import stats
from scipy.integrate import quad
from scipy.optimize import brentq

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.model_selection import ModelSelection, wins_by_block
from ctrlgen.diagnosis.selection.objections import objections
from ctrlgen.estimation import residual_tests
from ctrlgen.estimation.error_model import ErrorModel
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.held_out import HeldOutRefit
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import cross_correlation
from ctrlgen.estimation.residual_tests import ResidualTests, run_residual_tests
from ctrlgen.estimation.structure import FreeParameter, Structure
from ctrlgen.recordings.recording import Record, Recording

N = 1000  # samples to fit, and held out
CREEP, GAIN = Hypothesis("creep", "stage:axis", "axis"), Hypothesis("drive_gain", "actuator:axis", "axis")
JUST = 1e-6  # of a threshold: beside it


def record(role: str, n: int = N, n_y: int = 1, observed=None, drive=None) -> Record:
    y = np.zeros((n, n_y)) if observed is None else observed
    u = np.random.default_rng(9).standard_normal((n, 1)) if drive is None else drive
    return Record(role, role, 1e-3 * np.arange(n), 1e-3, u, y, False, None, np.ones(y.shape, bool))


def weighing(known: bool = True, trial=None) -> ModelSelection:
    return ModelSelection(weighed_by(known), trial or (lambda *_, **__: []))


def number(cause: int | None = None, low=0.0, high=1.0) -> FreeParameter:
    return FreeParameter(
        "p" if cause is None else "effect[0].gain", "1", 0.0, low, high, 1e-3, cause=cause, amplitude=cause is not None
    )


def trial(gone=0.0, held=0.0, numbers=1, penalty=0.0, causes=(), rarity=0.0, n=N, blocks=None, known=True, tau=1.0):
    """A candidate that leaves `gone` squares beyond the noise, `held` beyond it held out."""
    unknowns = tuple(number(None if i == 0 else 0) for i in range(numbers))
    structure = SimpleNamespace(free_parameters=unknowns, causes=causes, log_prior_odds=-rarity, device=None)
    fit = SimpleNamespace(structure=structure, penalty=penalty)
    found = left(gone, n)
    return CandidateModel(fit, errors_of(found, known, tau), found, left(held, n, blocks))


def loss(q: float) -> float:
    """-2 ln of the normal likelihood of a sample at the best variance that is not below the noise."""
    return q if q <= 1 else 1 + np.log(q)


@pytest.mark.parametrize("excess", [-500.0, 0.0, 300.0, 1e5])
def test_the_criterion_is_chi_square_within_the_noise_and_a_logarithm_beyond(excess):
    """T of one number of a cause; beyond, it counts by which factor less is left."""
    t, w = trial(excess, 0.5 * excess, numbers=2, penalty=3.0, rarity=2.3), weighing()
    T = N * loss(1 + excess / N) + N * loss(1 + 0.5 * excess / N) + 3.0 + np.log(N) + 2 * 2.3
    assert w.criterion(t, errors_of(left())) == pytest.approx(T, rel=1e-12)


def test_below_the_noise_differences_are_those_of_chi_square():
    w = weighing()
    assert w.advantage(trial(-300.0), trial(-200.0)) == pytest.approx(100.0)


def test_beyond_the_noise_squares_count_by_their_factor_on_independent_samples():
    """Twice as much is ln 2 a sample, whatever the size; of samples that remember ten, ln 2 each tenth."""
    w = weighing()
    for size in (1e2, 1e4):
        a, b = (trial(N * (f * size - 1), N * (f * size - 1)) for f in (1, 2))
        assert w.advantage(a, b) == pytest.approx(2 * N * np.log(2)) == -w.advantage(b, a)
        a, b = (trial(N * (f * size - 1), N * (f * size - 1), tau=10.0) for f in (1, 2))
        assert w.advantage(a, b) == pytest.approx(2 * N / 10 * np.log(2))


def test_a_noise_that_only_the_misfit_tells_counts_by_its_factor_below_it_too():
    a, b = trial(-0.5 * N, -0.5 * N, known=False), trial(0.0, 0.0, known=False)
    assert weighing(known=False).advantage(a, b) == pytest.approx(2 * N * np.log(2), rel=1e-9)


def test_two_models_are_compared_under_the_errors_of_the_one_that_leaves_less():
    good, poor = trial(0.0, 0.0), trial(1e6, 1e6, tau=100.0)
    w = weighing()
    assert w.reference((poor, good)) is good.errors and w.reference((good, poor)) is good.errors
    assert w.advantage(good, poor) == pytest.approx(2 * N * np.log(1 + 1e6 / N), rel=1e-9)


def test_the_price_of_a_number_is_the_logarithm_of_the_independent_samples():
    w = weighing()
    for tau, independent in ((1.0, N), (10.0, N / 10), (1e6, 2)):
        errors = ErrorModel(noise_of(), np.array([100.0]), np.array([tau]))
        one, three = (w.criterion(trial(1e7, 1e7, numbers=1 + k), errors) for k in (1, 3))
        assert three - one == pytest.approx(2 * np.log(independent))


def pair(gained: float, confirmed: float, added: int = 1, hidden: float = 0.0):
    """Before and after a cause that takes `gained` and, held out, `confirmed` within the noise; `hidden` of it was a penalty."""
    readings = gained - hidden
    return (
        trial(-100.0, -100.0, penalty=hidden),
        trial(-100.0 - readings, -100.0 - confirmed, numbers=1 + added),
    )


NEEDED = 12 + np.log(N)  # z^2 for one number of 1000 samples


@pytest.mark.parametrize("added", [1, 2, 3])
def test_a_cause_is_worth_its_numbers_from_a_gain_of_14_and_ln_n_a_number(added):
    """Fitted and held out together, the held-out part at most as large as the other."""
    need, w = 14 + added * np.log(N), weighing()
    for confirmed in (3.0, 8.0):
        assert w.improves_enough(*pair(need - confirmed + JUST, confirmed, added))
        assert not w.improves_enough(*pair(need - confirmed - JUST, confirmed, added))
    assert w.improves_enough(*pair(need / 2 + JUST, 300.0, added))
    assert not w.improves_enough(*pair(need / 2 - JUST, 300.0, added))


def test_the_held_out_records_must_show_two_squares_of_a_cause():
    w = weighing()
    assert w.improves_enough(*pair(100.0, 2 + JUST)) and not w.improves_enough(*pair(100.0, 2 - JUST))


@pytest.mark.parametrize("gone, share", [(0.0, 0.01), (N, 0.05)])
def test_the_held_out_records_must_lose_a_share_of_what_they_have_beyond_the_noise(gone, share):
    """Where half of their squares are beyond it, ln of 1 - 0.005; of a model that leaves more than noise, five times as much."""
    w, before, after = weighing(), trial(gone + N, N), trial(gone, N, numbers=2)
    most = 2 * N * (1 - np.exp(-share / 2))
    for side in (1, -1):
        held = replace(after, held_out=left(N - most * (1 + side * 1e-6)))
        assert w.improves_enough(before, held) == (side > 0)


def test_a_cause_below_a_tenth_of_the_noise_is_not_named():
    n = 100_000
    for side in (1, -1):
        before = trial(-100.0, -100.0, n=n)
        after = trial(-100.0 - 0.01 * n - side * JUST, -1000.0, numbers=2, n=n)
        assert weighing().improves_enough(before, after) == (side > 0)


def test_what_the_device_hid_at_a_price_needs_no_held_out_record_to_show_it():
    w = weighing()
    assert w.improves_enough(*pair(NEEDED + JUST, 0.0, hidden=0.5 * NEEDED + 1))
    assert not w.improves_enough(*pair(NEEDED - JUST, 0.0, hidden=NEEDED))
    assert w.improves_enough(*pair(100.0, -4 + JUST, hidden=51.0))
    assert not w.improves_enough(*pair(100.0, -4 - JUST, hidden=51.0))
    assert w.improves_enough(*pair(100.0, 0.0, hidden=50 + JUST))
    assert not w.improves_enough(*pair(100.0, 0.0, hidden=50 - JUST))


OVER = (1.1**2 - 1) * N  # squares beyond the noise by which a gate of 1.10 is passed


def test_what_no_held_out_record_reaches_must_take_away_nine_tenths():
    w, excess = weighing(), 2 * OVER

    def worth(gained, held_before=-100.0, confirmed=0.0):
        return w.improves_enough(trial(excess, held_before), trial(excess - gained, held_before - confirmed, numbers=2))

    assert worth(0.9 * excess + JUST) and not worth(0.9 * excess - JUST)
    assert worth(0.95 * excess, confirmed=-4 + JUST) and not worth(0.95 * excess, confirmed=-4 - JUST)
    assert worth(0.95 * excess, held_before=OVER - JUST) and not worth(0.95 * excess, held_before=OVER + JUST)


@pytest.mark.parametrize("fitted, held, out", [(1, -1, True), (-1, -1, False), (1, 1, False), (-1, 1, False)])
def test_out_of_reach_is_beyond_the_gate_where_fitted_and_within_it_where_held_out(fitted, held, out):
    assert weighing().unseen_in_held_out(trial(OVER + fitted * JUST, OVER + held * JUST)) == out


@pytest.mark.parametrize("numbers", [1, 4])
def test_numbers_that_cost_sixteen_squares_and_two_each_may_hide_a_cause(numbers):
    w, most = weighing(), 16.0 + 2 * numbers
    assert w.parameters_may_mask_cause(trial(penalty=most + JUST, numbers=numbers).fit)
    assert not w.parameters_may_mask_cause(trial(penalty=most - JUST, numbers=numbers).fit)


def test_what_a_cause_must_show_is_its_size_or_where_the_device_hides_it_its_price():
    """And nothing where more than noise is left: the score is against a residual that holds the cause itself."""
    screened, w = SimpleNamespace(threshold=4.0), weighing()
    assert w.required_z2(trial(n=1000), screened) == 16.0
    assert w.required_z2(trial(n=10_000), screened) == pytest.approx(100.0)
    assert w.required_z2(trial(penalty=30.0, n=10_000), screened) == 16.0
    assert w.required_z2(trial(1e5), screened) == 0.0


def test_among_equals_the_plainer_is_named():
    w = weighing()
    best, rare, plain = trial(-100.0), trial(-100.0, rarity=2.0), trial(-95.1, rarity=-1.6)
    assert w.most_parsimonious([rare, best]) is best and w.most_parsimonious([best, rare]) is best
    assert w.advantage(best, plain) == pytest.approx(4.9 - 3.2)  # less than 2
    assert w.most_parsimonious([best, plain]) is plain
    worse = trial(-94.7, rarity=-1.6)
    assert w.advantage(best, worse) == pytest.approx(5.3 - 3.2) and w.most_parsimonious([best, worse]) is best
    costly = trial(-95.1 - np.log(N), rarity=-1.6, numbers=2)
    assert w.advantage(best, costly) == pytest.approx(4.9 - 3.2) and w.most_parsimonious([best, costly]) is best


@pytest.mark.parametrize("gain, matters", [(1.01e4, True), (0.99e4, False)])
def test_beyond_the_noise_a_cause_takes_away_a_hundredth_of_the_whole_mismatch(gain, matters):
    """Of the device as described, 1000 times the noise's squares; not of what is left now."""
    whole = ModelSelection(weighed_by(), lambda *_, **__: [], mismatch=np.array([1000.0]))
    before, after = trial(3e4, 3e4), trial(3e4 - gain, 3e4 - gain, numbers=2)
    assert whole.improves_enough(before, after) == matters and weighing().improves_enough(before, after)


LUCKY = [0.5, *[0.5 / (BLOCKS - 1)] * (BLOCKS - 1)]  # half of the squares in one block


def test_a_gain_in_one_block_does_not_win():
    """A step that happens to fit: nineteen of twenty blocks get a little worse."""
    before = left(1e6, blocks=LUCKY)
    one = np.where(np.arange(BLOCKS) == 0, 0.0, 0.5 / (BLOCKS - 1) * 1.01)
    assert not wins_by_block(before, left(1e6, blocks=one))
    assert wins_by_block(before, left(1e6, blocks=0.5 * np.array(LUCKY)))


def test_most_blocks_win_where_two_hold_nearly_all():
    """In squares two blocks cannot tell; nineteen of twenty that lose a tenth do, and quiet ones do not vote."""
    shares = np.array([0.5, 0.45, *[0.05 / (BLOCKS - 2)] * (BLOCKS - 2)])
    less = shares * np.where(np.arange(BLOCKS) == 1, 1.0, 0.5)
    assert wins_by_block(left(1e6, blocks=shares), left(1e6, blocks=less))
    assert not wins_by_block(left(1e6, blocks=less), left(1e6, blocks=shares))


def test_beyond_the_noise_a_cause_must_win_in_more_than_one_block():
    w, before = weighing(), trial(1e6, 1e6, blocks=LUCKY)
    one = np.where(np.arange(BLOCKS) == 0, 0.0, 0.5 / (BLOCKS - 1))
    assert not w.improves_enough(before, trial(5e5, 1e6, numbers=2, blocks=one))
    assert w.improves_enough(before, trial(5e5, 5e5, numbers=2, blocks=LUCKY))


def bound(value: float, low: float = 0.0, high: float = 1.0, usual=None) -> dict[int, str]:
    """What speaks against a gain of this amplitude."""
    structure = SimpleNamespace(
        causes=(GAIN,), free_parameters=(number(), number(0, low, high)), plausible_range=lambda _: usual
    )
    fit = SimpleNamespace(structure=structure, theta=np.array([0.5, value]), values=lambda k: {"gain": value})
    recording = Recording("t", "any", "series", ("reading.axis",), ("um",), (1.0,), (record("fit", 10),), ())
    assert objections(recording, fit, (GAIN,)) == {}  # it has been accepted
    return objections(recording, fit)


@pytest.mark.parametrize("value, means", [(0.5, True), (1 - 2e-6, True), (1 - 5e-7, False), (5e-7, True), (1.0, False)])
def test_an_amplitude_at_its_bound_means_nothing_but_off(value, means):
    assert bound(value) == ({} if means else {0: "gain is at its bound of 1"})


def test_an_amplitude_at_a_bound_that_is_not_off_means_nothing_either():
    assert bound(-1 + 5e-7, low=-1.0) == {0: "gain is at its bound of -1"} and bound(-1 + 3e-6, low=-1.0) == {}


@pytest.mark.parametrize("value, means", [(0.79, False), (0.81, True), (1.19, True), (1.21, False)])
def test_an_amplitude_that_is_not_usual_is_something_else(value, means):
    said = {} if means else {0: f"gain = {value} is outside of 0.8 ... 1.2"}
    assert bound(value, high=2.0, usual=(0.8, 1.2)) == said


def fitted(
    squares: float, held: float, *causes: Hypothesis, amplitude: float = 0.3, sd: float = 0.01
) -> CandidateModel:
    """A fit of the axis with causes, of which the first has this `amplitude`, known to `sd`."""
    structure = Structure(AXIS)
    for cause in causes:
        structure = structure.with_cause(
            cause, {"gain": 0.3, "tau": 1.0, "slow": 0.1} if cause is CREEP else {"gain": 0.3}
        )
    theta = np.array([u.nominal if u.cause is None else 0.3 for u in structure.free_parameters])
    first = next((i for i, u in enumerate(structure.free_parameters) if u.cause == 0 and u.amplitude), None)
    deviations = np.full(len(theta), 0.01)
    if first is not None:
        theta[first], deviations[first] = amplitude, sd
    fit = Fit(structure, theta, (), N + squares, N, np.zeros(len(theta)), np.diag(1 / deviations), 0.0)
    return CandidateModel(fit, errors_of(left(squares)), left(squares), left(held))


@pytest.mark.parametrize("sd, times", [(0.15, 1.0), (0.16, 5.0)])
def test_what_a_law_that_is_right_to_a_hundredth_may_leave_is_doubtful(sd, times):
    """A creep, right to a hundredth, takes 4e6 squares where fitted and 1e6 where held out: 400 and 100 of them, in geometric
    mean 200, may be its form; five times as much of itself, 25 times the squares, beside a gain of 0.3 that may be nothing."""
    w = weighing(trial=lambda *_, **__: [fitted(4e6, 1e6)])
    current = fitted(0.0, 0.0, GAIN, CREEP, sd=sd)
    for side in (-1, 1):
        squares = 200.0 * times**2 * (1 + 1e-2 * side)
        bare = fitted(2 * squares, squares / 2, CREEP)
        # the records without the creep leave 4e6 and 1e6 in place of what the bare fit leaves
        rest = np.sqrt((4e6 - 2 * squares) * (1e6 - squares / 2)) / np.sqrt(4e6 * 1e6)
        assert w.within_model_form_error(bare, current, 0) == (squares < 200.0 * times**2 * rest)
    assert not w.within_model_form_error(fitted(2 * 190.0, 190.0 / 2, GAIN), current, 0)  # a gain has its own form


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

"""Every threshold by which structures are weighed and a fit is found adequate, at its two sides; fits are numbers here."""

from __future__ import annotations

from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest
from axis_records import AXIS
from scipy import stats

from ctrlgen.diagnosis.estimation import residual_tests
from ctrlgen.diagnosis.estimation.fit import Fit
from ctrlgen.diagnosis.estimation.held_out import HeldOutRefit
from ctrlgen.diagnosis.estimation.noise import Noise
from ctrlgen.diagnosis.estimation.residual_tests import ResidualTests, cross_correlation, run_residual_tests
from ctrlgen.diagnosis.estimation.structure import FreeParameter, Structure
from ctrlgen.diagnosis.hypotheses.hypotheses import Hypothesis
from ctrlgen.diagnosis.selection import model_selection
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.recordings.recording import Record, Recording

N = 1000  # samples to fit, and held out
NOISE = Noise(np.ones(1), (np.zeros(0),), np.ones(1, bool), ("",), np.full(1, np.inf))
CREEP, GAIN = Hypothesis("creep", "stage:axis", "axis"), Hypothesis("drive_gain", "actuator:axis", "axis")
JUST = 1e-6  # of a threshold: beside it


def record(role: str, n: int = N, n_y: int = 1, observed=None, drive=None) -> Record:
    y = np.zeros((n, n_y)) if observed is None else observed
    u = np.random.default_rng(9).standard_normal((n, 1)) if drive is None else drive
    return Record(role, role, 1e-3 * np.arange(n), 1e-3, u, y, False, None, np.ones(y.shape, bool))


def weighing(n_fit: int = N, n_held: int = N, known: bool = True, trial=None) -> ModelSelection:
    noise = Noise(NOISE.sd, NOISE.ar, np.array([known]), NOISE.notes, NOISE.count)
    recording = Recording("t", "any", "series", ("reading.axis",), ("um",), (1.0,), (record("fit", 10),), ())
    fitter = SimpleNamespace(
        noise=noise,
        fit_records=[record("fit", n_fit)],
        held_out_records=[record("hold_out", n_held)],
        recording=recording,
    )
    return ModelSelection(fitter, trial or (lambda *_, **__: None))


class Numbers(SimpleNamespace):
    """Numbers of a device, then those of its causes."""

    def cause_of(self, parameter):
        return self.causes[parameter.cause]

    def plausible_range(self, unknown) -> tuple[float, float] | None:
        return self.usually


def number(cause: int | None = None, low=0.0, high=1.0) -> FreeParameter:
    return FreeParameter("p.gain", "1", 0.0, low, high, 1e-3, cause=cause, amplitude=cause is not None)


def trial(
    gone=0.0, held=0.0, numbers=1, penalty=0.0, price=0.0, causes=(), rarity=0.0, theta=None, sd=0.01, n=N, usual=None
):
    """A fit that leaves `gone` squares beyond the noise, `held` beyond it held out."""
    unknowns = tuple(number(None if i == 0 else 0) for i in range(numbers))
    structure = Numbers(free_parameters=unknowns, causes=causes, log_prior_odds=-rarity, usually=usual, device=None)
    objective = n + gone
    fit = SimpleNamespace(
        structure=structure, objective=objective, chi2=objective - penalty, penalty=penalty, n=n,
        theta=np.full(numbers, 0.5) if theta is None else np.array(theta), covariance=sd**2 * np.eye(numbers),
        is_noise=objective < n + 4 * np.sqrt(2 * n), values=lambda k: {"gain": 0.5, "tau": 1.0, "slow": 0.0},
    )  # fmt: skip
    return CandidateModel(fit, n + held, objective + n + held + price)


def pair(gained: float, confirmed: float, added: int = 1, hidden: float = 0.0, left: float = 0.0, unseen: float = 0.0):
    """Before and after a cause that takes `gained` and, held out, `confirmed`; `hidden` of it was a penalty; both leave `left`,
    and held out `unseen`, over."""
    before = trial(left + gained, unseen + confirmed, penalty=hidden)
    return before, trial(left, unseen, numbers=1 + added)


NEEDED = 12 + np.log(N)  # z^2 for one number of 1000 samples


@pytest.mark.parametrize("added", [1, 2, 3])
def test_a_cause_is_worth_its_numbers_from_a_gain_of_14_and_ln_n_a_number(added):
    """Fitted and held out together, the held-out part at most as large as the other."""
    need, w = 14 + added * np.log(N), weighing()
    for confirmed in (3.0, 8.0):
        assert w.improves_enough(*pair(need - confirmed + JUST, confirmed, added))
        assert not w.improves_enough(*pair(need - confirmed - JUST, confirmed, added))
    assert w.improves_enough(*pair(need / 2 + JUST, 1000.0, added)) and not w.improves_enough(
        *pair(need / 2 - JUST, 1000.0, added)
    )


def test_the_held_out_records_must_show_two_squares_of_a_cause():
    w = weighing()
    assert w.improves_enough(*pair(100.0, 2 + JUST)) and not w.improves_enough(*pair(100.0, 2 - JUST))


def test_the_held_out_records_must_lose_a_twentieth_of_what_they_have_beyond_the_noise():
    w, excess = weighing(), 900.0
    assert w.improves_enough(*pair(400.0, 0.05 * excess + JUST, left=400.0, unseen=0.95 * excess))
    assert not w.improves_enough(*pair(400.0, 0.05 * excess - JUST, left=400.0, unseen=0.95 * excess))


def test_a_cause_below_a_tenth_of_the_noise_is_not_named():
    n = 100_000
    w = weighing(n, n)
    before, after = trial(0.01 * n + JUST, 900.0, n=n), trial(0.0, 0.0, numbers=2, n=n)
    assert w.improves_enough(before, after)
    assert not w.improves_enough(trial(0.01 * n - JUST, 900.0, n=n), after)


def test_what_the_device_hid_at_a_price_needs_no_held_out_record_to_show_it():
    w = weighing()
    assert w.improves_enough(*pair(NEEDED + JUST, 0.0, hidden=0.5 * NEEDED + 1)) and not w.improves_enough(
        *pair(NEEDED - JUST, 0.0, hidden=NEEDED)
    )
    assert w.improves_enough(*pair(100.0, -4 + JUST, hidden=51.0)) and not w.improves_enough(
        *pair(100.0, -4 - JUST, hidden=51.0)
    )
    assert w.improves_enough(*pair(100.0, 0.0, hidden=50 + JUST)) and not w.improves_enough(
        *pair(100.0, 0.0, hidden=50 - JUST)
    )


OVER = (1.1**2 - 1) * N  # squares beyond the noise by which a gate of 1.10 is passed


def test_what_no_held_out_record_reaches_must_take_away_nine_tenths():
    w, excess = weighing(), 2 * OVER

    def worth(gained, held_before=0.0, confirmed=0.0):
        return w.improves_enough(trial(excess, held_before), trial(excess - gained, held_before - confirmed, numbers=2))

    assert worth(0.9 * excess + JUST) and not worth(0.9 * excess - JUST)
    assert worth(0.95 * excess, confirmed=-4 + JUST) and not worth(0.95 * excess, confirmed=-4 - JUST)
    assert worth(0.95 * excess, held_before=OVER - JUST) and not worth(0.95 * excess, held_before=OVER + JUST)


def test_a_few_samples_that_show_nearly_all_must_still_show_enough():
    w = weighing(50)
    needed = 12 + np.log(50)
    assert needed > 0.21 * 50  # so few samples alone are beyond the gate
    assert w.improves_enough(trial(needed + JUST, n=50), trial(0.0, numbers=2, n=50))
    assert not w.improves_enough(trial(needed - JUST, n=50), trial(0.0, numbers=2, n=50))


@pytest.mark.parametrize("fitted, held, out", [(1, -1, True), (-1, -1, False), (1, 1, False), (-1, 1, False)])
def test_out_of_reach_is_beyond_the_gate_where_fitted_and_within_it_where_held_out(fitted, held, out):
    assert weighing().unseen_in_held_out(trial(OVER + fitted * JUST, OVER + held * JUST)) == out


@pytest.mark.parametrize("numbers", [1, 4])
def test_numbers_that_cost_sixteen_squares_and_two_each_may_hide_a_cause(numbers):
    w, most = weighing(), 16.0 + 2 * numbers
    assert w.parameters_may_mask_cause(trial(penalty=most + JUST, numbers=numbers).fit)
    assert not w.parameters_may_mask_cause(trial(penalty=most - JUST, numbers=numbers).fit)


def test_what_a_cause_must_show_is_its_size_or_where_the_device_hides_it_its_price():
    screened = SimpleNamespace(threshold=4.0)
    assert weighing(1000).required_z2(trial(), screened) == 16.0
    assert weighing(10_000).required_z2(trial(), screened) == pytest.approx(100.0)
    assert weighing(10_000).required_z2(trial(penalty=30.0), screened) == 16.0


def test_the_price_of_a_structure_is_half_of_bics_logarithm_twice_and_its_rarity(monkeypatch):
    monkeypatch.setattr(model_selection, "held_out_deviance", lambda fitter, fit: 1234.0)
    found = weighing().scored(trial(50.0, numbers=3, rarity=2.3).fit, None)
    assert found.held_out_deviance == 1234.0 and found.complexity_penalty == pytest.approx(2 * np.log(N) + 2 * 2.3)
    assert weighing(1).scored(trial(numbers=2).fit, None).complexity_penalty == pytest.approx(np.log(2))


def test_squares_that_none_explains_do_not_choose():
    """Both leave three times the noise: differences count in units of the better one's, less a hundredth of its excess."""
    w = weighing()
    a, b = trial(2.0 * N, 2.0 * N), trial(2.0 * N + 90, 2.0 * N + 60, price=5.0)
    slack = 0.01 * 2 * N * (1 - 1 / 3)
    assert w.advantage(a, b) == pytest.approx(90 / 3 + 60 / 3 + 5 - slack)
    assert w.advantage(b, a) == pytest.approx(-(90 / 3 + 60 / 3 + 5) - slack)


@pytest.mark.parametrize("known, slack", [(True, 0.25), (False, 0.01)])
def test_where_either_explains_all_that_was_fitted_a_quarter_of_what_is_held_out_does_not_choose(known, slack):
    w = weighing(known=known)
    a, b = trial(0.0, N), trial(0.0, N + 100)
    assert w.advantage(a, b) == pytest.approx(100 / 2 - slack * N / 2)
    poor = trial(5 * np.sqrt(2 * N), N + 100)  # one of them leaves more than noise
    assert w.advantage(a, poor) == pytest.approx(5 * np.sqrt(2 * N) + 100 / 2 - 0.01 * N / 2)


def test_among_equals_the_plainer_is_named():
    w = weighing()
    best, rare, plain = trial(0.0, N), trial(0.0, N, rarity=2.0), trial(0.0, N + 200, rarity=-1.0)
    assert w.most_parsimonious([rare, best]) is best and w.most_parsimonious([best, rare]) is best
    assert w.most_parsimonious([best, plain]) is plain  # 200/2 squares are within a quarter of 1000/2, or not:
    assert (
        w.advantage(best, trial(0.0, N + 300)) > 0
        and w.most_parsimonious([best, trial(0.0, N + 300, rarity=-1.0)]) is best
    )
    assert w.most_parsimonious([best, trial(0.0, N + 200, rarity=-1.0, numbers=2)]) is best  # with more numbers


@pytest.mark.parametrize("value, means", [(0.5, True), (1 - 2e-6, True), (1 - 5e-7, False), (5e-7, True), (1.0, False)])
def test_an_amplitude_at_its_bound_means_nothing_but_off(value, means):
    w = weighing()
    assert w.physically_meaningful(trial(numbers=2, causes=(GAIN,), theta=[0.5, value])) == means
    assert w.physically_meaningful(trial(numbers=2, causes=(GAIN,), theta=[0.5, value]), (GAIN,))


def test_an_amplitude_at_a_bound_that_is_not_off_means_nothing_either():
    t = trial(numbers=2, causes=(GAIN,), theta=[0.5, -1 + 5e-7])
    t.fit.structure.free_parameters = (number(), number(0, low=-1.0))
    assert not weighing().physically_meaningful(t)
    t.fit.theta = np.array([0.5, -1 + 3e-6])
    assert weighing().physically_meaningful(t)


@pytest.mark.parametrize("value, means", [(0.79, False), (0.81, True), (1.19, True), (1.21, False)])
def test_an_amplitude_that_is_not_usual_is_something_else(value, means):
    t = trial(numbers=2, causes=(GAIN,), theta=[0.5, value], usual=(0.8, 1.2))
    t.fit.structure.free_parameters = (number(), number(0, high=2.0))
    assert weighing().physically_meaningful(t) == means


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
    return CandidateModel(fit, N + held, 0.0)


@pytest.mark.parametrize("sd, times", [(0.15, 1.0), (0.16, 5.0)])
def test_what_a_law_that_is_right_to_a_hundredth_may_leave_is_doubtful(sd, times):
    """A creep, right to a hundredth, takes 4e6 squares where fitted and 1e6 where held out: 400 and 100 of them, in geometric
    mean 200, may be its form; five times as much of itself, 25 times the squares, beside a gain of 0.3 that may be nothing."""
    w = weighing(trial=lambda structure, **_: fitted(4e6, 1e6))
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
    n_fit: int = 10**6,
):
    """The verdict on whitened readings (n, n_y) of a held-out record."""
    n_y = white.shape[1]
    noise = Noise(np.ones(n_y), (np.zeros(0),) * n_y, np.ones(n_y, bool), ("",) * n_y, np.full(n_y, count))
    channels = tuple(f"reading.{i}" for i in range(n_y))
    held = record("hold_out", len(white), n_y, white, drive)
    recording = Recording("t", "any", "series", channels, ("um",) * n_y, (1.0,) * n_y, (held,), ())
    fit = SimpleNamespace(n=n_fit + 3, theta=np.zeros(3), chi2=fitted_ratio**2 * n_fit)
    fitter = SimpleNamespace(
        noise=noise,
        held_out_records=[held],
        recording=recording,
        whitened_residual=lambda fit, r: white,
    )
    return residual_tests_of(fitter, fit, price)


def sized(ratio: float, n: int = 20000, n_y: int = 1) -> np.ndarray:
    """White noise, root mean square exactly `ratio`."""
    white = np.random.default_rng(5).standard_normal((n, n_y))
    return ratio * white / np.sqrt(np.mean(white**2, axis=0))


@pytest.mark.parametrize("ratio, passes", [(1.099, True), (1.101, False)])
def test_held_out_noise_may_be_a_tenth_larger_than_expected(ratio, passes):
    found = judged(sized(ratio))
    assert found.ratio == pytest.approx((ratio,)) and found.worst == pytest.approx(ratio) and found.passed == passes


@pytest.mark.parametrize("ratio, passes", [(1.099, True), (1.101, False)])
def test_what_was_fitted_may_be_a_tenth_larger_too(ratio, passes):
    assert judged(sized(1.0), fitted_ratio=ratio).passed == passes


def test_one_channel_of_several_is_enough():
    two = sized(1.0, n_y=2)
    two[:, 1] *= 1.2
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
    return (rms * y / np.sqrt(np.mean(y**2)))[:, None]


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
    u -= e * (e @ u) / (e @ e)
    drive = (u / np.linalg.norm(u) + z / np.sqrt(n) * e / np.linalg.norm(e))[:, None]
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
    rest = stats.t.rvs(tails, size=(4000, 1), random_state=3)
    white = sized(1.0)
    noise = Noise(np.ones(1), (np.zeros(0),), np.ones(1, bool), ("",), np.full(1, np.inf))
    still, held = record("rest", 4000, 1, rest), record("hold_out", len(white), 1, white)
    recording = Recording("t", "any", "series", ("reading.axis",), ("um",), (1.0,), (held, still), ())
    fitter = SimpleNamespace(
        noise=noise,
        held_out_records=[held],
        recording=recording,
        whitened_residual=lambda fit, r: r.observed,
    )
    found = residual_tests_of(fitter, SimpleNamespace(n=10**6, theta=np.zeros(0), chi2=1e6))
    assert found.restless == (("reading.axis",) if moves else ()) and found.passed == (not moves)

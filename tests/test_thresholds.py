"""Every threshold by which structures are weighed, on either side of it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS
from misfits import BLOCKS, errors_of, left, noise_of, record, weighed_by

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.model_selection import ModelSelection, wins_by_block
from ctrlgen.diagnosis.selection.objections import objections
from ctrlgen.estimation.error_model import ErrorModel
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

N = 1000  # samples to fit, and held out
CREEP, GAIN = Hypothesis("creep", "stage:axis", "axis"), Hypothesis("drive_gain", "actuator:axis", "axis")
JUST = 1e-6  # of a threshold: beside it


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

"""Trials that cannot win any more end: a part of the records tells, or noise alone is left already."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, BACKLASH, NOISE, H, axis_fitter, drive, fitter_of, played, record

from ctrlgen.diagnosis.selection import candidates, rivals
from ctrlgen.diagnosis.selection.screen import Screen, Screened
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.shifts import best_shift
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.estimation import simulator
from ctrlgen.estimation.error_model import ErrorModel
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.least_squares import LeastSquaresProblem
from ctrlgen.estimation.noise import NoiseSource
from ctrlgen.estimation.settings import FIT, LEADING_PART
from ctrlgen.estimation.structure import Structure
from ctrlgen.numerics import compiled

LONG = 4 * LEADING_PART.shortest
CYCLIC = Hypothesis("cyclic", "sensor:axis", "axis")
EVENT = Hypothesis("sensor_step", "disturbance:axis", "axis")
CLOCK = Hypothesis("delay", "sensor:axis", "axis")
PITCH = 20e-6


def seen_samples(monkeypatch) -> list[int]:
    """On how many samples slopes are taken from now on."""
    samples, real = [], LeastSquaresProblem.evaluate
    monkeypatch.setattr(
        LeastSquaresProblem, "evaluate", lambda self, x: samples.append(len(self.records[0].time)) or real(self, x)
    )
    return samples


def test_another_start_is_fitted_to_all_samples_only_where_it_is_better_on_their_leading_part(monkeypatch):
    fitter = axis_fitter(n=LONG, change=lambda y, u: y + 20 * NOISE * np.sin(2 * np.pi * y / PITCH))

    def begun(period: float) -> Structure:
        return Structure(AXIS).with_cause(CYCLIC, {"amplitude": 10 * NOISE, "period": period, "phase": 0.0})

    right, wrong = (fitter.fit(begun(p), steps=8) for p in (PITCH, 0.37 * PITCH))
    assert right.objective < 0.5 * wrong.objective
    samples = seen_samples(monkeypatch)
    assert fitter.better_of(right, begun(0.37 * PITCH), 8) is right
    assert set(samples) == {LONG // 4}
    found = fitter.better_of(wrong, begun(PITCH), 8)
    assert found.objective == pytest.approx(right.objective, abs=0.05) and LONG in samples


def test_an_event_behind_the_part_is_sought_in_all_samples():
    """A small step within the first quarter, a large one behind it: that part alone wants the small one."""
    moments, sizes = np.array([0.1, 0.61]) * LONG, (10 * NOISE, 40 * NOISE)

    def change(y: np.ndarray, u: np.ndarray) -> np.ndarray:
        return y + sum(size * (np.arange(LONG) > moment) for moment, size in zip(moments, sizes, strict=True))

    fitter = axis_fitter(n=LONG, change=change)
    small, large = (
        Structure(AXIS).with_cause(EVENT, {"offset": size / 2, "moment": moment * H, "rise": 0.01})
        for moment, size in zip(moments, sizes, strict=True)
    )
    early = fitter.fit(small, steps=0)
    assert fitter.better_of(early, large, 16).objective < 0.5 * early.objective


def test_slopes_by_initial_states_are_read_off_all_slopes_where_those_are_compiled(monkeypatch):
    if compiled.compiler() is None:
        pytest.skip("no C compiler")
    made, real = [], simulator.Recursion
    monkeypatch.setattr(compiled, "SECONDS_PER_CHARACTER", 0.0)
    monkeypatch.setattr(simulator, "Recursion", lambda one: made.append(one) or real(one))
    structure, u = Structure(AXIS), drive(20_000)
    moved = record(u, u, "fit")
    free, p = tuple(number.path for number in structure.free_parameters), structure.start
    alone, whole = (simulator.Simulator(AXIS, free, ("reading.axis",), *moved.timing) for _ in range(2))
    wanted = alone.sensitivities(moved, p, by_free=False)
    slopes = whole.sensitivities(moved, p)[1]
    assert len(made) == 2
    found = whole.sensitivities(moved, p, by_free=False)
    assert len(made) == 2 and np.array_equal(found[1], slopes[:, :, len(p) :])
    assert all(np.array_equal(a, b) for a, b in zip(found, wanted, strict=True))


def trials_beside(fitter, hypotheses) -> tuple[Trials, candidates.CandidateModel]:
    trials = Trials(fitter, Screen(fitter, hypotheses), lambda _: None)
    weighed, described = fitter.described(AXIS)
    trials.use(weighed)
    return trials, trials.fit(described.restarted, steps=FIT.max_steps)


def test_beside_a_cause_that_leaves_noise_alone_no_regions_sets_or_shifts_are_tried(monkeypatch):
    trials, current = trials_beside(fitter_of(played), [BACKLASH, CLOCK])
    real, beside = candidates.fit_other_clocks, []
    monkeypatch.setattr(
        candidates, "fit_other_clocks", lambda t, c, singles: beside.append(tuple(singles)) or real(t, c, singles)
    )
    for name in ("fit_in_regions", "fit_subsets"):
        monkeypatch.setattr(candidates, name, lambda *_: pytest.fail("tried"))
    found = candidates.fit_candidates(trials, current, trials.screened(current))
    assert beside == [()] and {t.causes for t in found} == {(BACKLASH,), (CLOCK,)}


def test_of_what_is_too_little_for_a_name_only_much_is_sought(monkeypatch):
    """On the held-out records less than a hundredth of the squares that the device as described leaves there."""
    trials, described = trials_beside(fitter_of(played), [BACKLASH, CLOCK])
    held = trials.tried(described.fit.restarted.with_cause(BACKLASH, {"gap": 5e-8}), BACKLASH, described.fit)[0]
    trials.mismatch = described.held_out.plain_mean * trials.fitter.noise.floor**2

    def leaving(share: float) -> candidates.CandidateModel:
        left = replace(described.held_out, plain=share * described.held_out.plain)
        return replace(held, errors=described.errors, fitted=described.fitted, held_out=left)

    little, more = leaving(0.009), leaving(0.02)
    assert trials.selection.only_much_matters(little) and not trials.selection.only_much_matters(more)
    assert not trials.selection.only_much_matters(replace(little, errors=held.errors))  # noise alone
    start = {"amplitude": 10 * NOISE, "period": PITCH, "phase": 0.0}
    (harmonic,) = trials.tried(described.fit.restarted.with_cause(CYCLIC, start), CYCLIC, described.fit)
    assert not trials.selection.only_much_matters(replace(little, fit=harmonic.fit))
    sets, begun, singles, fit_each = [], [], [], candidates.fit_each
    monkeypatch.setattr(candidates, "leaves_noise_alone", lambda *_: False)
    monkeypatch.setattr(candidates, "fit_subsets", lambda *given: sets.append(given[-2:]) or ())
    monkeypatch.setattr(candidates, "restart_elsewhere", lambda trials, t, *_: begun.append(t) or t)
    monkeypatch.setattr(
        candidates, "fit_each", lambda t, fit, all_: singles.append(list(all_)) or fit_each(t, fit, all_)
    )
    screened = trials.screened(described)
    need = candidates.much_of(little)
    n, errors = described.fitted.n_plain.sum(), described.errors
    assert need == pytest.approx(0.375 * n / errors.tau[0])
    assert screened.suspects[0].hypothesis == BACKLASH and screened.suspects[0].z ** 2 > need  # it is all that is left
    two = replace(
        described.fitted, n_plain=np.array([[40.0, 9.0], [40.0, 9.0]]), white=np.array([[7e3, 4.0], [7e3, 2.0]])
    )
    both = replace(errors, rms=np.array([1e-7, 0.0]), tau=np.array([20.0, 1.0]))
    assert replace(little, fitted=two, errors=both).squares == pytest.approx([4.0, 6.0])
    assert candidates.much_of(replace(little, fitted=two, errors=both)) == pytest.approx(0.375 * 4)  # of the lightest
    loud, weak = (replace(screened.suspects[0], z=z * np.sqrt(need)) for z in (1.01, 0.99))
    for suspects in ((loud,), (weak,)):
        candidates.fit_candidates(trials, little, replace(screened, suspects=suspects), 4, plainly=True)
    assert (singles, sets, begun) == ([[loud], []], [(2, need)] * 2, [])
    candidates.fit_candidates(trials, more, replace(screened, suspects=(weak,)), 4)
    assert singles[2][0] is weak and sets[-1] == (4, 0.0) and begun


def test_a_cause_of_a_thousandth_of_the_mismatch_is_found_where_it_is_most_of_the_rest():
    """A reading bent by 300 times the noise, and a play of twelve times: the rest is five times the noise."""
    bend = Hypothesis("cubic_sensor", "sensor:axis", "axis")
    fitter = fitter_of(played, after=lambda y: y + 1e7 * y**3)
    found = Searcher(fitter, Screen(fitter, [bend, BACKLASH, CYCLIC]), lambda _: None).run(AXIS)
    rounds = [r.before for r in found.rounds]
    trials = Trials(fitter, Screen(fitter, []), lambda _: None)
    trials.mismatch = rounds[0].held_out.plain_mean * fitter.noise.floor**2
    assert rounds[1].causes == (bend,) and trials.selection.only_much_matters(rounds[1])
    assert found.chosen.causes == (bend, BACKLASH)
    assert found.chosen.fit.values(1)["gap"] == pytest.approx(6e-8, rel=0.05)
    # squares over those of the noise
    assert rounds[1].held_out.plain_mean > 20 and found.chosen.held_out.plain_mean < 1.5


def test_a_cause_is_asked_what_it_leaves_once_it_is_fitted_under_its_own_errors():
    trials, current = trials_beside(fitter_of(played), [BACKLASH])
    held = trials.tried(current.fit.restarted.with_cause(BACKLASH, {"gap": 5e-8}), BACKLASH, current.fit)[0]
    # as where numbers that the file states are held by the weight of what others leave
    coarse = replace(held, errors=ErrorModel(trials.fitter.noise, np.array([3 * NOISE]), np.array([2.0])))
    assert trials.leaves_noise_alone(held) and trials.leaves_noise_alone(coarse)
    assert candidates.leaves_noise_alone(trials, current, [coarse])
    assert not trials.leaves_noise_alone(current) and not candidates.leaves_noise_alone(trials, current, [current])
    little = replace(coarse, fitted=current.fitted)
    assert not candidates.leaves_noise_alone(trials, current, [little])
    unknown = replace(trials.fitter.noise, sources=(NoiseSource.MISFIT,))
    trials.use(replace(trials.fitter, noise=unknown))
    assert not candidates.leaves_noise_alone(trials, current, [coarse])


def test_a_model_is_screened_again_where_errors_numbers_or_samples_have_changed(monkeypatch):
    trials, current = trials_beside(fitter_of(played), [BACKLASH])
    runs = []
    monkeypatch.setattr(
        trials.screen, "run", lambda fit: runs.append(fit) or Screened((), np.zeros((0, 0)), lambda: 1.0, {})
    )
    first, fitter = trials.screened(current), trials.fitter
    sd = np.sqrt(current.fit.covariance.diagonal())

    def again(by: float = 0.0, fit_by: float = 1.0, recording=fitter.recording) -> bool:
        rms = fitter.errors.rms * fit_by
        trials.use(replace(fitter, errors=replace(fitter.errors, rms=rms), recording=recording))
        trials.latest = fitter, current.fit, first
        moved = replace(current, fit=replace(current.fit, theta=current.fit.theta + by * sd))
        return trials.screened(moved) is first

    assert again(0.05, 1.005) and len(runs) == 1
    assert not again(0.2) and not again(fit_by=1.05) and not again(recording=replace(fitter.recording, notes=()))
    assert len(runs) == 4


def test_what_ended_early_is_fitted_again_where_it_need_not_reach_as_much():
    trials, current = trials_beside(fitter_of(played), [BACKLASH])
    begun = current.fit.restarted.with_cause(BACKLASH, {"gap": 3e-8})
    early = trials.fit(begun, BACKLASH, enough=-np.inf)
    assert early.fit.values(0)["gap"] == 3e-8
    whole = trials.fit(begun, BACKLASH, enough=early.fit.objective)
    assert whole.fit.objective < 0.5 * early.fit.objective
    assert trials.fit(begun, BACKLASH).fit is whole.fit


def test_a_set_is_fitted_as_long_as_it_may_reach_what_a_smaller_one_did(monkeypatch):
    trials, current = trials_beside(fitter_of(played), [BACKLASH, CLOCK])
    screened = trials.screened(current)
    single = trials.fit(current.fit.restarted.with_cause(CLOCK, {"delay": 1e-5}), CLOCK)
    two = screened.suspects[:2]
    screened = replace(screened, together=lambda: ((1e12, two),))
    asked = []
    monkeypatch.setattr(Trials, "tried", lambda *_, enough: asked.append(enough) or [])
    candidates.fit_subsets(trials, current, screened, [single])
    assert asked == [pytest.approx(single.fit.objective)]


def test_rivals_are_fitted_to_their_end_where_they_may_leave_about_as_little(monkeypatch):
    """Of few independent samples, twenty say, a ratio of the squares tells little: T is 20 ln of it."""
    trials, described = trials_beside(fitter_of(played), [BACKLASH, CLOCK])
    held = trials.tried(described.fit.restarted.with_cause(BACKLASH, {"gap": 5e-8}), BACKLASH, described.fit)[0]
    held = trials.converged(held)
    late = trials.fit(described.fit.restarted.with_cause(CLOCK, {"delay": 1e-5}), CLOCK, steps=1)
    asked, converged = [], Trials.converged
    monkeypatch.setattr(Trials, "close_contenders", lambda *_: [late])
    monkeypatch.setattr(
        Trials, "converged", lambda self, t, enough=np.inf: asked.append(enough) or converged(self, t, enough)
    )
    slow = ErrorModel(trials.fitter.noise, np.array([NOISE]), held.fitted.n_plain.sum(axis=0) / 20)
    for model in (held, replace(held, errors=slow)):
        rivals.replacements(trials, model, 0)
    assert asked == pytest.approx([2 * held.fit.objective, np.exp(3) * held.fit.objective])


@pytest.mark.parametrize("told", [True, False], ids=["far", "hardly told"])
def test_what_came_nowhere_near_in_a_place_is_not_fitted_there_again(monkeypatch, told):
    trials, described = trials_beside(fitter_of(played), [BACKLASH, CLOCK])
    held = trials.tried(described.fit.restarted.with_cause(BACKLASH, {"gap": 5e-8}), BACKLASH, described.fit)[0]
    held, fitted, tried = trials.converged(held), [], Trials.tried
    monkeypatch.setattr(rivals, "hardly_told", lambda *_: not told)
    monkeypatch.setattr(rivals, "significant", lambda *_: [SimpleNamespace(hypothesis=CLOCK, z=1e9)])
    begun = described.fit.restarted.with_cause(CLOCK, {"delay": 1e-5})
    monkeypatch.setattr(rivals, "replace_cause", lambda *_: begun)
    monkeypatch.setattr(Trials, "tried", lambda self, s, *a, **kw: fitted.append(s.causes) or tried(self, s, *a, **kw))
    (rival,) = rivals.replacements(trials, held, 0)
    assert rival.fit.objective > SEARCH.rival_reach * held.fit.objective and set(fitted) == {(CLOCK,)}
    fitted.clear()
    trials.use(replace(trials.fitter))  # as with other errors
    assert len(rivals.replacements(trials, held, 0)) == len(set(fitted)) == (not told)
    trials.without_kin(BACKLASH).beaten["what it learns"] = ()
    assert trials.beaten == ({(BACKLASH, CLOCK): (frozenset(),)} if told else {})
    # it was nowhere near beside this cause too, or has not been tried beside it
    start = {"amplitude": NOISE, "period": PITCH, "phase": 0.0}
    (both,) = trials.tried(held.fit.restarted.with_cause(CYCLIC, start), CYCLIC, steps=1)
    for beside in (frozenset({CYCLIC, EVENT}), frozenset({EVENT})):
        trials.beaten, fitted[:] = {(BACKLASH, CLOCK): (beside,)}, []
        rivals.replacements(trials, both, 0)
        assert bool(fitted) == (CYCLIC not in beside)


def test_what_one_rival_leaves_far_behind_is_not_fitted_in_its_place(monkeypatch):
    trials, described = trials_beside(fitter_of(played), [BACKLASH, CLOCK, CYCLIC])
    late = trials.fit(described.fit.restarted.with_cause(CLOCK, {"delay": 1e-5}), CLOCK, steps=1)
    begun = {BACKLASH: {"gap": 5e-8}, CYCLIC: {"amplitude": NOISE, "period": PITCH, "phase": 0.0}}
    monkeypatch.setattr(rivals, "hardly_told", lambda *_: False)
    monkeypatch.setattr(rivals, "significant", lambda *_: [SimpleNamespace(hypothesis=h, z=1e9) for h in begun])
    monkeypatch.setattr(
        rivals,
        "replace_cause",
        lambda *given: described.fit.restarted.with_cause(given[-1].hypothesis, begun[given[-1].hypothesis]),
    )
    assert len(rivals.replacements(trials, late, 0)) == 2
    assert trials.beaten == {(BACKLASH, CYCLIC): (frozenset(),)}


# the slope tells the first, the best of many shifts the last
@pytest.mark.parametrize(
    "late, shift", [(3e-4, H), (7e-3, 7e-3), (0.02, 0.02)], ids=["a third of a sample", "seven", "twenty"]
)
def test_a_fit_takes_away_no_more_than_several_times_what_a_shift_promises(late, shift):
    t = H * np.arange(LONG)
    trials, current = trials_beside(axis_fitter(n=LONG, change=lambda y, u: np.interp(t - late, t, y)), [CLOCK])
    begun, promised = best_shift(trials.fitter, current.fit, CLOCK, H)
    fitted = trials.fit(current.fit.restarted.with_cause(CLOCK, begun), CLOCK)
    took = current.fit.objective - fitted.fit.objective
    assert begun["delay"] == pytest.approx(shift) and took > 0.5 * current.fit.objective
    assert 0.9 * promised < took < SEARCH.generous_promise * promised


def test_a_shift_that_cannot_take_away_enough_is_not_fitted(monkeypatch):
    trials, current = trials_beside(fitter_of(played), [BACKLASH, CLOCK])
    rough = trials.fit(current.fit.restarted.with_cause(BACKLASH, {"gap": 3e-8}), BACKLASH, enough=-np.inf)
    single = replace(rough, fit=replace(rough.fit, chi2=0.5 * current.fit.objective, penalty=0.0))
    fitted, promises = [], {id(current.fit): 0.0, id(single.fit): 0.0}
    monkeypatch.setattr(Trials, "tried", lambda _, structure, *__: fitted.append(structure.causes) or [])
    monkeypatch.setattr(candidates, "best_shift", lambda _, fit, *__: ({"delay": H}, promises[id(fit)]))
    # what a single takes away; what that leaves
    need = (
        0.5 * current.fit.objective * np.array([SEARCH.smallest_score, SEARCH.subset_share]) / SEARCH.generous_promise
    )
    for times, wanted in ((0.99, []), (1.01, [(CLOCK,), (BACKLASH, CLOCK)])):
        promises |= dict(zip(promises, times * need, strict=True))
        candidates.fit_other_clocks(trials, current, [single])
        assert fitted == wanted


def test_what_a_fit_leaves_without_a_cause_is_screened_once_and_forgotten_with_that_fit(monkeypatch):
    trials, current = trials_beside(fitter_of(played), [BACKLASH, CLOCK])
    first, second = (
        trials.fit(current.fit.restarted.with_cause(cause, start), cause, steps=1).fit
        for cause, start in ((BACKLASH, {"gap": 3e-8}), (CLOCK, {"delay": H}))
    )
    screens = []
    monkeypatch.setattr(
        trials.screen,
        "run",
        lambda fit, threshold: screens.append((fit, threshold)) or Screened((), np.zeros((0, 0)), lambda: 1.0, {}),
    )
    assert trials.screened_without(first, 0) == trials.screened_without(first, 0) and len(screens) == 1
    # what chance reaches was told by the latest screen
    trials.latest = trials.fitter, first, Screened((), np.zeros((0, 0)), lambda: 3.0, {})
    trials.screened_without(second, 0)
    assert [level for _, level in screens] == [None, 3.0] and [fit for fit, *_ in trials.bare.values()] == [second]

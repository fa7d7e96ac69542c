"""Causes taken out of a model, trials that fail, and what a round tells of both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, BACKLASH, LATE, NOISE, H, axis_fitter, fitter_of, played

from ctrlgen.diagnosis.selection import pruning
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.pruning import all_pruned, pruned
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure

OFFSET = Hypothesis("drive_offset", "actuator:axis", "axis")
CYCLIC, EVENT = Hypothesis("cyclic", "sensor:axis", "axis"), Hypothesis("sensor_step", "disturbance:axis", "axis")


def nothing(_: str) -> None:
    pass


def at_bound(trials: Trials, candidate: CandidateModel, cause: Hypothesis) -> CandidateModel:
    """The candidate with the amplitude of `cause` at the upper end of its range."""
    k = candidate.causes.index(cause)
    theta = candidate.fit.theta.copy()
    for i, u in enumerate(candidate.fit.structure.free_parameters):
        if u.cause == k and u.amplitude:
            theta[i] = u.high
    return replace(candidate, fit=replace(candidate.fit, theta=theta))


@pytest.fixture(scope="module")
def pair() -> tuple[Trials, CandidateModel]:
    """A play and an offset of the drive that stands at its bound."""
    fitter = fitter_of(played)
    trials = Trials(fitter, Screen(fitter, [BACKLASH, OFFSET]), nothing)
    both = Structure(AXIS).with_cause(BACKLASH, {"gap": 6e-8}).with_cause(OFFSET, {"offset": 0.0})
    return trials, at_bound(trials, trials.fit(both), OFFSET)


def test_of_a_set_with_one_cause_at_its_bound_the_rest_is_kept(pair):
    trials, candidate = pair
    trials.new_round()
    kept = pruned(trials, candidate, ())
    assert kept is not None and kept.causes == (BACKLASH,)
    assert kept.fit.values(0)["gap"] == pytest.approx(6e-8, rel=0.05)  # fitted again
    (refusal,) = trials.refused
    assert refusal.candidate is candidate and refusal.causes == (OFFSET,) and "at its bound" in refusal.reasons[0]


def test_a_cause_that_is_accepted_is_not_objected_to_again(pair):
    trials, candidate = pair
    trials.new_round()
    assert pruned(trials, candidate, (OFFSET,)) is candidate and trials.refused == []


def test_a_candidate_of_which_nothing_new_is_left_is_refused_with_its_reason(pair):
    trials, candidate = pair
    trials.new_round()
    assert pruned(trials, candidate, (BACKLASH,)) is None and len(trials.refused) == 1


def test_what_is_left_of_two_candidates_stands_once(pair):
    trials, candidate = pair
    trials.new_round()
    alone = trials.fit(Structure(AXIS).with_cause(BACKLASH, {"gap": 6e-8}))
    nominal = trials.fit(Structure(AXIS))
    assert [t.causes for t in all_pruned(trials, nominal, [alone, candidate])] == [(BACKLASH,)]


def test_what_takes_away_far_less_than_a_sound_cause_is_not_begun_elsewhere(pair, monkeypatch):
    trials, both = pair
    play = trials.fit(Structure(AXIS).with_cause(BACKLASH, {"gap": 6e-8}))
    nominal = trials.fit(Structure(AXIS))
    bound = at_bound(trials, trials.fit(Structure(AXIS).with_cause(OFFSET, {"offset": 0.0})), OFFSET)
    screened, begun = trials.screened(nominal), []
    monkeypatch.setattr(
        pruning, "pruned", lambda branch, t, accepted, starts, before: begun.append((t.causes, bool(starts)))
    )
    all_pruned(trials, nominal, [play, bound, both], screened)
    assert begun == [((BACKLASH,), True), ((OFFSET,), False), ((BACKLASH, OFFSET), True)]
    all_pruned(trials, nominal, [bound], screened)
    assert begun[3:] == [((OFFSET,), True)]


@pytest.mark.parametrize("refused", [(0, 1), (0,)])
def test_causes_that_meet_an_objection_are_begun_in_the_starts_that_come_nearest(monkeypatch, refused):
    """Of several causes as many starts as of one; those of one in their order. A fit ends where it will not reach what is there."""
    pitch, n = 20e-6, 600
    fitter = axis_fitter(n=n, change=lambda y, u: y + 20 * NOISE * np.sin(2 * np.pi * y / pitch))
    trials = Trials(fitter, Screen(fitter, [CYCLIC, EVENT]), nothing)
    line = {"amplitude": 10 * NOISE, "period": pitch, "phase": 0.0}
    step = {"offset": 3 * NOISE, "moment": n * H / 2, "rise": 0.01}
    before = trials.fit(Structure(AXIS))
    candidate = trials.fit(Structure(AXIS).with_cause(CYCLIC, line).with_cause(EVENT, step))
    starts = {
        CYCLIC: [line, *(line | {"period": f * pitch} for f in (3.0, 0.6, 1.7, 0.3, 1.05))],
        EVENT: [step, *(step | {"moment": f * n * H, "offset": 1e3 * NOISE} for f in (0.2, 0.3, 0.7, 0.8))],
    }
    monkeypatch.setattr(Trials, "objections", lambda *_: dict.fromkeys(refused, "it is another"))
    begun, real = [], type(fitter).fit
    monkeypatch.setattr(
        type(fitter), "fit", lambda self, s, **more: begun.append((s, more.get("enough"))) or real(self, s, **more)
    )
    pruned(trials, candidate, (EVENT,) if refused == (0,) else (), starts, before)
    elsewhere = [s.starts[0]["period"] / pitch for s, enough in begun if enough == before.fit.objective]
    assert len(elsewhere) == SEARCH.restarts
    if refused == (0,):
        assert elsewhere == pytest.approx([3.0, 0.6, 1.7, 0.3])
    else:
        structure, most = candidate.fit.restarted, 1 + SEARCH.restarts
        others = [structure.restarted(k, s) for k, c in enumerate((CYCLIC, EVENT)) for s in starts[c][1:most]]
        nearest = sorted(map(fitter.rough_objective, others))[: SEARCH.restarts]
        assert [fitter.rough_objective(s) for s, _ in begun] == pytest.approx(nearest)


@pytest.mark.long
def test_a_trial_that_raises_is_noted_and_the_search_goes_on(monkeypatch):
    """Everything with a late creep fails, as where a balance does not exist."""
    fitter = fitter_of(played)
    real = type(fitter).fit

    def fit(self, structure, *given, **more):
        if LATE in structure.causes:
            raise RuntimeError("no balance")
        return real(self, structure, *given, **more)

    monkeypatch.setattr(type(fitter), "fit", fit)
    screen = Screen(fitter, [BACKLASH, LATE])
    loud = screen.run

    def run(fit):
        found = loud(fit)
        return replace(found, suspects=tuple(replace(s, z=1e3 * np.sign(s.z)) for s in found.suspects))

    monkeypatch.setattr(screen, "run", run)
    found = Searcher(fitter, screen, nothing).run(AXIS)
    assert [c.effect for c in found.chosen.causes] == ["backlash"]
    assert "log_creep at stage:axis: no balance" in map(str, found.rounds[0].failed)


def test_what_is_refused_although_it_scores_better_stands_in_its_round(monkeypatch):
    """A play that would explain all, if it were allowed to be one."""
    fitter = fitter_of(played)
    trials = "ctrlgen.diagnosis.selection.trials.objections"
    monkeypatch.setattr(trials, lambda *_: {0: "so it is"} if _[1].structure.causes else {})
    found = Searcher(fitter, Screen(fitter, [BACKLASH]), nothing).run(AXIS)
    assert found.chosen.causes == ()
    (round_,) = found.rounds
    (refusal,) = round_.refused
    assert refusal.causes == (BACKLASH,) and refusal.reasons == ("so it is",) and round_.candidates == ()


def test_what_is_sound_of_a_set_whose_best_fit_is_refused_is_what_goes_on(monkeypatch):
    """A play in two valleys, of which the one that leaves less is no play: the fits that follow begin in the other one, and end there."""
    fitter = fitter_of(played)
    trials = Trials(fitter, Screen(fitter, [BACKLASH]), nothing)
    nominal = trials.fit(Structure(AXIS))
    refused = trials.fit(Structure(AXIS).with_cause(BACKLASH, {"gap": 6e-8}))
    sound = trials.scored(
        refused.fit.structure, fitter.fit(Structure(AXIS).with_cause(BACKLASH, {"gap": 5e-8}), steps=0)
    )
    assert sound.fit.objective > refused.fit.objective  # so that it is not what is known of its causes
    assert trials.fit(sound.fit.restarted).fit is refused.fit
    monkeypatch.setattr(pruning, "other_valleys", lambda cause, starts: list(starts[1:]))
    monkeypatch.setattr(type(fitter), "fit", lambda self, structure, **_: sound.fit)
    monkeypatch.setattr(
        "ctrlgen.diagnosis.selection.trials.objections",
        lambda r, fit, *_: {0: "so it is"} if fit is refused.fit else {},
    )
    starts = {BACKLASH: ({"gap": 6e-8}, {"gap": 5e-8})}
    kept = pruned(trials, refused, (), starts, nominal)
    assert kept.fit is sound.fit
    assert trials.converged(kept).fit is sound.fit

"""Where nothing is accepted, the search goes on beside what the held-out records refuse."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from axis_records import AXIS, BACKLASH, fitter_of, played

from ctrlgen.diagnosis.selection import candidates
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.search_history import search_history
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure

BOW = Hypothesis("bow", "sensor:axis", "axis")


def test_two_causes_that_held_out_records_confirm_together_alone_are_found(monkeypatch):
    """A late reading and the harmonics of its scale: fitted alone, each is bent by the other and foretells worse than neither."""
    fitter = fitter_of(lambda u: (y := played(u, 2e-7)) + 120 * y**2, n=700)
    enough = ModelSelection.improves_enough
    monkeypatch.setattr(ModelSelection, "improves_enough", lambda self, a, b: len(b.causes) != 1 and enough(self, a, b))
    monkeypatch.setattr(candidates, "fit_subsets", lambda *_: ())  # that foresees them at once only by slopes

    def found(searcher: Searcher) -> set[Hypothesis]:
        described = searcher.trials.fit(Structure(AXIS))
        begun = searcher.trials.with_errors(described)
        return set(searcher.forward_rounds(begun, []).causes)

    assert found(Searcher(fitter, Screen(fitter, [BACKLASH, BOW]), lambda _: None)) == {BACKLASH, BOW}


def test_a_search_beside_what_was_refused_that_finds_nothing_leaves_all_as_it_was(monkeypatch):
    """The errors of a refused model, and the readings that it marks, are not those of the model that stays; its trials are of the round."""
    fitter = fitter_of(lambda u: (y := played(u, 2e-7)) + 120 * y**2, n=700)
    monkeypatch.setattr(ModelSelection, "improves_enough", lambda self, a, b: False)
    monkeypatch.setattr(candidates, "fit_subsets", lambda *_: ())
    searcher = Searcher(fitter, Screen(fitter, [BACKLASH, BOW]), lambda _: None)
    begun = searcher.trials.with_errors(searcher.trials.fit(Structure(AXIS)))
    before, rounds = searcher.trials.fitter, []
    assert searcher.forward_rounds(begun, rounds).causes == () and len(rounds) == 1
    trials = searcher.trials
    assert trials.screen.fitter is trials.fitter
    assert trials.fitter.error.weighted.sd == pytest.approx(before.error.weighted.sd, rel=0.1)
    assert {a.round for a in searcher.trials.log if len(a.candidate.causes) == 2} == {2}


def test_a_search_beside_what_was_refused_is_told_as_that(monkeypatch):
    fitter, rounds = fitter_of(lambda u: (y := played(u, 2e-7)) + 120 * y**2, n=700), []
    enough = ModelSelection.improves_enough
    monkeypatch.setattr(ModelSelection, "improves_enough", lambda self, a, b: len(b.causes) != 1 and enough(self, a, b))
    monkeypatch.setattr(candidates, "fit_subsets", lambda *_: ())
    searcher = Searcher(fitter, Screen(fitter, [BACKLASH, BOW]), lambda _: None)
    described = searcher.trials.fit(Structure(AXIS))
    found = searcher.forward_rounds(searcher.trials.with_errors(described), rounds)
    told = search_history(
        SimpleNamespace(rounds=rounds, chosen=found, fitter=searcher.trials.fitter, nominal=described)
    )
    assert len(told) == len(rounds) > 1 and "refuse each candidate alone: searched on beside" in told[0].decision
    assert told[1].decision.startswith("added")

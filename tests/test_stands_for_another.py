"""A cause that was accepted and has come to stand for something else since: what is sound takes its place."""

from __future__ import annotations

from dataclasses import replace

import pytest
from axis_records import AXIS, BACKLASH, NOISE, fitter_of, played

from ctrlgen.diagnosis.selection import other_laws, search
from ctrlgen.diagnosis.selection.other_laws import stands_for_another, takes_over
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.settings import FIT
from ctrlgen.estimation.structure import Structure

LOOP = Hypothesis("displacement_hysteresis", "stage:axis", "axis")
GAIN = Hypothesis("sensor_gain", "sensor:axis", "axis")
GAP = 12 * NOISE


@pytest.fixture(scope="module")
def searched():
    """A play behind a gain, and the hysteresis that it was taken for: nearly all lags, in the narrowest of its plays."""
    fitter, _ = fitter_of(lambda u: 1.3 * played(u, GAP), n=400).described(AXIS)
    searcher = Searcher(fitter, Screen(fitter, [LOOP, BACKLASH, GAIN]), lambda _: None)
    start = {"share": 0.99, "reach": 4 * GAP, "taper": 2.9, "reversible": 0.0}
    loop = searcher.trials.fit(Structure(AXIS).with_cause(LOOP, start), LOOP, FIT.max_steps)
    return searcher, loop


@pytest.mark.long
def test_a_hysteresis_of_which_all_lags_is_a_play(searched):
    """No rival alone explains alike; the search without it suspects no law of its family, and the next one all of them again."""
    searcher, loop = searched
    rounds, before = [], searcher.trials
    assert stands_for_another(loop.fit, 0)
    found = searcher.without_other_laws(loop, rounds)
    assert BACKLASH in found.causes and LOOP not in found.causes and len(rounds) > 0
    assert searcher.trials is not before and searcher.trials.screen.hypotheses == [LOOP, BACKLASH, GAIN]
    assert len(searcher.trials.log) > len(rounds) and searcher.trials.screen.fitter is searcher.trials.fitter


def test_what_stands_for_another_itself_takes_nothing_over(searched, monkeypatch):
    trials, loop = searched[0].trials, searched[1]
    both = Structure(AXIS).with_cause(BACKLASH, {"gap": GAP}).with_cause(GAIN, {"gain": 0.3})
    play = trials.fit(both, BACKLASH, FIT.max_steps)
    assert takes_over(trials, play, loop, 0) and not takes_over(trials, loop, loop, 0)
    monkeypatch.setattr(other_laws, "stands_for_another", lambda fit, k: True)
    assert not takes_over(trials, play, loop, 0)


def test_nothing_is_searched_again_where_no_cause_stands_for_another(searched, monkeypatch):
    searcher, loop = searched
    monkeypatch.setattr(search, "replacements", None)
    monkeypatch.setattr(search, "stands_for_another", lambda fit, k: False)
    assert searcher.without_other_laws(loop, []) is loop


def test_a_pitch_that_grew_while_other_causes_came_and_went_is_not_in_the_end(searched, monkeypatch):
    """Of its period the records hold less than one; without it nothing is objected to."""
    searcher, loop = searched
    pitch = Hypothesis("cyclic", "sensor:axis", "axis")
    long = {"amplitude": NOISE, "period": 2e-3, "phase": 0.3}
    grown = searcher.trials.fit(loop.fit.restarted.with_cause(pitch, long), pitch, 0)
    monkeypatch.setattr(Searcher, "settled", lambda self, current: current)
    assert searcher.without_unseen_pitches(grown).causes == (LOOP,)
    assert searcher.without_unseen_pitches(loop) is loop


def test_a_search_that_finds_nothing_sound_leaves_all_as_it_was(searched, monkeypatch):
    """Errors, screen and rounds too; its attempts are kept for whoever asks what was tried."""
    searcher, loop = searched
    rounds, before = [], searcher.trials
    fitter, tried = before.fitter, len(before.log)
    monkeypatch.setattr(search, "takes_over", lambda *_: False)
    monkeypatch.setattr(Searcher, "searched_on", lambda self, begun, *_: self.trials.use(replace(fitter)) or begun)
    assert searcher.without_other_laws(loop, rounds) is loop
    assert searcher.trials is before and before.fitter is fitter and rounds == []
    assert before.screen.hypotheses == [LOOP, BACKLASH, GAIN] and len(before.log) > tried

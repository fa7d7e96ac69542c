"""Why a search did not take what it tried: in the report, in diagnosis.json, and for one law on request."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, BACKLASH, fitter_of, played
from conftest import AXIS_FILE
from creeping_axis import LAWS, creeping_recording
from misfits import left
from strokes import MM, servo, strokes

import ctrlgen
from ctrlgen.core.errors import InputError
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.report.diagnosis_record import Provenance, diagnosis_record
from ctrlgen.diagnosis.report.explain import explain
from ctrlgen.diagnosis.report.history_table import history_rows, most_gained, not_taken_rows
from ctrlgen.diagnosis.report.html_report import page
from ctrlgen.diagnosis.report.narrative import EMPIRICAL_ALONE, NOTHING_FOUND, next_steps, refusals
from ctrlgen.diagnosis.selection import not_taken as not_taken_module
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, Refusal
from ctrlgen.diagnosis.selection.findings import Finding
from ctrlgen.diagnosis.selection.model_selection import ModelSelection, Shortfall
from ctrlgen.diagnosis.selection.not_taken import better_than_their_round, held_out_rms, not_taken, that_matter
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search_history import held_out_error
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.diagnosis.settings import MODEL_SELECTION
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure

MADE_FROM = Provenance({}, 0)
OFFSET = Hypothesis("drive_offset", "actuator:axis", "axis")
DRIFT = Hypothesis("drift", "sensor:axis", "axis")


@pytest.fixture(scope="module")
def creeping(tmp_path_factory):
    """The answer for an axis that creeps, among a few laws."""
    return ctrlgen.diagnose(AXIS_FILE, creeping_recording(tmp_path_factory.mktemp("creeping")), laws=LAWS)


@pytest.fixture(scope="module")
def turned(tmp_path_factory):
    """The answer for an error of so short a way that, as a pitch, the reading would turn back: as a force would it be."""
    way = 0.05 * MM

    def error(place, time):
        return 0.012 * MM * np.sin(2 * np.pi * place / way)

    recording = strokes(error, (0.3 * MM, 0.21 * MM, 0.26 * MM), 2e-7, seconds=10.0)
    return diagnose_recording(
        servo(tmp_path_factory.mktemp("turned")), recording, laws=["cyclic", "sensor_gain"], jobs=0
    )


@pytest.mark.long
def test_the_law_that_was_found_tells_from_where_to_where_its_numbers_went(creeping):
    first, score, attempt, *_ = explain(creeping, "creep")
    assert first == "creep at stage:axis is in the answer." and "where chance reaches" in score
    assert "round 1: gain 0.0" in attempt and "tau" in attempt and "-> " in attempt
    for said in ("criterion better than the device as described by", "residual over noise", "held-out error", " nm"):
        assert said in attempt, said


@pytest.mark.long
def test_a_law_that_no_reading_asks_for_never_exceeded_the_threshold(creeping):
    quiet = [law for law in LAWS if law != "creep"]
    said = [line for law in quiet for line in explain(creeping, law)]
    assert any("never exceeded the threshold of the screen: score" in line for line in said) or any(
        "was not taken:" in line for line in said
    )


@pytest.mark.long
def test_a_law_that_cannot_act_there_is_not_offered_and_an_unknown_one_is_a_fault(creeping):
    assert explain(creeping, "thermal_lag") == [
        "thermal_lag: not offered, because it was not among the effects to consider."
    ]
    (heat,) = explain(creeping, "heat_crosstalk")
    assert heat.startswith("heat_crosstalk: not offered, because it needs heat")
    assert "never suspected" in explain(creeping, "empirical_speed")[0]
    with pytest.raises(InputError, match="known are: "):
        explain(creeping, "no_such_law")


@pytest.mark.long
def test_a_refusal_that_mattered_is_told_with_what_it_would_leave(turned):
    """In the next steps, on the page and in diagnosis.json, with its numbers and its held-out error."""
    assert turned.findings == () and turned.verdict == "unexplained"
    (said, *_) = refusals(turned)
    assert said.startswith("cyclic at sensor:axis, although the held-out error of axis would be ")
    assert " instead of " in said and said.endswith("the reading would turn back")
    (row, *_) = not_taken_rows(turned.search)
    assert "period = 0.05" in row["numbers"] and row["held_out"].endswith(" mm") and "turn back" in row["reason"]
    record = diagnosis_record(turned, MADE_FROM)
    entry = record.search_history[0].not_taken[0]
    assert entry.numbers["cyclic.period"].unit == "mm"
    assert entry.numbers["cyclic.period"].value == pytest.approx(0.05, rel=0.01)
    assert entry.held_out_error["reading.axis"].value < 0.25 * record.held_out["reading.axis"].rms_after
    shown = page(turned, MADE_FROM)
    assert "What was not taken" in shown and "the reading would turn back" in shown
    first, *_ = explain(turned, "cyclic")
    assert (
        first.startswith("cyclic at sensor:axis was not taken: ")
        and "turn back" in first
        and "(round 1, better" in first
    )


@pytest.mark.long
def test_the_history_is_a_table_with_one_outcome_a_model(creeping):
    rows = history_rows(creeping.search)
    assert rows[0]["model"] == "the device as described" and rows[0]["held_out"].endswith(" nm")
    taken = [row for row in rows if row["outcome"] == "taken"]
    assert taken and all(row["model"].startswith("+ creep at stage:axis") for row in taken)
    assert all(row["outcome"] for row in rows)
    assert "<th>outcome</th>" in page(creeping, MADE_FROM)


@pytest.fixture(scope="module")
def few() -> tuple[Trials, CandidateModel]:
    fitter = fitter_of(played)
    trials = Trials(fitter, Screen(fitter, [BACKLASH]), lambda _: None)
    return trials, trials.fit(Structure(AXIS), steps=0)


def test_every_fit_is_logged_with_its_start_and_without_its_slopes(few):
    trials, _ = few
    known = len(trials.log)
    trials.new_round(3)
    play = trials.fit(Structure(AXIS).with_cause(BACKLASH, {"gap": 3e-8}))
    trials.fit(Structure(AXIS).with_cause(BACKLASH, {"gap": 3e-8}))
    (attempt,) = trials.log[known:]
    assert attempt.round == 3 and attempt.started == ({"gap": 3e-8},) and attempt.candidate.causes == (BACKLASH,)
    assert attempt.candidate.fit.values(0) == play.fit.values(0)
    assert attempt.candidate.fit.J.size == 0 and attempt.candidate.fit.residual.size == 0
    compare = trials.selection
    assert compare.advantage(attempt.candidate, play) == pytest.approx(0.0, abs=1e-9)


def test_what_is_not_taken_stands_by_its_gain_with_one_reason_each(few):
    trials, before = few
    noisy = trials.fitter.with_errors_of(before.fit).error

    def model(causes: dict[Hypothesis, dict[str, float]], gone: float, held: float) -> CandidateModel:
        structure = Structure(AXIS)
        for cause, start in causes.items():
            structure = structure.with_cause(cause, start)
        fit = replace(trials.fitter.fit(structure, steps=0), penalty=0.0)
        return replace(before, fit=fit, errors=noisy, fitted=left(gone), held_out=left(held))

    bare = model({}, 1e6, 1e6)
    best = model({BACKLASH: {"gap": 6e-8}}, 2e5, 2e5)
    drift = model({DRIFT: {"rate": 1e-7}}, 1e5, 1e5)
    offset = model({OFFSET: {"offset": 0.1}}, 1e5, 2e6)
    refused = Refusal(model({OFFSET: {"offset": 0.2}}, 1e4, 1e4), (OFFSET,), ("offset is at its bound",))
    rows = not_taken(
        ModelSelection(trials.fitter, lambda *_: []), [refused, refused], [best, drift, offset], bare, best
    )
    assert [r.reasons[0] for r in rows] == [
        "offset is at its bound",
        "a function of time alone: backlash at stage:axis was taken, which explains nearly as much by the motion",
        Shortfall.UNCONFIRMED.value,
    ]
    assert [r.gain > 0 for r in rows] == [True, True, False] and rows[0].gain > rows[1].gain


@pytest.mark.parametrize("verdict", Verdict)
def test_a_refusal_that_matters_is_told_whatever_the_verdict(turned, verdict):
    told = next_steps(replace(turned, verdict=verdict))
    assert [step for step in told if step.startswith("Not taken: cyclic at sensor:axis, although the held-out error")]


def test_a_refusal_matters_that_gains_as_much_as_a_cause_must(monkeypatch):
    must = MODEL_SELECTION.least_gain + MODEL_SELECTION.least_confirmed
    rows = [(must * share, DRIFT) for share in (1.01, 0.99)]
    monkeypatch.setattr(not_taken_module, "better_than_their_round", lambda search: rows)
    assert that_matter(None) == rows[:1]


def test_what_later_rounds_overtook_stands_in_the_table_and_is_not_told(turned):
    """It scored better than what its own round took; beside the answer it gains nothing, or no more than chance."""
    search, (first, *_) = turned.search, turned.search.rounds
    overtaken = Refusal(search.chosen, (DRIFT,), ("few",), 30.0)
    rounds = (replace(first, refused=(*first.refused, overtaken)), *search.rounds[1:])
    told = replace(turned, search=replace(search, rounds=rounds))
    assert DRIFT in [r.causes[0] for _, r in better_than_their_round(told.search)]
    assert any(row["cause"] == "drift at sensor:axis" for row in not_taken_rows(told.search))
    assert refusals(told) == refusals(turned)


def test_an_alternative_of_the_answer_is_not_told_once_more(turned):
    ((_, refusal), *_) = that_matter(turned.search)
    main = Finding("drift", "sensor:axis", {}, refusal.causes, None, {}, "", DRIFT)
    assert refusals(turned) and not any(
        said.startswith("cyclic at sensor:axis,") for said in refusals(replace(turned, findings=(main,)))
    )


def test_a_refusal_that_the_answer_has_does_not_matter_any_more(turned):
    (row, *_) = that_matter(turned.search)
    with_it = replace(turned.search, chosen=row[1].candidate)
    assert not [r for r in that_matter(with_it) if r[1].causes == row[1].causes]


def test_an_error_that_is_told_is_that_of_the_numbers_as_fitted(creeping):
    """Where a model leaves the noise, models are compared with their numbers moved to the held-out records: that is no prediction."""
    fitter, chosen = creeping.search.fitter, creeping.search.chosen
    left = np.concatenate([(r.observed - fitter.predict(chosen.fit, r))[r.valid] for r in fitter.held_out_records])
    assert held_out_rms(chosen) == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-9)
    told = creeping.held_out["reading.axis"]
    assert held_out_error(creeping.search, chosen)["reading.axis"].value == pytest.approx(told.rms_after, rel=1e-9)
    assert told.rms_refitted < 0.999 * told.rms_after


def test_a_refusal_is_told_in_a_channel_in_which_it_would_be_better_or_in_none(turned):
    """What scores better by the records to fit may predict the held-out ones no better."""
    ((gain, refusal), *_) = that_matter(turned.search)
    channel, would, now = most_gained(turned.search, refusal.candidate)
    assert channel == "reading.axis" and would.value < now.value and gain > 0
    answer = turned.search.chosen
    no_better = replace(refusal.candidate, held_out=answer.held_out, unmoved=answer.unmoved)
    assert most_gained(turned.search, no_better) is None
    rounds = [replace(r, refused=(replace(refusal, candidate=no_better),)) for r in turned.search.rounds[:1]]
    told = replace(turned, search=replace(turned.search, rounds=tuple(rounds)))
    assert not any("would be" in said for said in refusals(told))


def test_a_refusal_is_told_with_the_causes_beside_it_that_were_dropped_since(turned):
    """Its error is that of all of them."""
    ((_, refusal), *_) = that_matter(turned.search)
    fit = refusal.candidate.fit
    structure = fit.restarted.with_cause(DRIFT, {"rate": 1e-9})
    wider = replace(refusal.candidate, fit=replace(fit, structure=structure, theta=structure.start))
    rounds = [replace(r, refused=(replace(refusal, candidate=wider),)) for r in turned.search.rounds[:1]]
    told = replace(turned, search=replace(turned.search, rounds=tuple(rounds)))
    assert [said.partition(",")[0] for said in refusals(told)] == ["cyclic at sensor:axis beside drift at sensor:axis"]
    assert not_taken_rows(told.search)[0]["cause"].endswith(" beside drift at sensor:axis")
    assert refusals(turned)[0].startswith("cyclic at sensor:axis, although ")


def test_where_nothing_is_found_no_number_of_it_is_uncertain_and_no_error_changes(turned):
    first, *_ = next_steps(turned)
    assert first == (EMPIRICAL_ALONE if turned.empirical_terms else NOTHING_FOUND)
    assert next_steps(replace(turned, empirical_terms=()))[0] == NOTHING_FOUND
    assert turned.search.chosen is turned.search.nominal
    assert all(e.rms_before == e.rms_after for e in turned.held_out.values())


@pytest.mark.parametrize("before, after, said", [(50.0, 4.0, True), (50.0, 1.9, False), (30.0, 4.0, False)])
def test_where_smaller_causes_were_not_sought_it_says_how_they_are(creeping, before, after, said):
    """Below a hundredth of the energy a search takes only what takes most away, and noise alone is no reason."""
    (channel, was), *_ = creeping.held_out.items()
    errors = {channel: was.model_copy(update={"rms_before": before, "rms_after": after, "noise_floor": 1.0})}
    left = replace(creeping, held_out=errors, residual_tests=replace(creeping.residual_tests, passed=False))
    assert any("diagnose device.next.toml with the same recordings" in step for step in next_steps(left)) == said

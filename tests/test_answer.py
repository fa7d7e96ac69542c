"""The three sentences of an answer, told of a diagnosis that is made of numbers."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fitted_causes import CREEP, DRIFT, GAIN, fitted

from ctrlgen.diagnosis.report.answer import answer
from ctrlgen.diagnosis.selection.attribution import ShareEntry
from ctrlgen.diagnosis.selection.findings import ChanceEntry, ChannelErrorEntry, Estimate, Finding
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.recordings.plausibility import Implausible


def finding(cause, share: float | None, *alternatives, chance: ChanceEntry | None = None) -> Finding:
    taken = None if share is None else ShareEntry(value=share, ci95=(share, share))
    return Finding(cause.effect, cause.location, {}, alternatives, taken, {}, "", cause, chance=chance)


def told(
    verdict: Verdict, *findings: Finding, passed=False, after=2.0, untried=(), taken=0.6, notes=(), held_out=True
) -> list[str]:
    errors = ChannelErrorEntry(
        rms_before=50.0,
        rms_after=after,
        noise_floor=1.0,
        unit="um",
        uncertainty=None,
        rms_refitted=after,
        goes_with_motion=None,
    )
    noise = SimpleNamespace(known=np.ones(1, bool))
    fitter = SimpleNamespace(recording=SimpleNamespace(tolerance=(None,)), noise=noise)
    chosen = SimpleNamespace(fit=fitted(), causes=tuple(f.cause for f in findings))
    return answer(
        SimpleNamespace(
            verdict=verdict,
            findings=findings,
            held_out={"reading.axis": errors},
            device=SimpleNamespace(title="an axis"),
            search=SimpleNamespace(chosen=chosen, fitter=fitter, unlikely=()),
            residual_tests=SimpleNamespace(passed=passed, uneven={}),
            untried=SimpleNamespace(sentences=lambda: list(untried)),
            shares=None,
            unconfirmed=(),
            attribution=SimpleNamespace(explained=taken, held_out=held_out),
            notes=notes,
        )
    )


def test_shares_of_the_records_to_fit_are_told_as_that():
    """Where no held-out record shows a mismatch, the table beside the sentence says little of them."""
    assert "of the records to fit" in told(Verdict.PARTLY, finding(GAIN, 1.0), held_out=False)[0]
    assert "of the records to fit" not in told(Verdict.PARTLY, finding(GAIN, 1.0))[0]


def test_of_a_law_that_is_there_or_is_not_the_numbers_that_are_measured_stand_first():
    for kind, name, unit in (("amplifier_lag", "tau", "ms"), ("slew_rate", "rate", "V/s")):
        cause = Hypothesis(kind, "actuator:axis", "axis")
        numbers = {"share": Estimate(1.0, (1.0, 1.0), "1"), name: Estimate(2.0, (1.9, 2.1), unit)}
        first = told(Verdict.EXPLAINED, replace(finding(cause, 1.0), parameters=numbers), passed=True)[0]
        there = cause.prior.of(cause.law.amplitude()).fixed_range is not None
        assert (first.index(f"{name} = 2") < first.index("share = 1")) == there == (kind == "slew_rate")


@pytest.mark.parametrize("share, says", [(0.16, True), (0.14, False), (None, False)])
def test_an_alternative_stands_beside_the_cause_that_it_is_one_of(share, says):
    """Where that cause is large enough to make the answer ambiguous, a quarter of the main one, and no part of another."""
    first = told(Verdict.AMBIGUOUS, finding(GAIN, 0.6, CREEP), finding(DRIFT, share, CREEP))[0]
    assert "; this recording cannot tell it from creep at stage:axis" in first
    assert (", nor drift at sensor:axis from creep at stage:axis." in first) == says


@pytest.mark.parametrize(
    "taken, leaves", [(0.67, "33 %"), (0.0, "all"), (0.0004, "> 99.9 %"), (0.75, None), (0.9, None)]
)
def test_what_explains_nothing_says_how_much_it_leaves(taken, leaves):
    """A column in another unit explains nothing either, whatever the causes take away: it is told elsewhere."""
    first = told(Verdict.UNEXPLAINED, finding(GAIN, 0.6), taken=taken)[0]
    assert (f"Unexplained: what was found leaves {leaves} of the error; the best of it is " in first) == (
        leaves is not None
    )
    assert "what was found" not in told(Verdict.PARTLY, finding(GAIN, 0.6), taken=taken)[0]


def test_of_many_alternatives_the_first_are_told():
    first = told(Verdict.AMBIGUOUS, finding(GAIN, 0.6, *[CREEP, DRIFT] * 3))[0]
    assert first.endswith("from creep at stage:axis or drift at sensor:axis or creep at stage:axis or 3 more.")


def test_an_explanation_tells_how_little_is_left():
    """(4 - 1)/(2500 - 1) of the squares."""
    assert told(Verdict.EXPLAINED, finding(GAIN, 0.99))[-1].endswith(
        "2 times the noise; too little to name, 0.1 % of the error."
    )
    assert "too little" not in told(Verdict.PARTLY, finding(GAIN, 0.8), after=20.0)[-1]


def test_a_doubt_is_told_in_the_same_words_of_every_cause():
    """That there are too few stretches is no chance."""
    few, weak = (
        ChanceEntry(by_luck=p, p=p, looks=1.0 if p else None, stretches=3, against="noise", reason=reason)
        for p, reason in ((None, "few"), (1.0, None))
    )
    first = told(Verdict.PARTLY, finding(GAIN, 0.6, chance=few), finding(DRIFT, 0.3, chance=few))[0]
    assert "; luck is not excluded, beside drift at sensor:axis (30 %, luck is not excluded)" in first
    assert "(30 %, may be luck)" in told(Verdict.PARTLY, finding(GAIN, 0.6), finding(DRIFT, 0.3, chance=weak))[0]


def test_what_could_not_be_tried_is_told_last():
    without, beside = (told(Verdict.UNEXPLAINED, untried=lost) for lost in ((), ("3 of 4 causes could not be.",)))
    assert without[0].endswith("and no known effect explains it.") and len(without) == 2
    assert beside[0].endswith("and no effect that could be tried explains it.") and beside[-1].startswith("3 of 4")


def test_what_cannot_be_right_of_the_recording_is_told_before_any_cause():
    notes = ("axis was sampled at 1 kHz", Implausible("axis is 10 times too large"), Implausible("axis is early"))
    first, second, *_ = told(Verdict.PARTLY, finding(GAIN, 0.6), notes=notes)
    assert first == "Check this first: axis is 10 times too large (1 more in the notes)."
    assert second.startswith("Partly explained: ")
    (asked, *_) = told(Verdict.PARTLY, finding(GAIN, 0.6), notes=(Implausible("was a sign changed?"),))
    assert asked == "Check this first: was a sign changed?"
    assert told(Verdict.PARTLY, finding(GAIN, 0.6), notes=notes[:1])[0].startswith("Partly explained: ")

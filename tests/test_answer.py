"""The three sentences of an answer, told of a diagnosis that is made of numbers."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fitted_causes import CREEP, DRIFT, GAIN, fitted

from ctrlgen.diagnosis.report.answer import answer, notes_of
from ctrlgen.diagnosis.report.answer_parts import LONGEST
from ctrlgen.diagnosis.selection.attribution import ShareEntry
from ctrlgen.diagnosis.selection.findings import ChanceEntry, ChannelErrorEntry, Estimate, Finding
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.diagnosis.shares.design import Kind
from ctrlgen.diagnosis.shares.shares_table import ChannelShares, KindShare, Share
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.recordings.implausible_note import Implausible


def finding(cause, share: float | None, *alternatives, chance: ChanceEntry | None = None) -> Finding:
    taken = None if share is None else ShareEntry(value=share, ci95=(share, share))
    return Finding(cause.effect, cause.location, {}, alternatives, taken, {}, "", cause, chance=chance)


def told(verdict: Verdict, *findings: Finding, **given) -> list[str]:
    return answer(made(verdict, *findings, **given))


def made(
    verdict: Verdict,
    *findings: Finding,
    passed=False,
    after=2.0,
    untried=(),
    taken=0.6,
    notes=(),
    held_out=True,
    shares=None,
    uneven=(),
) -> SimpleNamespace:
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
    return SimpleNamespace(
        verdict=verdict,
        findings=findings,
        held_out={"reading.axis": errors},
        device=SimpleNamespace(title="an axis"),
        search=SimpleNamespace(chosen=chosen, fitter=fitter, unlikely=()),
        residual_tests=SimpleNamespace(passed=passed, uneven=dict(uneven)),
        untried=SimpleNamespace(sentences=lambda: list(untried)),
        shares=shares,
        unconfirmed=(),
        attribution=SimpleNamespace(explained=taken, held_out=held_out),
        notes=notes,
    )


def of_pitch(share: float, period: float, unit: str) -> SimpleNamespace:
    """Shares before of which so much is a function of the place in a pitch [SI], and after of which nothing is."""
    row = KindShare(Kind.PITCH, Share(share, (share, share)), share, 1, ())
    nothing = np.zeros(0)
    before, after = (
        ChannelShares(
            "reading.axis",
            1.0,
            frozenset(),
            0.0,
            0.0,
            rows,
            total,
            0.0,
            0.0,
            0.0,
            {Kind.PITCH: period},
            nothing,
            {},
            unit,
        )
        for rows, total in (((row,), row.alone), ((), Share(0.0, (0.0, 0.0))))
    )
    return SimpleNamespace(before=SimpleNamespace(channels=(before,)), after=SimpleNamespace(channels=(after,)))


def test_a_pitch_that_no_finding_has_stands_in_the_sentence():
    """With its unit and how often it repeats; a finding that has it, or a harmonic of it, tells its own period."""
    pitch = "; by the model-free shares 64 % is a function of the place in a pitch of 0.25 mm (4 a mm)"
    shares = of_pitch(0.64, 0.25e-3, "mm")
    assert pitch in told(Verdict.PARTLY, finding(GAIN, 0.6), shares=shares)[0]
    assert pitch not in told(Verdict.PARTLY, finding(GAIN, 0.6), shares=of_pitch(0.04, 0.25e-3, "mm"))[0]
    law = Hypothesis("cyclic", "sensor:axis", "axis")
    for period, has_it in ((0.25, True), (0.1251, True), (0.17, False)):
        numbers = {"amplitude": Estimate(2.0, (1.9, 2.1), "um"), "period": Estimate(period, (period, period), "mm")}
        first = told(Verdict.PARTLY, replace(finding(law, 0.6), parameters=numbers), shares=shares)[0]
        assert ("model-free" not in first) == has_it and f"period = {period} mm, " in first and " a mm" in first


def test_of_what_kind_all_is_stands_in_the_sentence_where_nothing_is_found():
    both = of_pitch(0.64, np.radians(5.0), "deg")
    shares = SimpleNamespace(before=both.before, after=both.before)
    first = told(Verdict.UNEXPLAINED, shares=shares)[0]
    kind = "what is left in axis is mostly a function of the place in a pitch of 5 deg (72 a turn) (64 %)"
    assert first == f"Unexplained: the recording differs from an axis, and no known effect explains it; {kind}."


def longest(verdict: Verdict, **given) -> SimpleNamespace:
    """All that an answer may have to say at once."""
    few = ChanceEntry(by_luck=0.12, p=0.12, looks=1.0, stretches=30, against="noise", reason=None)
    kinds = ("heat_loss", "one_sided_saturation", "force_step", "worn_backlash", "drive_quantisation")
    wordy = [Hypothesis(kind, f"stage:a_long_name_{k}", "axis") for k, kind in enumerate(kinds)]
    numbers = {p.name: Estimate(2.0, (1.912, 2.123), "um") for p in wordy[0].law.params}
    main = replace(finding(wordy[0], 0.55, *wordy[1:], chance=few), parameters=numbers)
    main = replace(main, share=ShareEntry(value=0.55, ci95=(0.31, 0.72)), title=wordy[0].law.title)
    others = [finding(cause, 0.2, GAIN, DRIFT, chance=few) for cause in wordy[1:3]]
    uneven = {"reading.axis": ("a_long_name_of_a_file.csv", "another_long_name_of_a_file.csv", 23.0)}
    lost = (
        "3 of 4 causes worth a fit could not be fitted: no balance (backlash at stage:axis, coulomb at stage:axis).",
    )
    findings = (main, *others) if verdict is not Verdict.CONSISTENT else ()
    return made(verdict, *findings, untried=lost, uneven=uneven, shares=of_pitch(0.64, 0.25e-3, "mm"), **given)


@pytest.mark.parametrize("notes", [(), (Implausible(f"axis is 10 times too large; {'write another unit, ' * 12}"),)])
@pytest.mark.parametrize("verdict", Verdict)
def test_an_answer_is_three_sentences_and_three_lines_whatever_there_is_to_say(verdict, notes):
    """Cause, doubt, a rival, the error before and after and what is left stay; what has no room stands in the notes."""
    diagnosis = longest(verdict, notes=notes)
    said = answer(diagnosis)
    whole, beside = " ".join(said), "\n".join(notes_of(diagnosis))
    assert len(said) <= 3 and len(whole) <= LONGEST, whole
    assert "Held-out error of axis: 50 um -> 2 um, noise 1 um" in whole
    assert ("Check this first: axis is 10 times too large" in whole) == bool(notes)
    assert "3 of 4 causes worth a fit could not be fitted: no balance" in f"{whole}\n{beside}"
    if verdict is Verdict.CONSISTENT:
        return
    for part in ("heat_loss at stage:a_long_name_0", "it may be luck (12 %)", "eft: 2 um in axis, 2 times the noise"):
        assert part in whole
    assert ("cannot tell it from one_sided_saturation at stage:a_long_name_1" in whole) == (
        verdict is Verdict.AMBIGUOUS
    )
    assert "23 times what is left in another_long_name_of_a_file.csv: noise does not differ so" in beside
    assert "64 % is a function of the place in a pitch of 0.25 mm (4 a mm)" in f"{whole}\n{beside}"


def test_what_is_left_stands_beside_the_error_where_the_recording_is_to_be_checked_first():
    *_, last = told(Verdict.PARTLY, finding(GAIN, 0.6), notes=(Implausible("axis is early"),))
    assert last == "Held-out error of axis: 50 um -> 2 um, noise 1 um; left: 2 um in axis, 2 times the noise."


def test_shares_of_the_records_to_fit_are_told_as_that():
    """Where no held-out record shows a mismatch, the table beside the sentence says little of them."""
    assert "of the records to fit" in told(Verdict.PARTLY, finding(GAIN, 1.0), held_out=False)[0]
    assert "of the records to fit" not in told(Verdict.PARTLY, finding(GAIN, 1.0))[0]


@pytest.mark.parametrize(
    "noise, units, says", [(None, ("um", "urad"), True), (None, ("um", "um"), False), (1.0, ("um", "urad"), False)]
)
def test_how_readings_in_two_units_count_is_told_where_no_noise_says_it(noise, units, says):
    diagnosis = made(Verdict.PARTLY, finding(CREEP, 0.6))
    (error,) = diagnosis.held_out.values()
    diagnosis.held_out = {
        f"reading.{k}": error.model_copy(update={"noise_floor": noise, "unit": unit}) for k, unit in enumerate(units)
    }
    assert ("of the error, um and urad weighed by what is left of each" in answer(diagnosis)[0]) == says


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

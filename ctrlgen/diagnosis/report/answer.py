"""The answer of a diagnosis in three sentences at most: the main cause, the held-out error, what is left and of what kind it is. What
cannot be right of the recording comes first; then what is left stands in the sentence on the error.

Every number is one of a table: shares are of the error that the table calls before, in the channel or in all, and the largest
error that is left stands beside its noise. What has no room in three lines is told in the notes.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.answer_parts import Composed, Part, Yields, composed
from ctrlgen.diagnosis.report.luck_sentences import doubt_of_luck, short_doubt
from ctrlgen.diagnosis.report.narrative import (
    PERIODS,
    cause_text,
    error_words,
    implausible_notes,
    interval,
    per_cent,
    uncertain_words,
    with_ends,
)
from ctrlgen.diagnosis.report.rival_words import rival_parts
from ctrlgen.diagnosis.report.what_is_left import (
    blind,
    left_parts,
    moved_words,
    of_what_kind,
    pitch_part,
    untold,
    within,
)
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.finding_region import EndEntry, places_of
from ctrlgen.diagnosis.selection.findings import ChannelErrorEntry, Estimate, Finding, Role
from ctrlgen.diagnosis.selection.verdict import Verdict, contradicts_datasheet
from ctrlgen.diagnosis.settings import VERDICT
from ctrlgen.estimation.hypothesis import PARAMETER

HEADLINE = {
    Verdict.EXPLAINED: "Explained",
    Verdict.PARTLY: "Partly explained",
    Verdict.AMBIGUOUS: "Ambiguous",
    Verdict.UNEXPLAINED: "Unexplained",
    Verdict.CONSISTENT: "Consistent",
}
# further findings, and numbers of the main one, that the first sentence holds
BESIDE, NUMBERS = 2, 2


def sentence(diagnosis: Diagnosis) -> str:
    """The whole answer."""
    return " ".join(answer(diagnosis))


def answer(diagnosis: Diagnosis) -> list[str]:
    """The answer sentence by sentence: what is to be checked before anything is believed; cause, size, share; held-out error of the channel
    that was worst; what is left; what could not be tried."""
    return list(_composed(diagnosis).sentences)


def notes_of(diagnosis: Diagnosis) -> tuple[str, ...]:
    """The notes of a diagnosis, before them what had no room in its answer."""
    return (*_composed(diagnosis).notes, *diagnosis.notes)


def _composed(diagnosis: Diagnosis) -> Composed:
    channel = worst_channel(diagnosis)
    check, left = _to_check(diagnosis), left_parts(diagnosis)
    error = _error(diagnosis, channel)
    return composed([check, _cause(diagnosis, channel), *([[*error, *left]] if check else [error, left])])


def _to_check(diagnosis: Diagnosis) -> list[Part]:
    """What cannot be right of the recording as it is stated: whatever is found may be that alone."""
    notes = implausible_notes(diagnosis)
    if not notes:
        return []
    first, more = notes[0].removesuffix("."), f" ({len(notes) - 1} more in the notes)" if len(notes) > 1 else ""
    asked = f"Check this first: {first}{more}"
    # the mend stands behind, and in the notes
    what = f"Check this first: {first.partition('; ')[0].partition(': ')[0]} (see the notes)"
    return [Part(asked, ((Yields.WHAT_TO_CHECK, what),) if len(what) < len(asked) else ())]


def _error(diagnosis: Diagnosis, channel: str) -> list[Part]:
    """'Held-out error of axis: 50 um -> 2 um, noise 1 um', with what the uncertainty of the numbers does of it."""
    e = diagnosis.held_out[channel]
    decides = diagnosis.verdict == Verdict.CONSISTENT
    yields = Yields.UNCERTAINTY_THAT_DECIDES if decides else Yields.UNCERTAINTY
    said = error_words(channel, e)
    return [Part(f"; {said}"), Part(uncertain_words(e), ((yields, ""),))]


def worst_channel(diagnosis: Diagnosis) -> str:
    """The channel with the largest held-out error before the correction, relative to its noise; where the noise is not known,
    relative to the error after the correction."""

    def size(item: tuple[str, ChannelErrorEntry]) -> float:
        e = item[1]
        ratio = e.rms_before / (e.noise_floor or e.rms_after or 1.0)
        return ratio if math.isfinite(ratio) else -1.0

    return max(diagnosis.held_out.items(), key=size)[0]


def _cause(diagnosis: Diagnosis, channel: str) -> list[Part]:
    """What is left out: the main cause with its size and share, and what stands beside it; or why none is told."""
    findings, verdict = diagnosis.findings, diagnosis.verdict
    head, title = HEADLINE[verdict], diagnosis.device.title
    far = contradicts_datasheet(diagnosis.search.chosen.fit)
    if verdict == Verdict.CONSISTENT:
        lacks = Part(f"{head}: the device file ({title}) lacks nothing that this recording can show")
        return [lacks, *(blind(diagnosis) or _tolerated(diagnosis) or untold(diagnosis))]
    if far and (diagnosis.residual_tests.passed or not findings):
        return [*_beyond(diagnosis, far), *([Part("; the model also needs "), *_main(diagnosis)] if findings else [])]
    if not findings:
        known = "effect that could be tried" if diagnosis.untried.sentences() else "known effect"
        none = Part(f"{head}: the recording differs from {title}, and no {known} explains it")
        return [none, of_what_kind(diagnosis, channel), pitch_part(diagnosis, channel)]
    first = Part(f"{head}: {_too_much_left(diagnosis) or _size_untold(diagnosis)}")
    return [first, *_main(diagnosis), *rival_parts(diagnosis), pitch_part(diagnosis, channel)]


def _tolerated(diagnosis: Diagnosis) -> list[Part]:
    text = within(diagnosis)
    return [Part(text)] if text else []


def _beyond(diagnosis: Diagnosis, far: dict[str, float]) -> list[Part]:
    """The parameters that contradict the device file, with their deviation in stated standard deviations."""
    text, first = moved_words(diagnosis, far)
    title = diagnosis.device.title
    begin = f"{HEADLINE[diagnosis.verdict]}: the recording agrees with {title} only with parameters that contradict its file"
    return [
        Part(begin),
        Part(f", which moves {text}", ((Yields.FURTHER_MOVED, f", which moves {first}"),), f"the fit moves {text}"),
        Part("; check the units, sign and gain of the recorded columns"),
    ]


def _too_much_left(diagnosis: Diagnosis) -> str:
    """'what was found leaves 33 % of the error; the best of it is ', where that is why nothing is explained."""
    left = 1 - diagnosis.attribution.explained
    if diagnosis.verdict != Verdict.UNEXPLAINED or left <= 1 - VERDICT.most:
        return ""
    return f"what was found leaves {'all' if left >= 1 else per_cent(left)} of the error; the best of it is "


def _size_untold(diagnosis: Diagnosis) -> str:
    """'the records tell the size of no law that acts so; the nearest is ', where that is why nothing is explained."""
    untold = diagnosis.verdict == Verdict.UNEXPLAINED and diagnosis.findings[0].size_untold
    return "the records tell the size of no law that acts so; the nearest is " if untold else ""


def _main(diagnosis: Diagnosis) -> list[Part]:
    """The main cause with its first numbers and its share; the names of the others with theirs."""
    main, *others = diagnosis.findings
    title, name = cause_text(main), cause_name(main.cause)
    doubt = f"; {words}" if (words := doubt_of_luck(main)) else ""
    return [
        Part(title, ((Yields.TITLE, name),) if name != title else ()),
        *_numbers(main),
        *_share(diagnosis, main),
        Part(doubt),
        *_beside(others),
    ]


def _numbers(main: Finding) -> list[Part]:
    """', gap = 4.1 um (4 ... 4.2 um), below a position of 3 mm (2.9 ... 3.1 mm)'; a period does not yield."""
    if main.in_each_record:
        return [_in_records(main.in_each_record), *_moments(main)]
    shown = _first_numbers(main)
    least = {name: e for k, (name, e) in enumerate(shown.items()) if k == 0 or name in PERIODS}
    bare = {name: replace(e, ci95=(e.value, e.value)) for name, e in least.items()}
    first, *shorter = (
        "".join(f", {name} = {interval(e, name)}" for name, e in told.items()) for told in (shown, least, bare)
    )
    numbers = Part(first, tuple(zip((Yields.SECOND_NUMBER, Yields.INTERVALS), shorter, strict=True)))
    return [numbers, *(Part(f", {text}") for text in where(main))]


def _moments(finding: Finding) -> list[Part]:
    """', at 3.41 s (3.4 ... 3.42 s)', when a law acts that is another in each record."""
    return [Part(f", at {interval(finding.parameters[name], name)}") for name in finding.cause.prior.moments]


def _in_records(in_records: dict[str, Estimate]) -> Part:
    """': -0.3 um (-0.31 ... -0.29 um) in day2.csv to 0.4 um (0.39 ... 0.41 um) in day3.csv', the least and the largest."""
    ends = dict(f(in_records.items(), key=lambda row: row[1].value) for f in (min, max)).items()
    text, bare = (
        " to ".join(
            f"{interval(replace(e, ci95=e.ci95 if told else (e.value, e.value)))} in {record}" for record, e in ends
        )
        for told in (True, False)
    )
    return Part(f": {text}", ((Yields.INTERVALS, f": {bare}"),))


def _share(diagnosis: Diagnosis, main: Finding) -> list[Part]:
    """'; it takes away 82 % (75 ... 88 %) of the error'."""
    if main.share is None:
        return []
    fitted = (
        "" if diagnosis.attribution.held_out else " of the records to fit, as no held-out record shows more than noise"
    )
    if main.share.value >= 1:
        return [Part(f"; it takes away all of the error beyond the noise{fitted}")]
    whole, value = (
        f"; it takes away {text} of the error{fitted}" for text in (with_ends(main.share), per_cent(main.share.value))
    )
    return [Part(whole, ((Yields.INTERVAL_OF_SHARE, value),) if value != whole else ()), _weighed(diagnosis)]


def _weighed(diagnosis: Diagnosis) -> Part:
    """', um and urad weighed by what is left of each', where no noise says how readings in two units count beside each other."""
    errors = diagnosis.held_out.values()
    units = list(dict.fromkeys(e.unit for e in errors))
    if len(units) < 2 or all(e.noise_floor for e in errors):
        return Part("")
    by = f"{' and '.join(units)} weighed by what is left of each"
    note = (
        f"Shares of all readings are of squares, {by}, as no noise says how they count; the table has them by reading."
    )
    return Part(f", {by}", ((Yields.HOW_WEIGHED, ""),), note)


def _beside(others: list[Finding]) -> list[Part]:
    """', beside creep at stage:axis (12 %) and 3 more in the table'."""
    if not others:
        return []
    causes = [f for f in others if f.role is Role.CAUSE][:BESIDE]
    forms = []
    for shown in (causes[:k] for k in range(len(causes), -1, -1)):
        names = [f"{cause_name(f.cause)}{_in_brackets(f)}" for f in shown]
        more = len(others) - len(shown)
        forms.append(f", beside {' and '.join([*names, *([f'{more} more in the table'] if more else [])])}")
    first, *shorter = forms
    yields = (Yields.SECOND_BESIDE, Yields.BESIDE)[2 - len(shorter) :]
    return [Part(first, tuple(zip(yields, shorter, strict=True)))]


def _in_brackets(finding: Finding) -> str:
    """' (12 %)' after the name of a further cause, ' (12 %, may be luck)', or nothing."""
    told = [per_cent(finding.share.value)] if finding.share else []
    told += [short_doubt(finding)] if doubt_of_luck(finding) else []
    return f" ({', '.join(told)})" if told else ""


def _first_numbers(finding: Finding) -> dict[str, Estimate]:
    """The amplitude of a finding and the numbers after it, as many as the sentence holds; that of a law that is there or is not, last."""
    if finding.effect == PARAMETER:
        return finding.parameters
    law = finding.cause.law
    amplitude = law.amplitude().name
    # where it is comes before how it is
    told = places_of(law)
    places = [p.name for p in law.params if finding.cause.prior.of(p).start_from_data]
    there = finding.cause.prior.of(law.amplitude()).fixed_range is not None
    first = sorted(
        finding.parameters, key=lambda name: (there and name == amplitude, name != amplitude, name not in places)
    )
    most = NUMBERS - bool(told)
    return {name: finding.parameters[name] for name in [name for name in first if name not in told][:most]}


def where(finding: Finding) -> list[str]:
    """'below a position of -11.487 um (-11.493 ... -11.481 um)', for a law that acts in a region."""
    region = finding.region
    if region is None:
        return []
    low, high = (None if end is None else _end(end, region.unit) for end in (region.lower, region.upper))
    if low and high:
        return [f"between positions of {low} and {high}"]
    if region.quantity == "time":
        return [f"from {low} on"]
    beyond = "above" if low else "below"
    if region.size and region.quantity != "speed":
        return [f"beyond {region.quantity}s of +-{low}"]
    article = "a rise of the temperature" if region.quantity == "temperature" else f"a {region.quantity}"
    return [f"{beyond} {article} of {low or high}"]


def _end(end: EndEntry, unit: str) -> str:
    return interval(Estimate(end.value, end.ci95, unit))

"""The answer of a diagnosis in three sentences at most: the main cause, the held-out error, what is left and of what kind it is. What
errors kept from being tried follows where that is much of what there was to try; what cannot be right of the recording comes first.

Every number is one of a table: shares are of the error that the table calls before, in the channel or in all, and the largest
error that is left stands beside its noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ctrlgen.core.units import from_si
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.luck_sentences import doubt_of_luck, short_doubt
from ctrlgen.diagnosis.report.narrative import (
    cause_text,
    channel_sentence,
    implausible_notes,
    interval,
    per_cent,
    short,
    with_ends,
)
from ctrlgen.diagnosis.report.shares_sentences import rest_kind
from ctrlgen.diagnosis.selection.attribution import ShareEntry
from ctrlgen.diagnosis.selection.cause_entry import cause_name, cause_noun
from ctrlgen.diagnosis.selection.finding_region import EndEntry, places_of
from ctrlgen.diagnosis.selection.findings import ChannelErrorEntry, Estimate, Finding, Role
from ctrlgen.diagnosis.selection.ringing_mass import ringing_masses
from ctrlgen.diagnosis.selection.untold_scale import moved_together
from ctrlgen.diagnosis.selection.verdict import (
    Verdict,
    contradicts_datasheet,
    moved_numbers,
    poorly_determined,
    within_tolerance,
)
from ctrlgen.diagnosis.settings import VERDICT
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis
from ctrlgen.estimation.settings import RESIDUAL_TESTS
from ctrlgen.estimation.size_odds import size_of
from ctrlgen.reporting.numbers import number

HEADLINE = {
    Verdict.EXPLAINED: "Explained",
    Verdict.PARTLY: "Partly explained",
    Verdict.AMBIGUOUS: "Ambiguous",
    Verdict.UNEXPLAINED: "Unexplained",
    Verdict.CONSISTENT: "Consistent",
}
# further findings, and numbers of the main one, that the first sentence holds
BESIDE, NUMBERS = 2, 2
# alternatives of a cause that it holds
LISTED = 3
# times the noise from which on it is said that chance allows as much
CHANCE = 1.2


def sentence(diagnosis: Diagnosis) -> str:
    """The whole answer."""
    return " ".join(answer(diagnosis))


def answer(diagnosis: Diagnosis) -> list[str]:
    """The answer sentence by sentence: what is to be checked before anything is believed; cause, size, share; held-out error of the channel
    that was worst; what is left; what could not be tried."""
    channel = worst_channel(diagnosis)
    errors = channel_sentence(channel, diagnosis.held_out[channel])
    return [*_to_check(diagnosis), _cause(diagnosis), errors, *_left(diagnosis), *diagnosis.untried.sentences()]


def _to_check(diagnosis: Diagnosis) -> list[str]:
    """What cannot be right of the recording as it is stated: whatever is found may be that alone."""
    first, *others = implausible_notes(diagnosis) or [""]
    more = f" ({len(others)} more in the notes)" if others else ""
    return [f"Check this first: {first}{more}{'' if first.endswith('?') and not more else '.'}"] if first else []


def worst_channel(diagnosis: Diagnosis) -> str:
    """The channel with the largest held-out error before the correction, relative to its noise; where the noise is not known,
    relative to the error after the correction."""

    def size(item: tuple[str, ChannelErrorEntry]) -> float:
        e = item[1]
        ratio = e.rms_before / (e.noise_floor or e.rms_after or 1.0)
        return ratio if math.isfinite(ratio) else -1.0

    return max(diagnosis.held_out.items(), key=size)[0]


def _cause(diagnosis: Diagnosis) -> str:
    """What is left out: the main cause with its size and share, and what stands beside it."""
    findings, verdict = diagnosis.findings, diagnosis.verdict
    head, title = HEADLINE[verdict], diagnosis.device.title
    far = contradicts_datasheet(diagnosis.search.chosen.fit)
    if verdict == Verdict.CONSISTENT:
        lacks = f"{head}: the device file ({title}) lacks nothing that this recording can show"
        return f"{lacks}{_blind(diagnosis) or _within(diagnosis) or untold(diagnosis)}."
    if far and (diagnosis.residual_tests.passed or not findings):
        also = f"; the model also needs {_main(diagnosis)}" if findings else ""
        return f"{head}: {_beyond(diagnosis, far)}{also}."
    if not findings:
        known = "effect that could be tried" if diagnosis.untried.sentences() else "known effect"
        return f"{head}: the recording differs from {title}, and no {known} explains it."
    return f"{head}: {_too_much_left(diagnosis)}{_main(diagnosis)}{_rivals(diagnosis)}{unlikely_rival(diagnosis)}{_by_file(diagnosis)}."


def _too_much_left(diagnosis: Diagnosis) -> str:
    """'what was found leaves 33 % of the error; the best of it is ', where that is why nothing is explained."""
    left = 1 - diagnosis.attribution.explained
    if diagnosis.verdict != Verdict.UNEXPLAINED or left <= 1 - VERDICT.most:
        return ""
    return f"what was found leaves {'all' if left >= 1 else per_cent(left)} of the error; the best of it is "


def _main(diagnosis: Diagnosis) -> str:
    """The main cause with its first numbers and its share; the names of the others with theirs."""
    main, *others = diagnosis.findings
    numbers = ", ".join([*(f"{name} = {interval(e, name)}" for name, e in _first_numbers(main).items()), *where(main)])
    fitted = (
        "" if diagnosis.attribution.held_out else " of the records to fit, as no held-out record shows more than noise"
    )
    share = f"; it takes away {_share(main.share)}{fitted}" if main.share else ""
    causes = [f for f in others if f.role is Role.CAUSE]
    names = [f"{cause_name(f.cause)}{_in_brackets(f)}" for f in causes[:BESIDE]]
    more = len(others) - len(names)
    names += [f"{more} more in the table"] if more else []
    doubt = f"; {words}" if (words := doubt_of_luck(main)) else ""
    return f"{cause_text(main)}, {numbers}{share}{doubt}{', beside ' + ' and '.join(names) if names else ''}"


def _in_brackets(finding: Finding) -> str:
    """' (12 %)' after the name of a further cause, ' (12 %, may be luck)', or nothing."""
    told = [per_cent(finding.share.value)] if finding.share else []
    told += [short_doubt(finding)] if doubt_of_luck(finding) else []
    return f" ({', '.join(told)})" if told else ""


def _share(share: ShareEntry) -> str:
    """'82 % (75 ... 88 %) of the error'."""
    return "all of the error beyond the noise" if share.value >= 1 else f"{with_ends(share)} of the error"


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


def _rivals(diagnosis: Diagnosis) -> str:
    """'; this recording cannot tell it from thermal_lag at actuator:axis, nor drive_offset at actuator:axis from home_offset at
    sensor:axis', for an ambiguous verdict: of the main cause, and of others whose share makes the answer ambiguous."""
    if diagnosis.verdict != Verdict.AMBIGUOUS:
        return ""
    main = diagnosis.findings[0]
    least = VERDICT.main_share * (main.share.value if main.share else 0.0)
    counts = [f for f in diagnosis.findings if main.share is None or (f.share is not None and f.share.value >= least)]
    alike = [f for f in counts if f.alternatives]
    pairs = [f"{'it' if f is main else cause_noun(f.cause)} from {_any(f.alternatives)}" for f in alike]
    rivals = f"; this recording cannot tell {', nor '.join(pairs)}" if pairs else ""
    support = diagnosis.findings[0].support
    if support is None or not support.contradicted:
        return rivals
    told = (
        f"{support.leading} ({per_cent(support.leading_share)}), not for {support.family} ({per_cent(support.share)})"
    )
    return f"{rivals}; the model-free shares speak for {told}"


def unlikely_rival(diagnosis: Diagnosis) -> str:
    """'; the readings alone do not tell it from a wrong mechanism:height, which would be off by 30 of its usual deviations,
    the one named by 1.2', where what is known beforehand decides."""
    main, search = diagnosis.findings[0], diagnosis.search
    alike = dict(zip(search.chosen.causes, search.unlikely, strict=False)).get(main.cause)
    if not alike:
        return ""
    rival, here = alike[0], size_of(search.chosen.fit, search.chosen.causes.index(main.cause))
    there = size_of(rival.fit, next(i for i, c in enumerate(rival.causes) if c == rival.cause))
    if there is None or rival.cause is None:
        return ""
    own = "" if here is None or not here[1].sd else f", the one named by {number(here[0], 2)}"
    kind = "stated" if there[1].stated else "usual"
    off = (
        f"would be off by {number(there[0], 2)} of its {kind} deviations" if there[1].sd else "is set and not measured"
    )
    return f"; the readings alone do not tell it from {cause_noun(rival.cause)}, which {off}{own}"


def _by_file(diagnosis: Diagnosis) -> str:
    """'; the readings alone do not tell it from mechanics.stiffness and actuator.force_constant that are off together: that it is this one
    rests on what the file states of those', for a number of the device."""
    fit, main = diagnosis.search.chosen.fit, diagnosis.findings[0].cause
    others = moved_together(fit, fit.structure.causes.index(main)) if main in fit.structure.causes else ()
    if not others:
        return ""
    names = " and ".join([", ".join(others[:-1]), others[-1]] if len(others) > 1 else others)
    return f"; the readings alone do not tell it from {names} off together: that it is this one rests on what the file states of those"


def _any(causes: Sequence[Hypothesis]) -> str:
    """'backlash at stage:axis or creep at stage:axis', the first ones: the table has them all."""
    more = [f"{len(causes) - LISTED} more"] if len(causes) > LISTED else []
    return " or ".join([*map(cause_noun, causes[:LISTED]), *more])


def _left(diagnosis: Diagnosis) -> list[str]:
    """What is left where it is more than noise, why the answer is partial where it is not, and numbers that moved far."""
    if diagnosis.verdict == Verdict.CONSISTENT:
        return []
    fit = diagnosis.search.chosen.fit
    moved = "" if contradicts_datasheet(fit) and diagnosis.residual_tests.passed else _moved(diagnosis)
    text = _rest(diagnosis) if diagnosis.findings else ""
    told = [part for part in (text, moved, *_uneven(diagnosis)) if part]
    return [" ".join(told)] if told else []


def _uneven(diagnosis: Diagnosis) -> list[str]:
    """'What is left of axis in fit.csv is 23 times what is left in hold_out.csv: noise does not differ so, and something acts in the one
    that does not in the other, such as a jump.'"""
    return [
        f"What is left of {short(channel)} in {most} is {number(ratio, 2)} times what is left in {least}: noise does not differ so, and "
        "something acts in the one that does not in the other, such as a jump."
        for channel, (most, least, ratio) in diagnosis.residual_tests.uneven.items()
    ]


def _rest(diagnosis: Diagnosis) -> str:
    """'Left: 4.9 urad in theta_z, 1.4 times the noise, mostly a function of position.'"""
    if any(e.noise_floor is None for e in diagnosis.held_out.values()):
        return "Whether more is left cannot be said: the noise is not known."
    channel, e = max(diagnosis.held_out.items(), key=lambda item: item[1].rms_after / (item[1].noise_floor or 1.0))
    ratio = e.rms_after / (e.noise_floor or 1.0)
    size = f"{number(e.rms_after, 3)} {e.unit} in {short(channel)}, {number(ratio, 2)} times the noise"
    if not diagnosis.residual_tests.passed:
        return f"Left: {size}{rest_kind(diagnosis, channel)}{_within(diagnosis)}{_little(diagnosis, e)}."
    if diagnosis.unconfirmed:
        return f"No held-out record shows {' or '.join(map(cause_name, diagnosis.unconfirmed))}."
    if diagnosis.verdict == Verdict.PARTLY and poorly_determined(diagnosis.search):
        return "The numbers are too uncertain to predict the held-out records better."
    if channel in untold_noise(diagnosis):
        return f"Left: {number(e.rms_after, 3)} {e.unit} in {short(channel)}{untold(diagnosis)}."
    return f"Left: {size}, which chance allows so few samples." if ratio > CHANCE else ""


def _moved(diagnosis: Diagnosis) -> str:
    """The numbers of the device that the fit moved far, in stated standard deviations."""
    moved = moved_numbers(diagnosis.search.chosen.fit)
    if not moved:
        return ""
    rings = (
        f" The stated {path} includes the {number(float(from_si(part, unit)), 2)} {unit} that ring."
        for path, part in ringing_masses(diagnosis.search.chosen.fit).items()
        for unit in [diagnosis.values[path].unit]
    )
    return f"The fit moves {_numbers(diagnosis, moved)}.{''.join(rings)}"


def _numbers(diagnosis: Diagnosis, deviations: dict[str, float]) -> str:
    return ", ".join(
        f"{path} to {number(e.value)} {e.unit} ({z:+.0f} stated standard deviations)"
        for path, z in deviations.items()
        for e in [diagnosis.values[path]]
    )


def _within(diagnosis: Diagnosis) -> str:
    """', within the stated tolerance', where that and not the noise is why nothing more is asked."""
    tolerated = within_tolerance(diagnosis.search) and not diagnosis.residual_tests.passed
    return ", within the stated tolerance" if tolerated else ""


def _little(diagnosis: Diagnosis, e: ChannelErrorEntry) -> str:
    """'; too little to name, 0.1 % of the error', where that is why the answer is an explanation."""
    if diagnosis.verdict != Verdict.EXPLAINED or within_tolerance(diagnosis.search):
        return ""
    noise = (e.noise_floor or 0.0) ** 2
    share = (e.rms_after**2 - noise) / max(e.rms_before**2 - noise, 1e-300)
    return f"; too little to name, {per_cent(max(share, 0.0))} of the error"


def _blind(diagnosis: Diagnosis) -> str:
    """'; errors below 3.6 um cannot be judged', for the channels whose noise is not known."""
    sizes = [f"{number(e.rms_after, 3)} {e.unit}" for e in diagnosis.held_out.values() if e.noise_floor is None]
    return f"; the noise is not known, so errors below {', '.join(sizes)} cannot be judged" if sizes else ""


def untold_noise(diagnosis: Diagnosis) -> dict[str, float]:
    """Of channels that leave more than the guess of their noise: p that it goes so well with the motion by chance."""
    return {
        channel: e.goes_with_motion
        for channel, e in diagnosis.held_out.items()
        if e.goes_with_motion is not None and e.rms_after > RESIDUAL_TESTS.error_ratio * (e.noise_floor or math.inf)
    }


def untold(diagnosis: Diagnosis) -> str:
    """'; the noise was neither stated nor recorded at rest and would be 0.0652 um in axis, nothing of which is seen to go with the drive or
    the motion (p = 0.35)', where size and memory of what is left could not decide. Nothing where something of it does."""
    unsure = untold_noise(diagnosis)
    if not unsure or not diagnosis.residual_tests.passed:
        return ""
    of = {c: diagnosis.held_out[c] for c in unsure}
    sizes = ", ".join(f"{number(e.rms_after, 3)} {e.unit} in {short(c)}" for c, e in of.items())
    p, seen = min(unsure.values()), "so few samples cannot tell whether it goes with the drive or the motion"
    if p < 1:
        seen = f"nothing of which is seen to go with the drive or the motion (p = {number(p, 2)})"
    return f"; the noise was neither stated nor recorded at rest and would be {sizes}, {seen}"


def _beyond(diagnosis: Diagnosis, far: dict[str, float]) -> str:
    """The parameters that contradict the device file, with their deviation in stated standard deviations."""
    return (
        f"the recording agrees with {diagnosis.device.title} only with parameters that contradict its file, which moves "
        f"{_numbers(diagnosis, far)}; check the units, sign and gain of the recorded columns"
    )

"""Names, numbers and next steps of a diagnosis in words, for report.html, the console and the header of device.next.toml."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.experiment_sentences import experiment_sentence
from ctrlgen.diagnosis.report.history_table import dropped_beside, most_gained, quantity
from ctrlgen.diagnosis.report.luck_sentences import luck_steps
from ctrlgen.diagnosis.report.on_the_clock import used_for_another_run
from ctrlgen.diagnosis.report.period_words import repeats
from ctrlgen.diagnosis.report.refused_events import how_confirmed, moment_of
from ctrlgen.diagnosis.report.smaller_causes import smaller_causes_step
from ctrlgen.diagnosis.report.time_base import time_base_step
from ctrlgen.diagnosis.report.where_it_is_left import FIT_ALONE, held_out_agrees, more_left
from ctrlgen.diagnosis.selection.attribution import ShareEntry
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.findings import ChannelErrorEntry, Estimate, Finding, Role
from ctrlgen.diagnosis.selection.not_taken import that_matter
from ctrlgen.diagnosis.selection.verdict import Verdict, contradicts_datasheet
from ctrlgen.effects import Effect
from ctrlgen.estimation.hypothesis import PARAMETER
from ctrlgen.recordings.implausible_note import Implausible
from ctrlgen.reporting.numbers import number, sized

# refusals that are told
NAMED = 3
# per cent that are shown, next to none and to all
SMALLEST = 0.1
# a dimensionless number whose interval lies within this is shown in per cent
WIDE = 1.0
# numbers of laws that are a share of nothing
EXPONENTS = frozenset({"exponent", "power"})
# numbers of laws after which their error or their force comes again
PERIODS = frozenset({"period"})
# numbers of laws that come again after a turn [deg]
PHASES, TURN = frozenset({"phase"}), 360.0
HARD_SPACE = "\u00a0"
# share of its interval within which an estimate counts as on the interval's end
EDGE = 1e-6


def plain_name(effect: str) -> str:
    """The title of an effect, which describes it without symbols: 'A clamped flexure stretches as it bends'."""
    if effect == PARAMETER:
        return "A parameter of the device differs from its nominal value"
    law = Effect.library.get(effect)
    return law.title if law else effect


def cause_text(finding: Finding) -> str:
    """The cause with its meaning: 'a clamped flexure stretches as it bends (stiffening at stage:axis)'."""
    name = cause_name(finding.cause)
    return (
        name
        if finding.effect == PARAMETER
        else f"{_within_a_sentence(finding.title or plain_name(finding.effect))} ({name})"
    )


def interval(e: Estimate, name: str = "") -> str:
    """'4.12 % (3.93 ... 4.31 %)': value and 95 % interval of the number of this name, to two digits of the interval's width; of a period
    with how often it repeats: '5 deg (4.98 ... 5.02 deg), 72 a turn'."""
    known = math.isfinite(e.ci95[1] - e.ci95[0])
    often = repeats(e.value, e.unit) if name in PERIODS and known else ""
    return _with_interval(e, name) + (f", {often}" if often else "")


def _with_interval(e: Estimate, name: str) -> str:
    ends = (e.value, *e.ci95)
    percent = e.unit == "1" and name not in EXPONENTS and all(abs(v) < WIDE for v in ends)
    best, factor = ("%", 100.0) if percent else sized(e.unit, e.value)
    unit = "" if best == "1" else f" {best}"
    value, low, high = (factor * v for v in ends)
    any_phase = name in PHASES and e.unit == "deg" and e.ci95[1] - e.ci95[0] >= TURN
    if any_phase or not math.isfinite(high - low):
        return f"{number(value)}{unit} (this recording does not determine it)"
    # detected directly, or fixed by its definition
    if high == low:
        return f"{number(value)}{unit}"
    shown = [_to_width(v, high - low) for v in (value, low, high)]
    edge = EDGE * (high - low)
    bound = ", at its bound" if value - low <= edge or high - value <= edge else ""
    return f"{shown[0]}{unit} ({shown[1]} ... {shown[2]}{unit}{bound})"


def _to_width(value: float, width: float) -> str:
    """`value` with as many digits as an interval of `width` justifies."""
    if width <= 0 or value == 0:
        return number(value)
    digits = math.floor(math.log10(max(abs(value), width))) - math.floor(math.log10(width)) + 2
    return number(value, max(2, min(digits, 9)))


def channel_sentence(channel: str, error: ChannelErrorEntry) -> str:
    """`error_words` with `uncertain_words`, as a sentence."""
    return f"{error_words(channel, error)}{uncertain_words(error)}."


def error_words(channel: str, error: ChannelErrorEntry) -> str:
    """'Held-out error of delta_x: 312 nm -> 5.2 nm, noise 5 nm'."""
    noise = "not known" if error.noise_floor is None else f"{number(error.noise_floor, 3)} {error.unit}"
    shown = [f"{number(v, 3)} {error.unit}" for v in (error.rms_before, error.rms_after)]
    return f"Held-out error of {short(channel)}: {' -> '.join(dict.fromkeys(shown))}, noise {noise}"


def uncertain_words(error: ChannelErrorEntry) -> str:
    """'; the uncertainty of the parameters alone is 3 nm, and with them moved within it 4.9 nm are left', where the numbers are so
    uncertain that they may cause most of the error."""
    if error.uncertainty is None or error.uncertainty <= (error.noise_floor or 0.0):
        return ""
    unsure = f"; the uncertainty of the parameters alone is {number(error.uncertainty, 3)} {error.unit}"
    if error.rms_refitted < error.rms_after:
        unsure += f", and with them moved within it {number(error.rms_refitted, 3)} {error.unit} are left"
    return unsure


def short(channel: str) -> str:
    """The name of a channel without its signal: 'delta_x' for 'reading.delta_x'."""
    return channel.removeprefix("reading.")


def _within_a_sentence(text: str) -> str:
    first = text.split(" ")[0]
    return text if first[1:] != first[1:].lower() or "-" in first else text[0].lower() + text[1:]


def share_text(finding: Finding) -> str:
    """'82 % (75 ... 88 %)', or why there is none."""
    if finding.role is Role.PART and finding.serves is not None:
        return f"part of {cause_name(finding.serves)}"
    if finding.role is Role.UNSEEN:
        return "not seen in the held-out records"
    if finding.share is None:
        return "< 1 %" if finding.role is Role.MINOR else "-"
    return with_ends(finding.share)


def rest_text(diagnosis: Diagnosis) -> str:
    """The share of the mismatch that is left beside those of the findings, so that what the table prints adds up to 100 %; empty where
    nothing is shared out. Findings of one law at one place have one share."""
    rest = diagnosis.attribution.rest
    shares = {(f.effect, f.location): f.share.value for f in diagnosis.findings if f.share is not None}
    if rest is None or not shares:
        return ""
    printed = [per_cent(value) for value in shares.values()]
    if any(text[0] in "<>" for text in printed):
        return per_cent(rest.value)
    decimals = max(len(text.removesuffix(" %").partition(".")[2]) for text in printed)
    left = 100 - sum(float(text.removesuffix(" %")) for text in printed)
    return f"{left:.{decimals}f} %"


def with_ends(share: ShareEntry) -> str:
    """'82 % (75 ... 88 %)'; without the interval where its ends show as the share itself."""
    value, low, high = (per_cent(v) for v in (share.value, *share.ci95))
    exact = value[0] in "<>" or value == low == high
    return value if exact else f"{value} ({low.removesuffix(' %')} ... {high})"


def per_cent(share: float) -> str:
    """'85 %'; '99.4 %' near the whole, '0.4 %' near nothing."""
    value = 100 * share
    if 0 < value < SMALLEST:
        return f"< {SMALLEST} %"
    if 100 - SMALLEST < value < 100:
        return f"> {100 - SMALLEST} %"
    coarse = value == 0 or 1 <= abs(value) <= 99 or abs(value) >= 100
    return f"{value:.0f} %" if coarse else f"{value:.1f} %"


def next_steps(diagnosis: Diagnosis) -> list[str]:
    """What to do next, in order."""
    first = [*([UNCHECKED] if implausible_notes(diagnosis) else []), *time_base_step(diagnosis)]
    refused = [f"Not taken: {text}." for text in refusals(diagnosis)]
    return [*first, *_steps(diagnosis), *smaller_causes_step(diagnosis), *refused, *luck_steps(diagnosis.findings)]


def implausible_notes(diagnosis: Diagnosis) -> list[str]:
    """The notes on what cannot be of the device as it is stated."""
    return [note for note in diagnosis.notes if isinstance(note, Implausible)]


UNCHECKED = "Before device.next.toml is used, check what the first sentence names, and diagnose again: the findings may be that alone."


def _steps(diagnosis: Diagnosis) -> list[str]:
    verdict = diagnosis.verdict
    use = used_for_another_run(
        diagnosis.findings,
        "Use device.next.toml in place of the device file: solve and generate the C with it, then record again to confirm.",
    )
    errors = diagnosis.held_out.values()
    known = all(e.noise_floor is not None for e in errors)
    told = known and all(e.goes_with_motion is None for e in errors)
    rest = "" if told else " Record a period at rest (drive off), or repeat poses, so that the noise can be estimated."
    gathered_somewhere = diagnosis.residual_location.after.gathered is not None
    if verdict == Verdict.CONSISTENT:
        return [
            f"Nothing to correct. Effects smaller than those listed in the report would not have been detected.{rest}"
        ]
    if verdict == Verdict.EXPLAINED:
        return [use] if diagnosis.residual_tests.passed else [use, more_left(diagnosis)]
    if verdict == Verdict.AMBIGUOUS:
        return [
            experiment_sentence(diagnosis.next_experiment),
            used_for_another_run(
                diagnosis.findings,
                "device.next.toml holds the best of them, which predicts recordings of this kind as well as the others do.",
            )
            + rest,
            *([more_left(diagnosis)] if gathered_somewhere and not diagnosis.residual_tests.passed else []),
        ]
    steps = [_use(diagnosis)]
    if not known:
        steps.append(f"Whether a mismatch remains cannot be said, because the noise is not known.{rest}")
    elif not diagnosis.residual_tests.passed:
        steps.append(more_left(diagnosis))
    if diagnosis.unconfirmed:
        names = ", ".join(map(cause_name, diagnosis.unconfirmed))
        steps.append(
            f"No held-out record shows {names}: hold out a record that covers the same range as the records to fit."
        )
    agrees = known and held_out_agrees(diagnosis)
    if agrees:
        steps.append(FIT_ALONE)
    if verdict == Verdict.UNEXPLAINED and not (agrees or gathered_somewhere):
        steps.append("Check wiring, units and clocks of the set-up: known effects do not explain the mismatch.")
    return steps


BETTER = (
    "Use device.next.toml in place of the device file, solve and generate the C with it: it predicts the held-out recordings better. Its "
    "numbers hold for the range of travel, speed and temperature that was recorded."
)
WORSE = (
    "Do not use device.next.toml yet: its numbers are too uncertain to predict the held-out recordings better than the device "
    "file does. Record more where the causes act."
)


NOTHING_FOUND = "Do not use device.next.toml yet: it holds no cause, only numbers of the device refitted within what its file states."
EMPIRICAL_ALONE = (
    "device.next.toml holds no cause, only an empirical term of what is left: with it the held-out recordings are predicted better, inside "
    "the recorded range alone."
)


def _use(diagnosis: Diagnosis) -> str:
    """What device.next.toml may be used for where the answer is not certain."""
    if not diagnosis.findings:
        return EMPIRICAL_ALONE if diagnosis.empirical_terms else NOTHING_FOUND
    if far := contradicts_datasheet(diagnosis.search.chosen.fit):
        return contradicted(far)
    return used_for_another_run(diagnosis.findings, BETTER) if predicts_better(diagnosis) else WORSE


def contradicted(far: Iterable[str]) -> str:
    """That the numbers of these paths are not what the file states of them, and what tells which of the two is wrong."""
    return (
        f"Do not use device.next.toml yet: it moves {' and '.join(far)} beyond what the device file allows, as a missing law may do. "
        "Measure that by itself first, as a stiffness by a weight or a gain at rest."
    )


def predicts_better(diagnosis: Diagnosis) -> bool:
    """Whether the corrected device predicts the held-out records better than the device as described, in noise units."""
    search = diagnosis.search
    return bool(search.chosen.causes) and search.chosen.predicted.excess < search.nominal.predicted.excess


def refusals(diagnosis: Diagnosis) -> list[str]:
    """Causes that score better than the answer, with what each would leave and what speaks against it, first what would gain most; those
    that are told as alternatives left out."""
    search, said = diagnosis.search, []
    told = {h for f in diagnosis.findings for h in (f.cause, *f.alternatives)}
    matter = [refusal for _, refusal in that_matter(search) if not told.issuperset(refusal.causes)]
    for refusal in matter[:NAMED]:
        better = "it scores better than the answer"
        if gained := most_gained(search, refusal.candidate):
            channel, error, now = gained
            better = f"the held-out error of {short(channel)} would be {quantity(error)} instead of {quantity(now)}"
        causes = (cause_name(c) + moment_of(refusal, c) for c in refusal.causes)
        names = " and ".join(causes) + dropped_beside(search, refusal)
        reasons = (*dict.fromkeys(refusal.reasons), *how_confirmed(search.fitter.recording, refusal))
        said.append(f"{names}, although {better}: {'; '.join(reasons)}")
    return said


def empirical_sentences(diagnosis: Diagnosis) -> list[str]:
    """Of every empirical term what it is a function of, how much it takes away, and that it names no cause."""
    return [
        f"device.next.toml also holds an empirical term ({t.effect.kind}): a function of {FUNCTIONS[t.effect.kind]} of axis {t.effect.of}, "
        f"added to {t.effect.at}, takes away {100 * t.share:.0f} % of what is left in {short(t.channel)} on the held-out records "
        f"({number(t.rms_before, 3)} -> {number(t.rms_after, 3)} {t.unit}). It names no cause and holds inside the recorded range."
        for t in diagnosis.empirical_terms
    ]


FUNCTIONS = {
    "empirical_position": "the position",
    "empirical_speed": "the speed and its direction",
    "empirical_history": "the last reversals",
}


def hard(text: str) -> str:
    """`text` with non-breaking spaces between numbers and their units."""
    return re.sub(r"(?<=\d) (?=[^\W\d]|%)", HARD_SPACE, text)


def gathered(notes: tuple[str, ...]) -> list[str]:
    """The notes, those that differ only by their channel joined into one."""
    by_text: dict[str, list[str]] = {}
    for note in notes:
        subject, colon, text = note.partition(": ")
        if colon and re.fullmatch(r"\w+\.\w+", subject):
            by_text.setdefault(text, []).append(subject)
        else:
            by_text.setdefault(note, [])
    return [f"{', '.join(subjects)}: {text}" if subjects else text for text, subjects in by_text.items()]

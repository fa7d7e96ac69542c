"""What a diagnosis says in sentences: for the page, the terminal and the header of the next device file."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from ctrlgen.diagnosis.hypotheses.hypotheses import PARAMETER, Hypothesis
from ctrlgen.diagnosis.selection.result import ChannelError, Diagnosis, Estimate, Finding
from ctrlgen.diagnosis.selection.verdict import (
    AMBIGUOUS,
    CONSISTENT,
    EXPLAINED,
    PARTLY,
    UNEXPLAINED,
    contradicts_datasheet,
    model_error_allowance,
    poorly_determined,
)
from ctrlgen.effects import Effect

NAMED = 3  # findings spelt out in the first sentence
WIDE = 1.0  # a plain number with its whole interval below is shown in percent
HARD_SPACE = "\u00a0"
EDGE = 1e-6  # of an interval: nearer to its end, a number stands on its bound
HEADLINE = {
    EXPLAINED: "Explained",
    PARTLY: "Partly explained",
    AMBIGUOUS: "Ambiguous",
    UNEXPLAINED: "Unexplained",
    CONSISTENT: "Consistent",
}


def plain_name(effect: str) -> str:
    """The title of an effect, which says it without symbols: 'A clamped flexure stretches as it bends'."""
    if effect == PARAMETER:
        return "A number of the device is off its nominal"
    law = Effect.library.get(effect)
    return law.title if law else effect


def hypothesis_name(cause: Hypothesis) -> str:
    """'stiffening at stage:axis', or 'mechanism:platform_radius off its nominal'."""
    if cause.effect == PARAMETER:
        return f"{cause.location} off its nominal"
    return f"{cause.effect} at {cause.location}" + (f", of {cause.of}" if cause.of else "")


def cause_text(finding: Finding) -> str:
    """The cause with its meaning: 'a clamped flexure stretches as it bends (stiffening at stage:axis)'."""
    name = hypothesis_name(finding.cause)
    return name if finding.effect == PARAMETER else f"{_within_a_sentence(plain_name(finding.effect))} ({name})"


def interval(e: Estimate) -> str:
    """'4.12 % (3.93 ... 4.31 %)': value and 95 % interval, with two digits of the interval's width."""
    ends = (e.value, *e.ci95)
    percent = e.unit == "1" and all(abs(v) < WIDE for v in ends)
    unit = " %" if percent else "" if e.unit == "1" else f" {e.unit}"
    value, low, high = (v * (100 if percent else 1) for v in ends)
    if not math.isfinite(high - low):
        return f"{number(value)}{unit} (this record does not hold it)"
    if high == low:  # it is so, or it was read off
        return f"{number(value)}{unit}"
    shown = [_to_width(v, high - low) for v in (value, low, high)]
    edge = EDGE * (high - low)
    bound = ", at the end of its range" if value - low <= edge or high - value <= edge else ""
    return f"{shown[0]}{unit} ({shown[1]} ... {shown[2]}{unit}{bound})"


def _to_width(value: float, width: float) -> str:
    """`value` with as many digits as an interval of `width` bears."""
    if width <= 0 or value == 0:
        return number(value)
    digits = math.floor(math.log10(max(abs(value), width))) - math.floor(math.log10(width)) + 2
    return number(value, max(2, min(digits, 9)))


def number(value: float, digits: int = 4) -> str:
    """A number to read: '0.00412', '1.2e-07', '53 800'."""
    if not math.isfinite(value):
        return "not known"
    if value and (abs(value) >= 1e6 or abs(value) < 1e-4):
        return f"{value:.{digits - 1}e}"
    exact = f"{value:.{digits}g}"
    return f"{float(exact):.0f}" if "e" in exact else exact


def channel_sentence(channel: str, error: ChannelError) -> str:
    """'Held-out error of delta_x: 312 nm -> 5.2 nm, noise 5 nm.'"""
    noise = "not known" if error.noise_floor is None else f"{number(error.noise_floor, 3)} {error.unit}"
    shown = [f"{number(v, 3)} {error.unit}" for v in (error.rms_before, error.rms_after)]
    unsure = ""
    if error.uncertainty is not None and error.uncertainty > (error.noise_floor or 0.0):
        unsure = f"; the numbers are known no better than to {number(error.uncertainty, 3)} {error.unit} there"
    return f"Held-out error of {short(channel)}: {' -> '.join(dict.fromkeys(shown))}, noise {noise}{unsure}."


def short(channel: str) -> str:
    """'delta_x' for 'reading.delta_x', which is what nearly every recording observes."""
    return channel.removeprefix("reading.")


def worst_channel(diagnosis: Diagnosis) -> str:
    """The channel whose held-out error was largest beside its noise, or fell most where no noise is known."""

    def size(item: tuple[str, ChannelError]) -> float:
        e = item[1]
        ratio = e.rms_before / (e.noise_floor or e.rms_after or 1.0)
        return ratio if math.isfinite(ratio) else -1.0

    return max(diagnosis.held_out.items(), key=size)[0]


def numbers_of(finding: Finding) -> str:
    """'gain = 4.12 % (3.93 ... 4.31 %), tau = ...'."""
    return ", ".join(f"{name} = {interval(e)}" for name, e in finding.parameters.items())


def named(findings: Sequence[Finding]) -> str:
    """The first findings with their numbers; what an effect means stands where it is named first."""
    parts, said = [], set()
    for f in findings[:NAMED]:
        cause = hypothesis_name(f.cause) if f.effect in said else cause_text(f)
        said.add(f.effect)
        parts.append(f"{cause}, {numbers_of(f)}")
    more = [f"{len(findings) - NAMED} more"] if len(findings) > NAMED else []
    return "; ".join(parts + more)


def _within_a_sentence(text: str) -> str:
    first = text.split(" ")[0]
    return text if first[1:] != first[1:].lower() or "-" in first else text[0].lower() + text[1:]


def sentence(diagnosis: Diagnosis) -> str:
    """The verdict in one sentence with numbers."""
    found, verdict = diagnosis.findings, diagnosis.verdict
    head = HEADLINE[verdict]
    if verdict == CONSISTENT:
        said = (
            f"{head}: nothing that this recording can show is missing from the device file ({diagnosis.device.title})"
        )
        said += f"{_blind(diagnosis)}."
    elif (far := contradicts_datasheet(diagnosis.search.chosen.fit)) and diagnosis.residual_tests.passed:
        said = f"{head}: {_beyond(diagnosis, far)}{f'; what helps is {named(found)}' if found else ''}."
    elif not found:
        said = f"{head}: the recording differs from {diagnosis.device.title}, and no cause I know explains it."
    else:
        said = f"{head}: {LEAD[verdict]}{named(found)}{_rivals(diagnosis)}."
    channel = worst_channel(diagnosis)
    return f"{said} {channel_sentence(channel, diagnosis.held_out[channel])}"


def _blind(diagnosis: Diagnosis) -> str:
    """'; nothing below 3.6 um can be judged', of the channels whose noise nothing tells."""
    sizes = [f"{number(e.rms_after, 3)} {e.unit}" for e in diagnosis.held_out.values() if e.noise_floor is None]
    return f"; the noise is not known, so nothing below {', '.join(sizes)} can be judged" if sizes else ""


def _beyond(diagnosis: Diagnosis, far: dict[str, float]) -> str:
    """What it takes to agree, where the device file excludes that."""
    numbers = ", ".join(
        f"{path} = {number(e.value)} {e.unit} ({z:+.0f} stated deviations)"
        for path, z in far.items()
        for e in [diagnosis.values[path]]
    )
    return (
        f"the recording agrees with {diagnosis.device.title} only by numbers that its file excludes: {numbers}; "
        "units, sign or gain of a column may be wrong"
    )


LEAD = {
    EXPLAINED: "",
    PARTLY: "part of what was left out is ",
    AMBIGUOUS: "",
    UNEXPLAINED: "no cause I know explains it; what helps is ",
}


def _rivals(diagnosis: Diagnosis) -> str:
    """', or equally well thermal_lag at actuator:axis', for an ambiguous verdict."""
    others = dict.fromkeys(f"{effect} at {place}" for f in diagnosis.findings for effect, place in f.alternatives)
    if diagnosis.verdict != AMBIGUOUS or not others:
        return ""
    return f"; this recording cannot tell it from {' or '.join(others)}"


def next_steps(diagnosis: Diagnosis) -> list[str]:
    """What a reader does now, in order."""
    verdict = diagnosis.verdict
    use = "Use device.next.toml instead of the device file: solve and generate the C with it, and record once more."
    known = all(e.noise_floor is not None for e in diagnosis.held_out.values())
    rest = "" if known else " Record a rest (drive off) or repeat poses, so that the noise is known."
    if verdict == CONSISTENT:
        unseen = " Effects smaller than those listed below would not have been seen." if diagnosis.detectability else ""
        return [f"Nothing to correct.{unseen}{rest}"]
    if verdict == EXPLAINED:
        return [use]
    if verdict == AMBIGUOUS:
        first = "No drive I tried would settle which of the alternatives it is: measure one of them apart, with another sensor or gauge."
        if (diagnosis.next_experiment or {}).get("settles"):
            first = "Run the next experiment below to settle which of the alternatives it is; name no cause until then."
        return [
            first,
            "device.next.toml holds the best of them; it predicts records of this kind as well as any." + rest,
        ]
    if verdict == PARTLY:
        left = f"Whether something remains cannot be said.{rest}"
        if known:
            most = number(100 * model_error_allowance(diagnosis.search))
            left = f"A little remains above the noise, less than {most} % of what was wrong: see where below."
        if poorly_determined(diagnosis.fitter, diagnosis.search):
            return [
                "The cause is there, but its numbers are known too loosely to foresee the held-out records: fit those too, or "
                "record more of where it acts. Until then device.next.toml foresees worse than the device file.",
            ]
        if diagnosis.unconfirmed:
            names = ", ".join(map(hypothesis_name, diagnosis.unconfirmed))
            left = f"No held-out record shows {names}: hold out one that goes where the record to fit went."
        return [f"{use} It is better than before.", left]
    return [
        "Not a cause I know. Look below at where the mismatch lives, and check the set-up: wiring, units, clocks.",
        "device.next.toml is the best fit found, not an explanation: do not build on its numbers.",
    ]


def unknown_lines(diagnosis: Diagnosis) -> list[str]:
    """What the free disturbance goes with, and the empirical term: a description of the rest, never a cause."""
    found = diagnosis.extra.get("unmodelled_force")
    if not found:
        return []
    term = found["empirical_term"]
    lines = list(found["statements"])
    if term:
        formula = " ".join(f"{value:+.3g} {name}" for name, value in term["terms"].items()).removeprefix("+")
        lines.append(
            f"{term['axis']}, empirical, no cause: {formula} {term['unit']} takes away {term['held_out_gain']:.0%} of what is "
            "left of the held-out records (d, v, u: position, speed and drives, each over its largest value)"
        )
    return lines


def hard(text: str) -> str:
    """`text` with numbers and units that no line break parts."""
    return re.sub(r"(?<=\d) (?=[^\W\d]|%)", HARD_SPACE, text)


def gathered(notes: tuple[str, ...]) -> list[str]:
    """Notes that say the same of several channels as one sentence."""
    same: dict[str, list[str]] = {}
    for note in notes:
        subject, colon, said = note.partition(": ")
        if colon and re.fullmatch(r"\w+\.\w+", subject):
            same.setdefault(said, []).append(subject)
        else:
            same.setdefault(note, [])
    return [f"{', '.join(subjects)}: {said}" if subjects else said for said, subjects in same.items()]

"""What an answer says of what is left: how much, of what kind, what the fit had to move, what could not be tried."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ctrlgen.core.units import from_si, to_si
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.answer_parts import Part, Yields
from ctrlgen.diagnosis.report.narrative import PERIODS, per_cent, short
from ctrlgen.diagnosis.report.shares_sentences import named_parts, part_name, rest_kind
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.findings import ChannelErrorEntry
from ctrlgen.diagnosis.selection.ringing_mass import ringing_masses
from ctrlgen.diagnosis.selection.verdict import (
    Verdict,
    contradicts_datasheet,
    moved_numbers,
    poorly_determined,
    within_tolerance,
)
from ctrlgen.diagnosis.shares.design import Kind
from ctrlgen.estimation.settings import RESIDUAL_TESTS
from ctrlgen.reporting.numbers import number

# times the noise from which on it is said that chance allows as much
CHANCE = 1.2
# by how much a period of a finding may differ from that of a pitch that is the same, or a harmonic of it
SAME_PITCH = 0.03


def left_parts(diagnosis: Diagnosis) -> list[Part]:
    """What is left where it is more than noise, why the answer is partial where it is not, numbers that moved far, and what could not be
    tried."""
    untried = _untried(diagnosis)
    if diagnosis.verdict == Verdict.CONSISTENT:
        return untried
    beyond = contradicts_datasheet(diagnosis.search.chosen.fit) and diagnosis.residual_tests.passed
    moved = [] if beyond else _moved(diagnosis)
    return [*(_rest(diagnosis) if diagnosis.findings else []), *moved, *_uneven(diagnosis), *untried]


def _untried(diagnosis: Diagnosis) -> list[Part]:
    """'; 3 of 4 causes worth a fit could not be fitted: no balance (...)'."""
    parts = []
    for sentence in diagnosis.untried.sentences():
        text = f"; {sentence.removesuffix('.')}"
        shorter = ((Yields.WHY_UNTRIED, text.partition(": ")[0]), (Yields.UNTRIED, ""))
        parts.append(Part(text, shorter, sentence.removesuffix(".")))
    return parts


def _uneven(diagnosis: Diagnosis) -> list[Part]:
    """'; what is left of axis in fit.csv is 23 times what is left in hold_out.csv: something acts in the one alone, such as a jump'."""
    parts = []
    for channel, (most, least, ratio) in diagnosis.residual_tests.uneven.items():
        text = f"what is left of {short(channel)} in {most} is {number(ratio, 2)} times what is left in {least}"
        why = "noise does not differ so, and something acts in the one that does not in the other, such as a jump"
        shorter = ((Yields.HOW_UNEVEN, f"; {text}"), (Yields.UNEVEN, ""))
        parts.append(Part(f"; {text}: something acts in the one alone, such as a jump", shorter, f"{text}: {why}"))
    return parts


def _rest(diagnosis: Diagnosis) -> list[Part]:
    """'; left: 4.9 urad in theta_z, 1.4 times the noise, mostly a function of position'."""
    if any(e.noise_floor is None for e in diagnosis.held_out.values()):
        return [Part("; whether more is left cannot be said without the noise")]
    channel, e = max(diagnosis.held_out.items(), key=lambda item: item[1].rms_after / (item[1].noise_floor or 1.0))
    ratio = e.rms_after / (e.noise_floor or 1.0)
    size = f"; left: {number(e.rms_after, 3)} {e.unit} in {short(channel)}, {number(ratio, 2)} times the noise"
    if not diagnosis.residual_tests.passed:
        kind = Part(rest_kind(diagnosis, channel), ((Yields.KIND, ""),))
        return [Part(size), kind, Part(f"{within(diagnosis)}{_little(diagnosis, e)}")]
    if diagnosis.unconfirmed:
        names = " or ".join(map(cause_name, diagnosis.unconfirmed))
        few = f"; no held-out record shows {len(diagnosis.unconfirmed)} of the causes"
        return [
            Part(f"; no held-out record shows {names}", ((Yields.BESIDE, few),), f"No held-out record shows {names}")
        ]
    if diagnosis.verdict == Verdict.PARTLY and poorly_determined(diagnosis.search):
        return [Part("; the numbers are too uncertain to predict the held-out records better")]
    if channel in _untold_noise(diagnosis):
        return [Part(f"; left: {number(e.rms_after, 3)} {e.unit} in {short(channel)}"), *untold(diagnosis)]
    return [Part(f"{size}, which chance allows")] if ratio > CHANCE else []


def of_what_kind(diagnosis: Diagnosis, channel: str) -> Part:
    """'; what is left in axis is mostly a function of position (64 %)', where nothing was found that would leave something else."""
    kind = rest_kind(diagnosis, channel)
    return Part(f"; what is left in {short(channel)} is{kind.removeprefix(',')}" if kind else "", ((Yields.KIND, ""),))


def pitch_part(diagnosis: Diagnosis, channel: str) -> Part:
    """'; by the model-free shares 64 % is a function of the place in a pitch of 0.25 mm (4 a mm)', of a pitch that no finding has and that
    is not told of what is left."""
    shares = diagnosis.shares
    c = next((c for c in shares.before.channels if c.channel == channel), None) if shares is not None else None
    share = None if c is None else dict(named_parts(c)).get(Kind.PITCH)
    if c is None or share is None or _has_pitch(diagnosis, c.periods[Kind.PITCH]):
        return Part("")
    name = part_name(c, Kind.PITCH)
    if not diagnosis.search.chosen.causes and name in rest_kind(diagnosis, channel):
        return Part("")
    text = f"by the model-free shares {per_cent(share)} is a function of {name}"
    return Part(f"; {text}", ((Yields.PITCH, ""),), f"{channel}: {text}")


def _has_pitch(diagnosis: Diagnosis, pitch: float) -> bool:
    """Whether a finding repeats after the `pitch` [SI], or after a whole part or a multiple of it."""
    numbers = [n for f in diagnosis.findings for n in (f.parameters, *f.terms)]
    for e in (e for n in numbers for name, e in n.items() if name in PERIODS):
        ratio = abs(to_si(e.value, e.unit)) / pitch
        ratio = max(ratio, 1 / ratio) if ratio > 0 else math.inf
        if math.isfinite(ratio) and abs(ratio - round(ratio)) < SAME_PITCH * ratio:
            return True
    return False


def _moved(diagnosis: Diagnosis) -> list[Part]:
    """'; the fit moves mechanics.mass to 1.2 kg (+10 stated standard deviations)', and of what a stated mass includes a part that rings."""
    moved = moved_numbers(diagnosis.search.chosen.fit)
    if not moved:
        return []
    text, first = moved_words(diagnosis, moved)
    rings = [
        f"the stated {path} includes the {number(float(from_si(part, unit)), 2)} {unit} that ring"
        for path, part in ringing_masses(diagnosis.search.chosen.fit).items()
        for unit in [diagnosis.values[path].unit]
    ]
    shorter = [(Yields.FURTHER_MOVED, f"; the fit moves {first}")] if first != text else []
    return [
        Part(f"; the fit moves {text}", (*shorter, (Yields.MOVED, "")), f"the fit moves {text}"),
        *(Part(f"; {line}", ((Yields.RINGING, ""),), line) for line in rings),
    ]


def moved_words(diagnosis: Diagnosis, deviations: dict[str, float]) -> tuple[str, str]:
    """The numbers that the fit moved by so many stated standard deviations: all; and the one that moved farthest, with how many more there
    are."""
    told = {
        path: f"{path} to {number(e.value)} {e.unit} ({z:+.0f} stated standard deviations)"
        for path, z in deviations.items()
        for e in [diagnosis.values[path]]
    }
    farthest = max(deviations, key=lambda path: abs(deviations[path]))
    more = f" and {len(told) - 1} more" if len(told) > 1 else ""
    return ", ".join(told.values()), told[farthest] + more


def within(diagnosis: Diagnosis) -> str:
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


def blind(diagnosis: Diagnosis) -> list[Part]:
    """'; the noise is not known, so errors below 3.6 um in axis cannot be judged', for the channels whose noise is not known."""
    unknown = {c: e for c, e in diagnosis.held_out.items() if e.noise_floor is None}
    if not unknown:
        return []
    sizes = [f"{number(e.rms_after, 3)} {e.unit} in {short(c)}" for c, e in unknown.items()]
    few = [f"{sizes[0]} (others in the table)"] if len(sizes) > 2 else sizes
    text, shorter = (
        f"; the noise is not known, so errors below {_listed(named)} cannot be judged" for named in (sizes, few)
    )
    return [Part(text, ((Yields.FURTHER_CHANNELS, shorter),))]


def _untold_noise(diagnosis: Diagnosis) -> dict[str, float]:
    """Of channels that leave more than the guess of their noise: p that it goes so well with the motion by chance."""
    return {
        channel: e.goes_with_motion
        for channel, e in diagnosis.held_out.items()
        if e.goes_with_motion is not None and e.rms_after > RESIDUAL_TESTS.error_ratio * (e.noise_floor or math.inf)
    }


def untold(diagnosis: Diagnosis) -> list[Part]:
    """'; the noise was neither stated nor recorded at rest and would be 0.0652 um in axis, nothing of which is seen to go with the drive or
    the motion (p = 0.35)', where size and memory of what is left could not decide. Nothing where something of it does."""
    unsure = _untold_noise(diagnosis)
    if not unsure or not diagnosis.residual_tests.passed:
        return []
    p, seen = min(unsure.values()), "so few samples cannot tell whether it goes with the drive or the motion"
    if p < 1:
        seen = f"nothing of which is seen to go with the drive or the motion (p = {number(p, 2)})"
    sizes = [f"{number(e.rms_after, 3)} {e.unit} in {short(c)}" for c, e in diagnosis.held_out.items() if c in unsure]
    unknown = "the noise was neither stated nor recorded at rest"
    text = f"{unknown} and would be {_listed(sizes)}, {seen}"
    return [Part(f"; {text}", ((Yields.WHAT_NOISE, f"; {unknown} and may be all of it"),), text)]


def _listed(sizes: Sequence[str]) -> str:
    return " and ".join([", ".join(sizes[:-1]), sizes[-1]] if len(sizes) > 1 else sizes)

"""What an answer says of causes that the readings do not tell from the main one, as parts of its first sentence."""

from __future__ import annotations

from collections.abc import Sequence

from ctrlgen.core.counts import number_of
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.answer_parts import Part, Yields
from ctrlgen.diagnosis.report.narrative import per_cent
from ctrlgen.diagnosis.selection.cause_entry import cause_name, cause_noun
from ctrlgen.diagnosis.selection.untold_scale import moved_together
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.diagnosis.settings import VERDICT
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.size_odds import size_of
from ctrlgen.reporting.numbers import number

# alternatives of a cause that the sentence holds, where it has room
LISTED = 3
ALIKE = "the readings alone do not tell it from"


def rival_parts(diagnosis: Diagnosis) -> list[Part]:
    """Of a main cause: what explains as well, what the model-free shares speak for, what would have to be unusual, or stated wrongly."""
    return [*_rivals(diagnosis), *_support(diagnosis), *_unlikely(diagnosis), *_by_file(diagnosis)]


def _rivals(diagnosis: Diagnosis) -> list[Part]:
    """'; this recording cannot tell it from thermal_lag at actuator:axis, nor drive_offset at actuator:axis from home_offset at
    sensor:axis', for an ambiguous verdict: of the main cause, and of others whose share makes the answer ambiguous."""
    if diagnosis.verdict != Verdict.AMBIGUOUS:
        return []
    main = diagnosis.findings[0]
    least = VERDICT.main_share * (main.share.value if main.share else 0.0)
    counts = [f for f in diagnosis.findings if main.share is None or (f.share is not None and f.share.value >= least)]
    alike = [f for f in counts if f.alternatives]
    if not alike:
        return []

    def pairs(most: int) -> list[str]:
        return [f"{'it' if f is main else cause_noun(f.cause)} from {_any(f.alternatives, most)}" for f in alike]

    text, few = (f"; this recording cannot tell {', nor '.join(pairs(most))}" for most in (LISTED, 1))
    more = f", nor {len(alike) - 1} more from others" if len(alike) > 2 else ""
    fewest = f"; this recording cannot tell {pairs(1)[0]}{more}"
    shorter = [(Yields.FURTHER_RIVALS, few)] if few != text else []
    shorter += [(Yields.BESIDE, fewest)] if more else []
    return [Part(text, tuple(shorter))]


def _any(causes: Sequence[Hypothesis], most: int) -> str:
    """'backlash at stage:axis or creep at stage:axis', the first ones: the table has them all."""
    more = [f"{len(causes) - most} more"] if len(causes) > most else []
    return " or ".join([*map(cause_noun, causes[:most]), *more])


def _support(diagnosis: Diagnosis) -> list[Part]:
    """'; the model-free shares speak for dry friction (64 %), not for gain (3 %)', where that is why the answer is ambiguous."""
    support = diagnosis.findings[0].support
    if diagnosis.verdict != Verdict.AMBIGUOUS or support is None or not support.contradicted:
        return []
    told = (
        f"{support.leading} ({per_cent(support.leading_share)}), not for {support.family} ({per_cent(support.share)})"
    )
    return [Part(f"; the model-free shares speak for {told}")]


def _unlikely(diagnosis: Diagnosis) -> list[Part]:
    """'; the readings alone do not tell it from a wrong mechanism:height' with `how_unlikely` that is."""
    rival, unlikely = unlikely_rival(diagnosis)
    if not rival:
        return []
    alike = f"{ALIKE} {rival}"
    note = f"{cause_name(diagnosis.findings[0].cause)}: {alike}, {unlikely}"
    return [Part(f"; {alike}, {unlikely}", ((Yields.HOW_UNLIKELY, f"; {alike}"),), note)]


def unlikely_rival(diagnosis: Diagnosis) -> tuple[str, str]:
    """'a wrong mechanism:height', and 'which would be off by 30 of its usual deviations, the one named by 1.2', where what is known
    beforehand decides; nothing elsewhere."""
    main, search = diagnosis.findings[0], diagnosis.search
    alike = dict(zip(search.chosen.causes, search.unlikely, strict=False)).get(main.cause)
    if not alike:
        return "", ""
    rival, here = alike[0], size_of(search.chosen.fit, search.chosen.causes.index(main.cause))
    there = size_of(rival.fit, next(i for i, c in enumerate(rival.causes) if c == rival.cause))
    if there is None or rival.cause is None:
        return "", ""
    own = "" if here is None or not here[1].sd else f", the one named by {number(here[0], 2)}"
    kind = "stated" if there[1].stated else "usual"
    off = (
        f"would be off by {number(there[0], 2)} of its {kind} deviations" if there[1].sd else "is set and not measured"
    )
    return cause_noun(rival.cause), f"which {off}{own}"


def _by_file(diagnosis: Diagnosis) -> list[Part]:
    """'; the readings alone do not tell it from mechanics.stiffness and actuator.force_constant off together: that it is this one
    rests on what the file states of those', for a number of the device."""
    fit, main = diagnosis.search.chosen.fit, diagnosis.findings[0].cause
    others = moved_together(fit, fit.structure.causes.index(main)) if main in fit.structure.causes else ()
    if not others:
        return []
    names = " and ".join([", ".join(others[:-1]), others[-1]] if len(others) > 1 else others)
    alike = f"{ALIKE} {names} off together"
    note = f"{cause_name(main)}: {alike}; that it is this one rests on what the file states of those"
    whole = f"; {alike}: that it is this one rests on what the file states of those"
    some = f"; {ALIKE} {number_of(len(others), 'other number')} off"
    return [Part(whole, ((Yields.HOW_UNLIKELY, f"; {alike}"), (Yields.FURTHER_RIVALS, some)), note)]

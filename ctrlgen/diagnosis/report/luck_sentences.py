"""The chance that luck found a cause, in words."""

from __future__ import annotations

from collections.abc import Sequence

from ctrlgen.core.counts import number_of
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.findings import ChanceEntry, Finding, Role
from ctrlgen.reporting.numbers import number

MAY_BE_LUCK = "may be luck"
NOT_EXCLUDED = "luck is not excluded"
NOT_JUDGED = "cannot be judged"
# a smaller chance is not shown: more depends on what the test assumes of the noise
SMALLEST = 1e-6


def chance_text(finding: Finding) -> str:
    """'< 1e-6', '12 %', that it cannot be judged, '-' for what was read from the data."""
    chance = finding.chance
    return "-" if chance is None else NOT_JUDGED if chance.by_luck is None else _size(chance.by_luck)


def luck_text(finding: Finding) -> str:
    """The chance with what it is from: '0.3 %: p = 8e-06 over all signs of 47 stretches, times 366 answers'."""
    chance = finding.chance
    if chance is None:
        return "read from the data"
    if chance.p is None or chance.looks is None:
        return f"{NOT_JUDGED} by luck: {chance.reason}"
    stretches = number_of(chance.stretches, "stretch", "stretches")
    of = f"p {_equals(chance.p)} over all signs of {stretches}, times {number(chance.looks, 2)} answers"
    return f"{chance_text(finding)}: {of}"


def doubt_of_luck(finding: Finding) -> str:
    """'it may be luck (12 %)', or that luck is not excluded; nothing where it is, or where no held-out record shows the cause, which is
    told by itself."""
    chance = finding.chance
    if chance is None or chance.certain or finding.role is Role.UNSEEN:
        return ""
    return f"it {MAY_BE_LUCK} ({chance_text(finding)})" if chance.weak else NOT_EXCLUDED


def short_doubt(finding: Finding) -> str:
    """`doubt_of_luck` without its number, for brackets."""
    return MAY_BE_LUCK if finding.chance is not None and finding.chance.weak else NOT_EXCLUDED


def luck_steps(findings: Sequence[Finding]) -> list[str]:
    """What to record where luck is not excluded, by cause."""
    doubted = [(f, f.chance) for f in findings if f.chance is not None and f.role is Role.CAUSE and doubt_of_luck(f)]
    return [f"{_why(cause_name(f.cause), chance)}." for f, chance in doubted]


def _why(cause: str, chance: ChanceEntry) -> str:
    if chance.by_luck is None:
        return f"{cause} {NOT_JUDGED} by luck: {chance.reason}"
    return f"Luck is not excluded for {cause}: its chance is {_size(chance.by_luck)}; hold out more of what shows it"


def _equals(p: float) -> str:
    return f"< {number(SMALLEST, 1)}" if p < SMALLEST else f"= {number(p, 2)}"


def _size(chance: float) -> str:
    if chance < SMALLEST:
        return f"< {number(SMALLEST, 1)}"
    return f"{number(100 * chance, 2)} %" if chance >= 1e-3 else number(chance, 2)

"""Why a cause stands first whose share is not the largest: more is left without it than without the other."""

from __future__ import annotations

from collections.abc import Sequence

from ctrlgen.diagnosis.report.narrative import per_cent
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.findings import Finding, Role
from ctrlgen.reporting.numbers import number

WHY = (
    "{} and {} take nearly the same away ({} and {}); the first is needed more: of {}, {} {unit} is left without it, {} {unit} without "
    "the other, the rest fitted again"
)


def nearly_as_large(findings: Sequence[Finding]) -> list[str]:
    """The sentence on the first cause, where another one has a larger share of the error."""
    causes = [f for f in findings if f.role is Role.CAUSE and f.share is not None and not f.contradicted]
    if not causes or (first := causes[0]) is (largest := max(causes, key=lambda f: f.share.value if f.share else 0.0)):
        return []
    channel = max(first.worth, key=lambda c: first.worth[c].without / largest.worth[c].without)
    mine, other = first.worth[channel], largest.worth[channel]
    names = (cause_name(f.cause) for f in (first, largest))
    shares = (per_cent(f.share.value) for f in (first, largest) if f.share)
    return [WHY.format(*names, *shares, channel, number(mine.without, 3), number(other.without, 3), unit=mine.unit)]

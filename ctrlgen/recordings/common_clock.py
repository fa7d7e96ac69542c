"""Records of several files on one clock: their columns of time tell it where they go on from each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

REACH = 2.0
"""The clock is one where the time from the first row to the last is at most so many times what the records themselves take. Of records
that are days apart an hour each nobody knows whether what drifts went on. A judgement."""


@dataclass(frozen=True)
class Stretch:
    """When a record of the file `file` was, by its own column of time [s], whose first row is at `begin`."""

    file: str
    begin: float
    first: float
    last: float


def common_clock(stretches: Sequence[Stretch]) -> dict[str, float] | None:
    """How much later [s] each file began than the earliest one; None where there is one file, or where their times do not tell."""
    begins = {s.file: s.begin for s in stretches}
    if len(begins) < 2 or len({(s.file, s.begin) for s in stretches}) > len(begins):
        return None
    spans = sorted(
        (min(s.first for s in stretches if s.file == file), max(s.last for s in stretches if s.file == file))
        for file in begins
    )
    follow = all(last < first for (_, last), (first, _) in pairwise(spans))
    lasted = sum(last - first for first, last in spans)
    if not follow or spans[-1][1] - spans[0][0] > REACH * lasted:
        return None
    earliest = min(begins.values())
    return {file: begin - earliest for file, begin in begins.items()}

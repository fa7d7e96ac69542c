"""The rows of the table for messy cases, for memory, and for clean records with rough noise."""

from __future__ import annotations

from collections.abc import Sequence

from battery.judge import Judgement
from battery.rows import Row, number, share

UNSET = "none set"


def rough_rows(judged: Sequence[Judgement]) -> list[Row]:
    """Goals on messy cases, memory and nulls, and what is printed beside them."""
    messy = [j for j in judged if j.kind == "messy"]
    memory = [j for j in judged if j.kind == "memory"]
    null = [j for j in judged if j.kind == "null"]
    forms = [j for j in judged if j.kind == "forms"]
    alone = [j.rough.nothing_beside for j in memory if j.alone]
    best = [j.rough.over_best for j in messy if j.rough.over_best is not None]
    parts = [
        (f"{room}, {how}", [j for j in memory if (j.series, j.alone) == (room == "series", how == "single")])
        for room in ("series", "poses")
        for how in ("single", "messy")
    ]
    return [
        share("messy, dominant cause first", [j.rough.first for j in messy], ">= 95 %", 0.95),
        share("messy, dominant cause first or an alternative of it", [j.rough.in_set for j in messy], UNSET),
        share("messy, place", [j.rough.place for j in messy], ">= 97 %", 0.97),
        share("messy, share within 5 points", [j.rough.share for j in messy], ">= 85 %", 0.85),
        share("messy, artefact above a real cause", [j.rough.artefact for j in messy], "<= 3 %", most=0.03),
        share("messy, 'partly' or 'explained'", [j.rough.answered for j in messy], UNSET),
        number("messy, held-out error / least possible, median", best, 0.5, UNSET),
        number("messy, held-out error / least possible, 95th percentile", best, 0.95, UNSET),
        share("messy, coverage of 95 % intervals", [c.inside for j in messy for c in j.covered], ">= 88 %", 0.88),
        share("memory, family first", [j.rough.first for j in memory], ">= 95 %", 0.95),
        share("memory, place", [j.rough.place for j in memory], ">= 95 %", 0.95),
        share("memory alone, nothing beside it", alone, ">= 90 %", 0.90),
        *(share(f"memory, family first, {what}", [j.rough.first for j in part], UNSET) for what, part in parts),
        share("other forms of memory, family first", [j.rough.first for j in forms], ">= 95 %", 0.95),
        share("other forms of memory, nothing beside it", [j.rough.nothing_beside for j in forms], ">= 90 %", 0.90),
        share("nulls, anything but 'consistent'", [j.verdict != "consistent" for j in null], "<= 2 %", most=0.02),
        share("nulls, false names", [j.wrong or j.verdict == "failed" for j in null], "0 %", most=0.0),
    ]

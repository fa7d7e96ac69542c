"""Numbers by which an instrument says that it has no reading: beyond its range, or lost."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ctrlgen.recordings.formats.layout_question import Ambiguous

HUGE = 9e29  # no reading in any unit: SCPI says 9.9e37 and 9.91e37, others 1e30, 1e31, 1e38, the largest float and infinity
COUNTS = (-9999, 9999, -99999, 99999, -999, -9999.99, 99999.9, 999999, -999999, 9999999, -32768, 32767, 65535, -2147483648, 2147483647,
          4294967295, 8388607, -8388608, 16777215, -999.25, -99.9, -999.9,
          *(sign * 10.0**n for n in (6, 7, 8, 9, 10, 12, 15, 20) for sign in (1, -1)))  # fmt: skip
"""Numbers that loggers and converters write for none; some are readings, so they count only where they are far from all else."""
LIMITS = frozenset(f"{2**bits - end}" for bits in (15, 16, 23, 24, 31, 32) for end in (0, 1))
"""Digits of the ends of a converter's counts: times a power of ten, as a logger writes them in a unit, they are marks as well."""
NINES = re.compile(r"-?(?:9+\.?9*|9{4,}0+)")
FEWEST_NINES = 4  # of a number that fills the display of a sensor: 99.99
NEAR = 0.25  # spans: one of `COUNTS` that repeats and stands between this and `FAR` beyond all others may be either, and is asked
FAR = 10.0  # spans of all other readings between them and one of `COUNTS`: no motion leaves its range so far and returns at once


class Mark(NamedTuple):
    """Readings of one number that is no reading: how many, the first row, the number as text, what it means."""

    readings: int
    row: int
    text: str
    meaning: str


def without_marks(
    values: np.ndarray, missing: Sequence[str | int | float] | None = None
) -> tuple[np.ndarray, list[Mark]]:
    """`values` (n,) with NaN where a number is over range, and what was left out.

    `missing`: numbers that the reader says are none; where they are given, even as none at all, no other of `COUNTS` is taken for one.
    Raises `Ambiguous` for a number that may be a reading or a mark for none.
    """
    own = [float(m) for m in missing or () if not isinstance(m, str) or _is_float(m)]
    marks: list[Mark] = []
    kept = values
    for number in own:
        kept = _left_out(kept, kept == number, "which layout.missing says is none", marks)
    with np.errstate(invalid="ignore"):
        for number in np.unique(kept[np.abs(kept) >= HUGE])[:50]:
            kept = _left_out(kept, kept == number, "over range", marks)
        kept = _left_out(kept, np.abs(kept) >= HUGE, "over range", marks)
    known = (*COUNTS, *_full_displays(kept)) if missing is None else ()
    for number in known:
        chosen = kept == number
        spans = _beyond(kept[~np.isin(kept, known)], number) if chosen.any() else 0.0
        if spans > FAR:
            kept = _left_out(kept, chosen, "far from all others: a mark for none", marks)
        elif spans > NEAR and np.sum(chosen) > 1:
            raise mark_or_reading(number, int(np.sum(chosen)), "beyond all its other numbers")
    return kept, marks


def mark_or_reading(
    number: float, times: int, how: str = "written without the digits of all its other numbers"
) -> Ambiguous:
    """The question whether a number is a mark for none."""
    told = f"holds {number:g} {times} times, {how}: a reading, or a mark for none?"
    return Ambiguous(told, {f"missing = [{number:g}]": "if it is a mark", "missing = []": "if it is a reading"})


def _full_displays(values: np.ndarray) -> list[float]:
    """The ends of a range that are nothing but nines, such as 99.9999, as a display shows them that is full, or those of a converter times
    a power of ten, such as -3276.8."""
    finite = values[np.isfinite(values)]
    ends = (float(finite.min()), float(finite.max())) if len(finite) else ()
    texts = ((end, f"{end:.10g}") for end in ends)
    return [
        end
        for end, text in texts
        if end not in COUNTS
        and (
            (text.count("9") >= FEWEST_NINES and NINES.fullmatch(text)) or text.replace(".", "").lstrip("-0") in LIMITS
        )
    ]


def _is_float(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _beyond(others: np.ndarray, number: float) -> float:
    """How many times the range of `others` a number lies beyond it; 0 where they have none."""
    finite = others[np.isfinite(others)]
    if len(finite) < 2:
        return 0.0
    low, high = float(finite.min()), float(finite.max())
    return max(number - high, low - number) / (high - low) if high > low else 0.0


def _left_out(values: np.ndarray, chosen: np.ndarray, meaning: str, marks: list[Mark]) -> np.ndarray:
    if not chosen.any():
        return values
    row = int(chosen.argmax())
    marks.append(Mark(int(chosen.sum()), row, f"{values[row]:.6g}", meaning))
    return np.where(chosen, np.nan, values)

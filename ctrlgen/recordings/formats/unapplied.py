"""Factors that a file states beside its numbers without a convention that says whether they are in them: told, not applied."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.units import same_dimension
from ctrlgen.recordings.formats.unit_texts import unit_of

MULTIPLIES = frozenset(("scale", "scaling", "factor", "slope", "multiplier", "lsb", "resolution"))
"""Words of names of factors by which numbers are multiplied."""
FACTORS = MULTIPLIES | {"gain", "conversion", "sensitivity"}
"""The same with those that rather divide them."""
OTHERS = frozenset(("bit", "bits", "full", "range", "min", "max"))
"""Words beside which a number is no factor: resolution_bits = 16, full_scale = 10."""
WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
"""The words of scaleFactor, scale_factor and ScaleFactor alike."""
FLAGS = frozenset((
    "valid", "invalid", "validity", "quality", "status", "ok", "good", "bad", "error", "err", "fault", "alarm", "overrange", "overload",
    "flag", "flags", "saturated", "clipped",
))  # fmt: skip
"""Words of columns that say of each row whether it was read rightly."""
MOST_FLAGS, MOSTLY = 8, 0.6
"""Different flags of a column, and the share of rows that hold the usual one. Judgement."""
APPLIED = ("scale_factor",)  # which the CF conventions define
MOST_UNITS = 6
"""Units among which an instrument changes."""
MOST_RANGES = 20
"""Factors that the ranges of an instrument have; a column of more numbers, such as what a glass scale reads, is measured. Judgement."""
NI_SCALE = "NI_"  # begins the properties of scales that the reader of TDMS applies


class Factor(NamedTuple):
    """An attribute that looks like a factor, and whether numbers are multiplied by it."""

    key: str
    number: float
    multiplies: bool


def factors_of(attributes: Iterable[tuple[str, Any]]) -> list[Factor]:
    """Of the attributes of a column, which its reader does not apply, those that are factors other than one, and finite."""
    found = []
    for key, value in attributes:
        words = _words(key)
        if not words & FACTORS or words & OTHERS:
            continue
        try:
            number = float(value)
        except (TypeError, ValueError):
            continue
        if np.isfinite(number) and number not in (0, 1):
            found.append(Factor(key, number, bool(words & MULTIPLIES)))
    return found


def _words(name: str) -> set[str]:
    return {word.lower() for word in WORDS.findall(name)}


def unapplied(name: str, factors: Sequence[Factor]) -> list[str]:
    """A note for each factor beside the column `name`."""
    return [
        f"{name}: {key} = {number:.12g} stands beside it and is not applied; where its numbers lack it, write scale = {number:.12g}"
        for key, number, _ in factors
    ]


def scale_of_counts(values: np.ndarray, factors: Sequence[Factor]) -> float | None:
    """The factor that stands beside whole numbers (n,) that surely lack it: one by which whole numbers multiplied are whole no more, or of
    which they are no multiples. None where there is none, or more than one."""
    if values.dtype.kind not in "iu" or not values.size:
        return None
    lacking = (f.number for f in factors if f.multiplies and (f.number != round(f.number) or np.any(values % f.number)))
    found = set(lacking)
    return found.pop() if len(found) == 1 else None


def _flags(name: str, column: np.ndarray) -> str:
    """What is told of a column that says of each row whether it was read rightly, where a few rows differ; empty for any other."""
    if not _words(name) & FLAGS:
        return ""
    cells = ["" if cell is None or cell != cell else str(cell) for cell in column]
    counts = Counter(cells).most_common(MOST_FLAGS + 1)
    usual, often = counts[0] if counts else ("", 0)
    if not 1 < len(counts) <= MOST_FLAGS or often < MOSTLY * len(cells):
        return ""
    others = ", ".join(cell or "empty" for cell, _ in counts[1:])
    told = f"{name}: is {others} in {number_of(len(cells) - often, 'row')} and {usual or 'empty'} in all others"
    return f"{told}, not applied: empty the readings of these rows where it says that they are none"


def unapplied_columns(names: Sequence[str], columns: Sequence[np.ndarray]) -> list[str]:
    """A note for each column that states units, or a factor, that change from row to row: of an instrument that changes its range."""
    said = []
    for name, column in zip(names, columns, strict=True):
        if flagged := _flags(name, column):
            said.append(flagged)
        if column.dtype.kind == "O":
            cells = list(dict.fromkeys(cell for cell in column if isinstance(cell, str)))
            units = [unit_of(cell) for cell in cells] if 1 < len(cells) <= MOST_UNITS else [None]
            first = units[0]
            if first is not None and all(unit is not None and same_dimension(unit, first) for unit in units):
                said.append(
                    f"{name}: states units that differ from row to row ({', '.join(cells)}), not applied: write one"
                )
        elif (
            _words(name) & FACTORS
            and 1 < len(known := np.unique(column[np.isfinite(column.astype(float))])) <= MOST_RANGES
        ):
            said.append(
                f"{name}: goes from {known[0]:g} to {known[-1]:g} and is not applied, should numbers beside it lack it"
            )
    return said

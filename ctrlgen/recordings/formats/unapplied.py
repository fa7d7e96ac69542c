"""Factors that a file states beside its numbers without a convention that says whether they are in them: told, not applied."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ctrlgen.core.units import same_dimension
from ctrlgen.recordings.formats.unit_texts import unit_of

FACTOR = re.compile(
    r"(^|[ _.])(gain|scale|scaling|factor|slope|multiplier|conversion|sensitivity)($|[ _.])", re.IGNORECASE
)
MULTIPLIES = re.compile(r"(.*[ _.])?(scale|scaling|factor|slope|multiplier|lsb|resolution)([ _.].*)?", re.IGNORECASE)
"""Of these the ones by which numbers are multiplied; a gain or a sensitivity rather divides them."""
APPLIED = ("scale_factor",)  # which the CF conventions define
MOST_UNITS = 6
"""Units among which an instrument changes."""
MOST_RANGES = 20
"""Factors that the ranges of an instrument have; a column of more numbers, such as what a glass scale reads, is measured. Judgement."""
NI_SCALE = "NI_"  # begins the properties of scales that the reader of TDMS applies


def unapplied(name: str, attributes: Iterable[tuple[str, Any]]) -> list[str]:
    """A note for each attribute of the column `name` that looks like a factor other than one."""
    said = []
    for key, value in attributes:
        if key in APPLIED or key.startswith(NI_SCALE) or not FACTOR.search(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", key)):
            continue
        try:
            number = float(value)
        except (TypeError, ValueError):
            continue
        if number != 1:
            said.append(
                f"{name}: {key} = {number:.12g} stands beside it and is not applied; where its numbers lack it, write scale = {number:.12g}"
            )
    return said


def scale_of_counts(values: np.ndarray, attributes: Iterable[tuple[str, Any]]) -> float | None:
    """The factor that stands beside whole numbers (n,) that surely lack it: one by which whole numbers multiplied are whole no more, or of
    which they are no multiples. None where there is none, or more than one."""
    if values.dtype.kind not in "iu" or not values.size:
        return None
    found = set()
    for key, value in attributes:
        try:
            number = float(value)
        except (TypeError, ValueError):
            continue
        lacking = number != round(number) or bool(np.any(values % number)) if number and np.isfinite(number) else False
        if MULTIPLIES.fullmatch(key) and lacking:
            found.add(number)
    return found.pop() if len(found) == 1 else None


def unapplied_columns(names: Sequence[str], columns: Sequence[np.ndarray]) -> list[str]:
    """A note for each column that states units, or a factor, that change from row to row: of an instrument that changes its range."""
    said = []
    for name, column in zip(names, columns, strict=True):
        if column.dtype.kind == "O":
            cells = list(dict.fromkeys(cell for cell in column if isinstance(cell, str)))
            units = [unit_of(cell) for cell in cells] if 1 < len(cells) <= MOST_UNITS else [None]
            first = units[0]
            if first is not None and all(unit is not None and same_dimension(unit, first) for unit in units):
                said.append(
                    f"{name}: states units that differ from row to row ({', '.join(cells)}), not applied: write one"
                )
        elif (
            FACTOR.search(name)
            and 1 < len(known := np.unique(column[np.isfinite(column.astype(float))])) <= MOST_RANGES
        ):
            said.append(
                f"{name}: goes from {known[0]:g} to {known[-1]:g} and is not applied, should numbers beside it lack it"
            )
    return said

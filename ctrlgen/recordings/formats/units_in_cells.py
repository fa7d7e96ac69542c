"""Columns whose every cell is a number and one and the same unit, as dashboards export them: 0.5 mV."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ctrlgen.recordings.formats.number_cells import MISSING
from ctrlgen.recordings.formats.unit_texts import unit_of

CELL = re.compile(r"([+\u2212-]?[\d.,]+(?:[eE][+-]?\d+)?)\s*([^\W\d_]{1,4}|%|\u00b0C?)")


def without_units(columns: Sequence[np.ndarray]) -> tuple[list[np.ndarray], dict[int, str]]:
    """The columns (n,) without the unit of their cells, and that unit by number of column. A column of several units stays as it is."""
    found, units = list(columns), dict[int, str]()
    for k, column in enumerate(columns):
        first = next((c for c in column if isinstance(c, str)), "") if column.dtype.kind == "O" else ""
        if not CELL.fullmatch(first):
            continue
        matches = [CELL.fullmatch(c) if isinstance(c, str) else None for c in column]
        empty = [c is None or str(c).lower() in MISSING for c in column]
        stated = {m[2] for m in matches if m}
        whole = all(m is not None or none for m, none in zip(matches, empty, strict=True))
        if not whole or len(stated) != 1 or unit_of(unit := stated.pop()) is None:
            continue
        found[k] = np.array([None if m is None else m[1] for m in matches], dtype=object)
        units[k] = unit
    return found, units

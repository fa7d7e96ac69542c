"""Columns whose every cell is a number and one and the same unit, as dashboards export them, or a prefix of SI: 0.5 mV, 500m, 1.2k."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from ctrlgen.recordings.formats.number_cells import MISSING
from ctrlgen.recordings.formats.unit_texts import unit_of

CELL = re.compile(r"([+\u2212-]?[\d.,]+(?:[eE][+-]?\d+)?)\s*([^\W\d_]{1,4}|%|\u00b0C?)")


PREFIXES = {"": 0, "f": -15, "p": -12, "n": -9, "u": -6, "\u00b5": -6, "\u03bc": -6, "m": -3, "k": 3, "K": 3, "M": 6, "meg": 6, "Meg": 6,
            "MEG": 6, "G": 9, "T": 12}  # fmt: skip
"""Powers of ten of the letters that instruments and circuit simulators write behind numbers."""
ALSO_UNITS = {"m", "K", "G", "T"}
"""Metres, kelvins, gauss, teslas: where every cell ends in one of them it tells nothing. An f alone is the mark of C's floats."""
PREFIXED = re.compile(r"([+\u2212-]?(?:\d+\.?\d*|\.\d+))\s*([a-zA-Z\u00b5\u03bc]{0,3})")


def without_prefixes(
    columns: Sequence[np.ndarray], units: Mapping[int, str]
) -> tuple[list[np.ndarray], dict[int, tuple[str, ...]]]:
    """The columns (n,) with prefixes of SI behind their numbers written as powers of ten, and these prefixes by number of column.

    An `m` in every cell may be metres: it is a thousandth where the column has another unit in `units`.
    """
    found, prefixes = list(columns), dict[int, tuple[str, ...]]()
    for k, column in enumerate(columns):
        if column.dtype.kind != "O" or not any(isinstance(c, str) and c[-1:].isalpha() for c in column):
            continue
        cells = [c.strip() if isinstance(c, str) else "" for c in column]
        matches = [None if c.lower() in MISSING else PREFIXED.fullmatch(c) for c in cells]
        letters = {m[2] for m in matches if m}
        whole = all(m is not None or c.lower() in MISSING for m, c in zip(matches, cells, strict=True))
        other = k in units and unit_of(units[k]) not in (None, *letters)
        alone = letters <= {"", "f"} or (len(letters) == 1 and letters <= ALSO_UNITS and not other)
        if not whole or alone or not letters - {""} or not letters <= set(PREFIXES):
            continue
        found[k] = np.array([None if m is None else f"{m[1]}e{PREFIXES[m[2]]}" for m in matches], dtype=object)
        prefixes[k] = tuple(sorted(letters - {""}))
    return found, prefixes


def without_units(columns: Sequence[np.ndarray]) -> tuple[list[np.ndarray], dict[int, str]]:
    """The columns (n,) without the unit of their cells, and that unit by number of column. A column of several units stays as it is, and
    so does one in `m`, which may be metres or thousandths."""
    found, units = list(columns), dict[int, str]()
    for k, column in enumerate(columns):
        first = next((c for c in column if isinstance(c, str)), "") if column.dtype.kind == "O" else ""
        if not CELL.fullmatch(first):
            continue
        matches = [CELL.fullmatch(c) if isinstance(c, str) else None for c in column]
        empty = [c is None or str(c).lower() in MISSING for c in column]
        stated = {m[2] for m in matches if m}
        whole = all(m is not None or none for m, none in zip(matches, empty, strict=True))
        if not whole or len(stated) != 1 or stated == {"m"} or unit_of(unit := stated.pop()) is None:
            continue
        found[k] = np.array([None if m is None else m[1] for m in matches], dtype=object)
        units[k] = unit
    return found, units

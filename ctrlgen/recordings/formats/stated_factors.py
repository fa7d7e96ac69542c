"""Factors and offsets that stand above a table without a convention that says whether its numbers have them: asked, or told."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ctrlgen.recordings.formats.header_rows import FACTOR_LABELS, LONGEST_SHOWN
from ctrlgen.recordings.formats.number_cells import is_number
from ctrlgen.recordings.formats.text_blocks import Block
from ctrlgen.recordings.formats.text_cells import cells_of, is_comment, without_mark

KEYED = FACTOR_LABELS | {"scalefactor", "scale factor"}
"""The same as keys before every entry, as TwinCAT Scope writes them."""
SAID = re.compile(
    r"\b(?:scal(?:e|ing)|gain|factor|multiplier|offset|sensitivity|faktor|skalierung|verst\u00e4rkung|empfindlichkeit)\b[^\d]*[\d.]*\d"
    r"|\d\s*\S{0,3}/(?:V|count|digit|lsb|bit)\b",
    re.IGNORECASE,
)
"""A remark of a factor: Gain: 10 V/V; sensor: 10 um/V."""
SETTINGS = re.compile(
    r"vertical|horizontal|full|display|probe|/div|time|resolution|VOffset|HOffset|DataOffset", re.IGNORECASE
)
"""Words beside which it is a setting of an oscilloscope that its numbers have already."""
MOST_TOLD = 3  # remarks of factors


def factors_of_columns(lines: Sequence[str], block: Block, separator: str, decimal: str) -> dict[int, str]:
    """What lines above a table say of its columns by a factor other than 1, or an offset other than 0, by number of column."""
    found: dict[int, str] = {}
    for k in block.above:
        cells = cells_of(without_mark(lines[k]) if is_comment(lines[k]) else lines[k], separator)
        label = cells[0].strip("[]():").lower() if cells else ""
        keyed = label in KEYED and len(cells) == block.width and len(set(cells[::2])) == 1 and len(cells) > 2
        if not keyed and (label not in FACTOR_LABELS or len(cells) not in (block.width, block.width + 1)):
            continue
        for j, cell in enumerate(cells):
            if j == 0 or not is_number(cell) or _number(cell, decimal) in ((0.0,) if label == "offset" else (0.0, 1.0)):
                continue
            column = j - (len(cells) - block.width)
            found[column] = f"line {k + 1} says {cells[0].strip('[]():')} {cell} of it"
    return found


def _number(cell: str, decimal: str) -> float:
    try:
        return float(cell.replace(decimal, "."))
    except ValueError:
        return float("nan")


def factors_said(lines: Sequence[str], block: Block, separator: str) -> list[str]:
    """A note of each remark above a table that states a factor, which nothing applies."""
    told = []
    for k in block.above:
        text = lines[k].strip()
        cells = cells_of(text, separator)
        if SAID.search(text) and not SETTINGS.search(text) and len(cells) < max(block.width, 2):
            told.append(
                f"line {k + 1} ({text[:LONGEST_SHOWN]!r}) is not applied: should it be of a column, write its `scale`"
            )
    return told[:MOST_TOLD]

"""What stands above a table of a text file: the columns' names, their units, what a logger declares of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from ctrlgen.core.counts import number_of
from ctrlgen.recordings.formats.declared_header import declared_names, declared_time, paired
from ctrlgen.recordings.formats.header_rows import (
    NAME_LABELS,
    UNIT_LABELS,
    Header,
    names_and_units,
    of_factors,
    told_of,
    units_behind,
    with_units,
    without_labelled_numbers,
)
from ctrlgen.recordings.formats.layout_question import Ambiguous
from ctrlgen.recordings.formats.number_cells import is_number, is_reading
from ctrlgen.recordings.formats.text_blocks import Block
from ctrlgen.recordings.formats.text_cells import cells_of, is_comment, without_mark
from ctrlgen.recordings.formats.unit_texts import is_unit_row, unit_of
from ctrlgen.recordings.formats.written_layout import Layout

HEAD = 20  # rows of a table by which its columns of numbers are known
REMARKS = {"comment", "comments", "remark", "remarks", "note", "notes", ""}
ENTRY = re.compile(r"\w+\s*=\s*\S+")
"""A setting behind names: tInc = 1e-3."""
QUOTED = re.compile(r"^'([^']*)'$")
WORD_WITH_UNIT = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?")


def header_of(lines: Sequence[str], block: Block, separator: str, layout: Layout) -> Header:
    """The header of a table. Raises `Ambiguous` where its names are not as many as the columns."""
    if (declared := declared_names(lines, block, separator)) is not None:
        return declared
    sample_times = declared_time(lines, block)
    if _ends_empty(lines, block, separator):
        shorter = header_of(lines, replace(block, width=block.width - 1), separator, layout)
        return replace(shorter, names=(*shorter.names, ""))
    if layout.header == 0:
        return Header(("",) * block.width, sample_times=sample_times)
    candidates = [
        (k, cells)
        for k in reversed(block.above)
        if (cells := _fitting(lines[k], block.width, separator)) is not None and not _is_entry(cells)
    ]
    if layout.header is not None:
        return _stated(lines, block, separator, layout.header - 1)
    own = _rows_above(lines, block, separator, candidates)
    candidates = candidates[len(own) :]
    if pairs := paired(candidates):
        return replace(pairs, more_rows=own)
    plain = [(k, cells) for k, cells in candidates if not is_comment(lines[k])]
    plain, numbers = without_labelled_numbers(plain)
    nameless = plain and all(is_unit_row(cells) for _, cells in plain)  # and the names stand in a remark
    header = names_and_units(candidates if nameless else plain or candidates, _numeric(lines, block, separator))
    if not header.names:
        header = _numbered(lines, block, separator) or _short(lines, block, separator)
    notes = (*header.notes, *told_of(numbers, plain[0][0] if plain else 0))
    names = header.names or ("",) * block.width
    return Header(names, header.units, own, notes, sample_times, {}, header.in_first_row)


def _is_entry(cells: Sequence[str]) -> bool:
    """Whether cells are a key and what it says, as `Date:, 05 MAR 2024`, or what a program prints before a matrix, `data =`, or
    the formulas of Origin, `F(x)=`, and no names of columns."""
    label = cells[0].removesuffix(":").strip().lower()
    return (len(cells) > 1 and (cells[1] == "=" or cells[0].endswith("="))) or (
        len(cells) == 2
        and cells[0].endswith(":")
        and not cells[1].endswith(":")
        and label not in NAME_LABELS | UNIT_LABELS
    )


def _ends_empty(lines: Sequence[str], block: Block, separator: str) -> bool:
    """Whether rows end in a separator that the lines above them do not have."""
    if (
        separator == " "
        or block.width < 2
        or any(len(cells_of(lines[k], separator)) >= block.width for k in block.above)
    ):
        return False
    return not any(cell for k in block.rows[:HEAD] for cell in cells_of(lines[k], separator)[block.width - 1 :])


def _fitting(line: str, width: int, separator: str) -> list[str] | None:
    """The cells of a line above a table, as many as the table has columns; None for another line."""
    if line.startswith("@"):  # a setting of xmgrace
        return None
    text = without_mark(line) if is_comment(line) else line
    cells = [QUOTED.sub(r"\1", cell) for cell in cells_of(text, separator)]
    beyond = cells[width:]
    if beyond and (
        all(c.lower() in REMARKS or ENTRY.fullmatch(c) for c in beyond) or all(map(is_reading, cells[:width]))
    ):
        cells = cells[:width]
    if separator == " " and len(cells) == width + 1 and cells[0].lower() == "date":
        cells = [f"{cells[0]} {cells[1]}", *cells[2:]]
    if separator == " " and len(cells) != width:
        split = (
            re.split(r"\s{2,}|\t", text.strip()),
            WORD_WITH_UNIT.findall(text),
            [c.strip() for c in text.split(",")],
        )
        cells = next((c for c in split if len(c) == width), cells)
        if is_comment(line) and len(cells) == width and text.startswith("L "):  # the key of names in files of SPEC
            cells[0] = cells[0].removeprefix("L ").strip()
    return cells if len(cells) == width and any(cells) else None


def _numeric(lines: Sequence[str], block: Block, separator: str) -> list[int]:
    """The columns that hold a number near the table's head."""
    head = [cells_of(lines[k], separator) for k in block.rows[:HEAD]]
    return [i for i in range(block.width) if any(i < len(row) and is_number(row[i]) for row in head)]


def _rows_above(
    lines: Sequence[str], block: Block, separator: str, candidates: Sequence[tuple[int, list[str]]]
) -> tuple[int, ...]:
    """Lines above the table that are its first rows: readings in all its columns of numbers, or names stand above them."""
    numeric = _numeric(lines, block, separator)
    named = [not any(map(is_number, cells)) for _, cells in candidates]
    own: list[int] = []
    for n, (k, cells) in enumerate(candidates):
        if k != block.rows[0] - n - 1:  # other lines, or none, between it and the table
            break
        whole = (
            bool(numeric) and all(is_reading(cells[i]) for i in numeric) and any(is_number(cells[i]) for i in numeric)
        )
        spoilt = any(is_number(cells[i]) for i in numeric) and any(named[n + 1 :]) and not with_units(cells)
        if is_comment(lines[k]) or of_factors(cells) or not (whole or spoilt):
            break
        own.insert(0, k)
    return tuple(own)


def _stated(lines: Sequence[str], block: Block, separator: str, line: int) -> Header:
    """The header in the line that the reader names. Raises `Ambiguous` where it does not have as many cells as the table."""
    cells = _fitting(lines[line], block.width, separator) if line < len(lines) else None
    if cells is None:
        raise Ambiguous(
            f"line {line + 1}, said to hold the names, does not have {number_of(block.width, 'cell')}, as the rows of the table do"
        )
    below = [(k, c) for k in block.above if k > line and (c := _fitting(lines[k], block.width, separator)) is not None]
    units = next(({i: c for i, c in enumerate(cells) if unit_of(c)} for _, cells in below if is_unit_row(cells)), {})
    return Header(tuple(cells), units_behind(cells) | units)


def _numbered(lines: Sequence[str], block: Block, separator: str) -> Header | None:
    """Names that are numbers from 0 in the first row, as pandas writes them. Raises `Ambiguous` where that may be a row of readings."""
    cells = cells_of(lines[block.rows[0]], separator)
    counted = [str(k) for k in range(block.width)]
    if len(cells) > 1 and cells == ["", *counted[:-1]]:
        return Header(("row", *cells[1:]), notes=("line 1 holds names, which are numbers",), in_first_row=True)
    if len(cells) > 2 and cells == counted:
        what = f"line {block.rows[0] + 1} is {', '.join(cells)}: names of columns or a row of numbers?"
        raise Ambiguous(what, {f"header = {block.rows[0] + 1}": "for names", "header = 0": "for numbers"})
    return None


def _short(lines: Sequence[str], block: Block, separator: str) -> Header:
    """The header of a table whose last line above has one cell less: rows have a number of their own, as R writes them.

    Raises `Ambiguous` where that line looks like names and they have none.
    """
    line = block.above[-1] if block.above else -1
    if line < 0 or any(lines[k].strip() for k in range(line + 1, block.rows[0])):
        return Header(())
    cells = cells_of(without_mark(lines[line]), separator)
    head = [cells_of(lines[k], separator) for k in block.rows[:HEAD]]
    n = len(cells)
    if n < 2 or any(map(is_number, cells)):
        return Header(())
    counted = [[str(k) for k in range(first, first + len(head))] for first in (0, 1)]  # by pandas, by R
    if n == block.width - 1 and [row[0] for row in head] in counted:
        named = ["row", *cells]
        return Header(tuple(named), units_behind(named), notes=("the first column numbers the rows and has no name",))
    if is_comment(lines[line]) or separator == " ":  # a sentence has blanks, too
        return Header(())
    what = f"line {line + 1} has {number_of(n, 'name')}, and the rows below it have {number_of(block.width, 'cell')}"
    mend = "and name columns by their number from 0, or repair it; where a comma both separates and marks decimals, export with semicolons"
    raise Ambiguous(what, {"header = 0": mend})

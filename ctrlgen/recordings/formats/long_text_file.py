"""Text files of any length: a long table of plain rows is read piece by piece, so that memory holds its numbers and not its text.

What the file is (separator, names, units, style of its numbers) is known from its beginning, its end and pieces between, as of a short
file. Then every row is checked: it has as many cells as the others, and each is a number or a word for none. A file that is otherwise
is read whole, by `ctrlgen.recordings.formats.text_file`, which says what is wrong with it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import number_cells, text_file
from ctrlgen.recordings.formats.checked_files import LARGEST
from ctrlgen.recordings.formats.common_factor import factor_lines
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.named_lines import are_named
from ctrlgen.recordings.formats.text_blocks import Block
from ctrlgen.recordings.formats.text_cells import separator_of
from ctrlgen.recordings.formats.text_encoding import decoded_bytes
from ctrlgen.recordings.formats.unapplied import unapplied_columns
from ctrlgen.recordings.formats.written_layout import Layout

LONG = 8 << 20
"""Bytes from which a file is read piece by piece: below it the text of the whole takes little memory."""
HEAD, TAIL, SAMPLE, SAMPLES = 128_000, 64_000, 4_000, 50
"""Bytes of the beginning, the end, and of so many pieces between, by which a file is known."""
PIECE = 8 << 20
"""Bytes that are read at once."""
CELL_BREAKS = np.isin(np.arange(256), [9, 10, 13, 32])  # blanks, tabs and ends of lines
FOREIGN = re.compile(rb'["\0]|^[ \t]*[#%!/]', re.MULTILINE)
"""Quotes, and remarks among rows: such a file is read whole."""


class _Otherwise(Exception):
    """The file is not rows of one table to its end."""


@dataclass(frozen=True)
class _Plan:
    """A table as known from parts of its file: `table` of those parts, `separator`, and the bytes from `begin` to `end` of its rows."""

    table: MeasurementTable
    separator: str
    begin: int
    end: int


def read(path: Path, layout: Layout) -> dict[str, MeasurementTable]:
    """The tables of a text file, by the lines that they stand in. Raises InputError."""
    if LONG <= path.stat().st_size <= LARGEST:
        try:
            table = _long_table(path, layout)
            return {f"from line {table.lines[0]}, {len(table.lines)} rows": table}
        except _Otherwise:
            pass
    return text_file.read(path, layout)


def _long_table(path: Path, layout: Layout) -> MeasurementTable:
    with path.open("rb") as file:
        plan = _plan(path, file, layout)
        parts: list[list[np.ndarray]] = [[] for _ in plan.table.columns]
        words: list[dict[str, list[int]]] = [{} for _ in plan.table.columns]
        rows = 0
        for piece in _pieces(file, plan.begin, plan.end):
            for k, (column, found) in enumerate(_columns(piece, plan)):
                parts[k].append(column)
                for word, places in found.items():
                    words[k].setdefault(word, []).extend(rows + place for place in places)
            rows += len(parts[0][-1])
    columns = {}
    for name, pieces in zip(plan.table.columns, parts, strict=True):
        columns[name] = np.concatenate(pieces)
        pieces.clear()
    return whole_table(plan.table, columns, words, rows)


def whole_table(
    known: MeasurementTable, columns: dict[str, np.ndarray], words: list[dict[str, list[int]]], rows: int
) -> MeasurementTable:
    """The table of all rows, with notes that count their lines."""
    first, last, more = known.lines[0], known.lines[-1], rows - len(known.lines)
    of_parts = unapplied_columns(list(known.columns), list(known.columns.values()))
    notes = [
        re.sub(r"\bline (\d+)", lambda m: f"line {int(m[1]) + (more if int(m[1]) > last else 0)}", note)
        for note in known.notes
        if note not in of_parts
    ]
    notes += unapplied_columns(list(columns), list(columns.values()))
    for name, found in zip(columns, words, strict=True):
        for word, places in found.items():
            count = number_of(len(places), "reading is", "readings are")
            notes.append(f"{name}: {count} {word!r} (first in line {first + places[0]}), taken as missing")
    return replace(known, columns=columns, lines=range(first, first + rows), notes=tuple(notes))


def _plan(path: Path, file: BinaryIO, layout: Layout) -> _Plan:
    """What the table of a file is, by parts of it. Raises `_Otherwise`."""
    size = file.seek(0, 2)
    head = _lines_of(file, 0, HEAD, whole_start=True)
    tail_at = size - TAIL
    tail = _lines_of(file, tail_at, TAIL, whole_end=True)
    between = [
        _lines_of(file, at, SAMPLE) for at in np.linspace(len(head), tail_at - SAMPLE, SAMPLES).astype(int).tolist()
    ]
    content = head + b"".join(between) + tail
    if content.count(b"\r") != content.count(b"\r\n"):
        raise _Otherwise
    try:
        text, notes = decoded_bytes(path, content, layout.encoding)
        if any(note.startswith("encoding") for note in notes):  # two bytes a character
            raise _Otherwise
        if are_named(text.split("\n")):
            raise _Otherwise
        tables = text_file.tables_of_text(path, text, layout, notes)
    except InputError:
        raise _Otherwise from None
    lines = text.split("\n")
    table = tables[0]
    if factor_lines(lines):  # it would have to multiply every piece
        raise _Otherwise
    if len(tables) > 1 or not len(table.lines) or table.aliases or len(table.columns) < 2:
        raise _Otherwise
    first, last = table.lines[0], table.lines[-1]
    begin = _after_lines(head, first - 1)
    left_out = len(lines) - last
    if begin is None or list(table.lines) != list(range(first, last + 1)) or left_out > tail.count(b"\n"):
        raise _Otherwise
    end = len(tail)
    for _ in range(left_out):
        end = tail.rindex(b"\n", 0, end)
    return _Plan(table, separator_of(lines, layout), begin, size - len(tail) + end)


def _lines_of(file: BinaryIO, at: int, size: int, whole_start: bool = False, whole_end: bool = False) -> bytes:
    """The whole lines among so many bytes from `at` on. Raises `_Otherwise` where there is none."""
    file.seek(at)
    content = file.read(size)
    begin = 0 if whole_start else content.find(b"\n") + 1
    end = len(content) if whole_end else content.rfind(b"\n") + 1
    if end <= begin or (not whole_start and begin == 0):
        raise _Otherwise
    return content[begin:end]


def _after_lines(content: bytes, count: int) -> int | None:
    """The place behind so many lines; None where there are fewer."""
    at = 0
    for _ in range(count):
        at = content.find(b"\n", at) + 1
        if at == 0:
            return None
    return at


def _pieces(file: BinaryIO, begin: int, end: int) -> Iterator[bytes]:
    """The bytes of rows in pieces of whole lines."""
    file.seek(begin)
    rest = b""
    while begin < end:
        content = file.read(min(PIECE, end - begin))
        if not content:
            raise _Otherwise
        begin += len(content)
        content = rest + content
        cut = len(content) if begin == end else content.rfind(b"\n") + 1
        rest = content[cut:]
        if cut:
            yield content[:cut].rstrip(b"\r\n") + b"\n"


def _columns(piece: bytes, plan: _Plan) -> Iterator[tuple[np.ndarray, dict[str, list[int]]]]:
    """The columns of a piece, each with the rows of its words for none. Raises `_Otherwise` for rows that are not those of the table."""
    width = len(plan.table.columns)
    if FOREIGN.search(piece) or not _all_as_wide(piece, plan.separator, width):
        raise _Otherwise
    known = list(plan.table.columns.values())
    if plan.separator == " " and known[0].dtype.kind == "O":  # a date and a time of day with a blank between
        raise _Otherwise
    try:
        text = piece.decode("utf-8").replace("\r\n", "\n")
        block = Block((), width, width, ())
        columns = text_file.columns_of(text, block, plan.separator, plan.table.style, dated=False)
    except ValueError:
        raise _Otherwise from None
    for column, before in zip(columns, known, strict=True):
        yield _read(column, before, plan.table)


def _read(column: np.ndarray, before: np.ndarray, table: MeasurementTable) -> tuple[np.ndarray, dict[str, list[int]]]:
    """A column as numbers, or as the texts that it holds in all the file, such as time stamps."""
    if column.dtype.kind != "O":
        if before.dtype.kind == "O" and not _are_numbers(before, table):
            raise _Otherwise
        return column, {}
    if before.dtype.kind == "O" and not _are_numbers(before, table):
        return column, {}
    cells = number_cells.to_numbers(column, table.style, table.missing or ())
    if cells.bad or cells.truths:
        raise _Otherwise
    return cells.values, cells.words


def _are_numbers(column: np.ndarray, table: MeasurementTable) -> bool:
    return not number_cells.to_numbers(column, table.style, table.missing or ()).bad


def _all_as_wide(piece: bytes, separator: str, width: int) -> bool:
    """Whether every line has so many cells."""
    codes: np.ndarray[Any, Any] = np.frombuffer(piece, np.uint8)
    ends = np.flatnonzero(codes == 10)
    if separator == " ":
        inside = ~CELL_BREAKS[codes]
        begins = inside.copy()
        begins[1:] &= ~inside[:-1]
        before: np.ndarray[Any, Any] = np.cumsum(begins, dtype=np.int32)[ends]
    else:
        before = np.cumsum(codes == ord(separator), dtype=np.int32)[ends] + 1 + np.arange(len(ends), dtype=np.int32)
    return bool(np.all(np.diff(before, prepend=np.int32(0)) == width))

"""Tables of text files: comma-separated and all that is called so."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.recordings.formats import number_cells
from ctrlgen.recordings.formats.checked_files import fault
from ctrlgen.recordings.formats.common_factor import factor_lines, factor_of, multiplied
from ctrlgen.recordings.formats.foreign_text import foreign
from ctrlgen.recordings.formats.header_rows import LONGEST_SHOWN
from ctrlgen.recordings.formats.layout_question import Ambiguous, AmbiguousFile
from ctrlgen.recordings.formats.measurement_table import Clock, MeasurementTable
from ctrlgen.recordings.formats.named_lines import named_table
from ctrlgen.recordings.formats.number_cells import TIME, NumberStyle
from ctrlgen.recordings.formats.odd_writing import odd_number
from ctrlgen.recordings.formats.pages import joined
from ctrlgen.recordings.formats.rows_of_signals import lies_on_its_side, on_its_side
from ctrlgen.recordings.formats.run_together import parted
from ctrlgen.recordings.formats.stated_factors import factors_of_columns, factors_said
from ctrlgen.recordings.formats.stated_rate import stated_rate
from ctrlgen.recordings.formats.text_blocks import MOST_LISTED, Block, blocks_of, kind_of
from ctrlgen.recordings.formats.text_cells import cells_of, is_comment, separator_of, stray_quotes, whole_lines
from ctrlgen.recordings.formats.text_encoding import decoded
from ctrlgen.recordings.formats.text_header import header_of
from ctrlgen.recordings.formats.unapplied import unapplied_columns
from ctrlgen.recordings.formats.unit_columns import units_beside
from ctrlgen.recordings.formats.units_in_cells import without_prefixes, without_units
from ctrlgen.recordings.formats.unpadded_fractions import unpadded
from ctrlgen.recordings.formats.written_layout import Layout

STYLED = 1000  # rows, the first and others evenly over the table, by which the style of its numbers is known
TIMES = {"time", "t", "zeit", "timestamp", "x_value"}  # words of names of columns of time, in small letters
NAMED = re.compile(r"\s*[A-Za-z_]\w*\s*[:=]\s*[+-]?[\d.]+([eE][+-]?\d+)?[,;\s]+[A-Za-z_]\w*\s*[:=]\s*[+-]?[\d.]+")
NAMES = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blanks"}
EMPTY = sorted(
    {spelling for word in number_cells.MISSING for spelling in (word, word.upper(), word.capitalize(), "NaN", "NaT")}
)


def read_text_tables(path: Path, layout: Layout) -> list[MeasurementTable]:
    """The tables of a text file.

    A table is a run of rows of readings under a header; where other text stands around it, its names are the last line above of as many
    cells, or that above a row of units. Raises InputError that says which line, or which key of recording.toml answers what is open.
    """
    text, notes = decoded(path, layout.encoding)
    return tables_of_text(path, text, layout, notes)


def tables_of_text(path: Path, text: str, layout: Layout, notes: Sequence[str] = ()) -> list[MeasurementTable]:
    """The tables of a text whose lines end with a line feed; `notes` of what was interpreted before. Raises InputError."""
    lines = text.split("\n")
    if (told := foreign(lines)) and not layout.header:
        raise fault(path, told)
    if (of_names := named_table(path, lines, notes, layout)) is not None:
        return [of_names]
    lines = whole_lines(lines)
    factors = factor_lines(lines)
    lines = ["" if k in factors else line for k, line in enumerate(lines)]
    if stray := stray_quotes(lines):
        listed = ", ".join(f"line {k}" for k in stray[:MOST_LISTED]) + (", ..." if len(stray) > MOST_LISTED else "")
        raise fault(
            path,
            f"has a quote that is opened and not closed in {listed}; repair it, or the rows after it would be lost",
        )
    if not any(line.strip() for line in lines):
        raise fault(path, "has no rows; write a header and one row per sample")
    try:
        lines, run = parted(lines, layout)
        separator = separator_of(lines, layout)
        blocks = _blocks(lines, separator, layout)
        if not blocks:
            rows = [k for k, line in enumerate(lines, 1) if kind_of(line, separator) == "row"]
            if len(rows) == 1 and len(cells_of(lines[rows[0] - 1], separator)) > 1:
                raise fault(path, f"holds a single row of numbers, line {rows[0]}; is the file complete? Record longer")
            filled = [line for line in lines if line.strip() and not is_comment(line)]
            if len(filled) == 1 and len(cells_of(filled[0], separator)) > 1:
                raise fault(
                    path,
                    f"holds names of columns, {filled[0].strip()[:LONGEST_SHOWN]!r}, and no rows; is the file complete?",
                )
            if named := next((line for line in lines if NAMED.match(line)), None):
                what = f"writes names beside the numbers of its rows, such as {named.strip()[:LONGEST_SHOWN]!r}"
                raise fault(path, f"{what}; write the names once, above the columns, and rows of numbers alone")
            what = f"holds no rows of numbers (cells separated by {NAMES.get(separator, repr(separator))})"
            raise Ambiguous(what, {'separator = ";"': "(for one) with its separator, or export the numbers as text"})
        scaled = [factor_of(lines, factors, block, separator) for block in blocks]
        tables = [
            _table(path, lines, block, separator, layout, (*notes, *run), *by)
            for block, by in zip(blocks, scaled, strict=True)
        ]
        return joined(tables)
    except Ambiguous as error:
        raise AmbiguousFile(path, error) from None


def _blocks(lines: list[str], separator: str, layout: Layout) -> list[Block]:
    """The tables of a file, or that under the line that the reader names as its header."""
    if not layout.header:
        return blocks_of(lines, separator)
    below = blocks_of([""] * layout.header + lines[layout.header :], separator)
    return below[:1]


def _table(
    path: Path,
    lines: list[str],
    block: Block,
    separator: str,
    layout: Layout,
    said: Sequence[str],
    factor_line: int,
    factor: float,
) -> MeasurementTable:
    header = header_of(lines, block, separator, layout)
    rows = [*header.more_rows, *block.rows][header.in_first_row :]
    begun = rows[:1] if _are_dates(cells_of(lines[rows[0]], separator), cells_of(lines[rows[-1]], separator)) else []
    rows = rows[len(begun) :]
    sample = [cells_of(lines[k], separator) for k in rows[: STYLED // 10] + rows[:: max(1, len(rows) // STYLED)]]
    cells = [[row[i] for row in sample if i < len(row)] for i in range(block.width)]
    style, notes = number_cells.style_of(cells, layout, separator)
    for k, told in enumerate(map(unpadded, cells)):
        if told:
            raise fault(path, f"column {header.names[k] or k!r} {told}")
    dated = " " in cells[0][0] and not lines[rows[0]].lstrip().startswith('"')
    columns = columns_of("\n".join(lines[k] for k in rows), block, separator, style, dated)
    columns, multiplication = multiplied(columns, factor_line, factor)
    notes += multiplication
    if not any(header.names) and lies_on_its_side(columns):
        return on_its_side(path, columns, (*said, *header.notes, *notes), layout, style)
    names, units = list(header.names), dict(header.units)
    columns, prefixes = without_prefixes(columns, units)
    columns, of_cells = without_units(columns)
    units |= of_cells
    texts = {k: column.tolist() for k, column in enumerate(columns) if column.dtype.kind == "O"}
    beside = units_beside(names, texts, set(range(len(columns))) - set(units))
    units |= {k: next(cell for cell in texts[j] if cell) for k, j in beside.items()}
    unique = _unique(names)
    doubtful = {
        unique[k]: number
        for k, column in enumerate(columns)
        if layout.missing is None
        and k not in prefixes
        and (number := odd_number(column, cells[k], _Cells(lines, rows, separator, k))) is not None
    }
    cut = [f"line {block.cut + 1}, the last, ends before its last cell does; left out"] if block.cut is not None else []
    cut += [f"line {k + 1} holds the dates at which columns of numbers begin; left out" for k in begun]
    cut += _between(lines, rows)
    cut += [f"line {k + 1}, below the table, is no row of it; left out" for k in block.below]
    times = header.times or _times_of(names, columns)
    own = {} if len({names[k] for k in times.values()}) < 2 or header.sample_times else _differing(times, columns)
    times = {} if own else times
    clocks = _clocks(times, columns, header.sample_times)
    return MeasurementTable(
        path,
        dict(zip(unique, columns, strict=True)),
        {unique[k]: unit for k, unit in units.items()},
        _Lines(rows),
        (
            *said,
            *header.notes,
            *factors_said(lines, block, separator),
            *notes,
            *(f"{unique[k]}: its cells end in {unit}, its unit" for k, unit in of_cells.items()),
            *(f"{unique[k]}: its cells end in {', '.join(p)}, read as prefixes of SI" for k, p in prefixes.items()),
            *(f"{unique[k]}: {unique[j]} says {units[k]} in every row, its unit" for k, j in beside.items()),
            *unapplied_columns(unique, columns),
            *cut,
        ),
        nameless=frozenset(k for k, name in enumerate(names) if not name),
        aliases={names[0]: unique[0]} if times and not clocks else {},  # one time under several names
        clocks={unique[k]: clock for k, clock in clocks.items()},
        own_times={unique[k]: unique[time] for k, time in own.items()},
        style=style,
        missing=layout.missing,
        doubtful=doubtful,
        factors={unique[k]: said for k, said in factors_of_columns(lines, block, separator, style.decimal).items()},
        stated_rate=stated_rate([*(lines[k] for k in block.above), *_entries(lines, block, separator)], style.decimal),
    )


def _are_dates(first: Sequence[str], last: Sequence[str]) -> bool:
    """Whether a first row holds one date in every column, and the last one numbers: when each channel began, as DIAdem writes it."""
    alike = len(set(first)) == 1 < len(first) and re.match(number_cells.DATE, first[0], re.ASCII) is not None
    return alike and bool(TIME.fullmatch(first[0])) and all(map(number_cells.is_number, filter(None, last)))


def _entries(lines: Sequence[str], block: Block, separator: str) -> list[str]:
    """What two lines above a table say one below the other, as `Increment = 1e-3`."""
    rows = [cells_of(lines[k], separator) for k in block.above]
    return [
        f"{name} = {number}"
        for names, numbers in pairwise(rows)
        if len(names) == len(numbers)
        for name, number in zip(names, numbers, strict=True)
        if number_cells.is_number(number) and not number_cells.is_number(name)
    ]


def _between(lines: Sequence[str], rows: Sequence[int]) -> list[str]:
    """Notes of remarks and of empty lines between rows, behind which the table goes on as if nothing had been there."""
    steps = [(a, b) for a, b in pairwise(rows) if b - a > 1]
    if len(steps) > len(rows) // 2:  # a program that writes two ends of every line
        return []
    said = []
    for a, b in steps[:MOST_LISTED]:
        remark = next((lines[k].strip() for k in range(a + 1, b) if lines[k].strip()), "")
        what = (
            f"{remark[:LONGEST_SHOWN]!r} stands"
            if remark
            else f"{number_of(b - a - 1, 'empty line')} stand{'s' * (b == a + 2)}"
        )
        said.append(
            f"{what} between rows, after line {a + 1}: read as one table; where another run begins, say so by `rows`"
        )
    more = len(steps) - MOST_LISTED
    return said + ([f"so do {number_of(more, 'other line')} further on"] if more > 0 else [])


def _times_of(names: Sequence[str], columns: Sequence[np.ndarray]) -> dict[int, int]:
    """The column of time of each column where every second one is a time; empty for other tables."""
    every = names[::2]
    paired = len(names) > 2 and len(names) % 2 == 0 and all(map(_names_a_time, every))
    if not paired or not all(_rises(columns[k]) for k in range(0, len(names), 2)):
        return {}
    return {k + 1: k for k in range(0, len(names), 2)}


def _names_a_time(name: str) -> bool:
    return name.lower() == "x" or bool(TIMES & set(re.split(r"[^a-z_]+|_(?!value)", name.lower())))


def _rises(column: np.ndarray) -> bool:
    """Whether numbers rise from row to row as far as they go; texts may be dates."""
    if column.dtype.kind == "O":
        return all(cell is None or TIME.fullmatch(cell) for cell in column[:STYLED])
    known = column[np.isfinite(column.astype(float))]
    return len(known) > 1 and bool(np.all(np.diff(known) > 0))


def _differing(times: dict[int, int], columns: Sequence[np.ndarray]) -> dict[int, int]:
    """The column of time of each column, itself for those, where they differ; empty where they are the same."""
    first = columns[min(times.values())]
    if all(np.array_equal(first, columns[k]) for k in times.values()):
        return {}
    return times | {k: k for k in times.values()}


def _clocks(times: dict[int, int], columns: list[np.ndarray], sample_times: dict[int, float]) -> dict[int, Clock]:
    """The clock of each column: of the sample time [s] that the header states, from where its own column of time begins.

    Raises `Ambiguous` where columns have different times and the header does not state their sample time.
    """
    alike = all(np.array_equal(columns[k], columns[next(iter(times.values()))]) for k in times.values())
    if times and alike:
        return {}
    if any(column not in sample_times for column in times):
        what = "holds channels that each have a time of their own, and these differ"
        raise Ambiguous(f"{what}; export them at one rate, or each to its own file, named by `file` of its column")
    clocks = {}
    for k, step in sample_times.items():
        own = np.asarray(columns[times[k]], dtype=float) if k in times else np.arange(2.0)
        own = own[np.isfinite(own)]
        clocks[k] = Clock(float(step * own[0] / (own[1] - own[0])) if len(own) > 1 and own[1] > own[0] else 0.0, step)
    return clocks


class _Cells:
    """The cells of one column as they are written, by row."""

    def __init__(self, lines: Sequence[str], rows: Sequence[int], separator: str, column: int) -> None:
        self.lines, self.rows, self.separator, self.column = lines, rows, separator, column

    def __call__(self, row: int) -> str:
        return cells_of(self.lines[self.rows[row]], self.separator)[self.column]


class _Lines(Sequence[int]):
    """Numbers from 1 of the lines of rows."""

    def __init__(self, rows: Sequence[int]) -> None:
        self.rows = rows

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, k: Any) -> Any:
        return self.rows[k] + 1


def columns_of(body: str, block: Block, separator: str, style: NumberStyle, dated: bool) -> list[np.ndarray]:
    """The cells of the rows of a table by column: numbers where all of a column are plain ones, else texts, None where one is empty.

    `dated`: the first cell of rows that blanks separate is a date and a time of day.
    """
    import pandas  # takes half a second to import

    two = separator == " " and dated
    stated: dict[str, Any] = {"dtype": str} if style.decimal == separator else {"decimal": style.decimal}
    frame = pandas.read_csv(
        io.StringIO(body),
        sep=r"\s+" if separator == " " else separator,
        header=None,
        names=list(range(block.widest + 1)),
        index_col=False,
        skipinitialspace=True,
        keep_default_na=False,
        na_values=EMPTY,
        low_memory=False,
        skip_blank_lines=False,
        **stated,
    )
    columns = []
    for k in range(block.width + two):
        column = frame[k]
        numeric = column.dtype.kind in "iuf"
        columns.append(
            column.to_numpy()
            if numeric
            else np.array([None if pandas.isna(c) else str(c) for c in column], dtype=object)
        )
    return _with_dates_joined(columns) if two else columns


def _with_dates_joined(columns: list[np.ndarray]) -> list[np.ndarray]:
    """The columns with the first two, a date and a time of day, as one."""
    joined = np.array(
        [f"{day} {time}" if day and time else None for day, time in zip(columns[0], columns[1], strict=True)],
        dtype=object,
    )
    return [joined, *columns[2:]]


def _unique(names: Sequence[str]) -> list[str]:
    """Names under which columns are found: those that have none by their number from 0, those that repeat with it."""
    filled = [name for name in names if name]
    shown = [name if filled.count(name) < 2 else f"{name} (column {k})" for k, name in enumerate(names)]
    taken = set(shown)
    if not filled:
        return [str(k) for k in range(len(names))]
    return [
        name or (f"column {k}" if f"column {k}" not in taken else f"column {k} without a name")
        for k, name in enumerate(shown)
    ]


def read(path: Path, layout: Layout) -> dict[str, MeasurementTable]:
    """The tables of a text file, by the lines that they stand in."""
    tables = read_text_tables(path, layout)
    return {
        f"from line {t.lines[0]}, {number_of(len(t.lines), 'row')}" if t.lines else "on its side": t for t in tables
    }

"""What stands above a table of a text file: the columns' names, their units, what a logger declares of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from ctrlgen.core.counts import number_of
from ctrlgen.recordings.formats.layout_question import Ambiguous
from ctrlgen.recordings.formats.number_cells import is_number, is_reading
from ctrlgen.recordings.formats.text_blocks import Block
from ctrlgen.recordings.formats.text_cells import cells_of, is_comment, without_mark
from ctrlgen.recordings.formats.unit_texts import is_unit_cell, is_unit_row, split_name, unit_of
from ctrlgen.recordings.formats.written_layout import Layout

HEAD = 20  # rows of a table by which its columns of numbers are known
REMARKS = {"comment", "comments", "remark", "remarks", "note", "notes", ""}
NAME_LABELS = {"name", "names", "trace name", "channel name", "signal name"}
FACTOR_LABELS = {
    "factor",
    "faktor",
    "scale",
    "scaling",
    "gain",
    "slope",
    "multiplier",
    "offset",
    "skalierung",
    "verst\u00e4rkung",
}
UNIT_LABELS = {"unit", "units", "einheit", "einheiten", "vunit"}
DECLARED_NAME = re.compile(r"^\s*#\s*NAME(\d+)\s*=\s*(.+?)\s*$")  # GCS arrays of Physik Instrumente
DECLARED_TIME = re.compile(r"^\s*#\s*SAMPLE_TIME\s*=\s*([\d.eE+-]+)\s*$")
DATES = re.compile("time|date|zeit|datum", re.IGNORECASE)
WORD_WITH_UNIT = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?")
LONGEST_SHOWN = 60  # characters of a line that a note shows
PAIRED = 2  # header rows in which every second cell repeats a key, as TwinCAT Scope writes them


@dataclass(frozen=True)
class Header:
    """Names of a table's columns, '' for one without; units by number of column; rows above the block that belong to it; the declared
    sample time [s] of each column, and its column of time where it has one of its own; whether the block's first row holds the names."""

    names: tuple[str, ...]
    units: dict[int, str] = field(default_factory=dict)
    more_rows: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()
    sample_times: dict[int, float] = field(default_factory=dict)
    times: dict[int, int] = field(default_factory=dict)
    in_first_row: bool = False


def header_of(lines: Sequence[str], block: Block, separator: str, layout: Layout) -> Header:
    """The header of a table. Raises `Ambiguous` where its names are not as many as the columns."""
    step = next((float(m[1]) for k in block.above if (m := DECLARED_TIME.match(lines[k]))), None)
    sample_times = {} if step is None else dict.fromkeys(range(block.width), step)
    declared = {int(m[1]): m[2] for k in block.above if (m := DECLARED_NAME.match(lines[k]))}
    if len(declared) == block.width:
        names = tuple(declared[k] for k in sorted(declared))
        return Header(
            names, _units_behind(names), notes=("names are those that the header declares",), sample_times=sample_times
        )
    if _ends_empty(lines, block, separator):
        shorter = header_of(lines, replace(block, width=block.width - 1), separator, layout)
        return replace(shorter, names=(*shorter.names, ""))
    if layout.header == 0:
        return Header(("",) * block.width, sample_times=sample_times)
    candidates = [
        (k, cells) for k in reversed(block.above) if (cells := _fitting(lines[k], block.width, separator)) is not None
    ]
    if layout.header is not None:
        return _stated(lines, block, separator, layout.header - 1)
    own = _rows_above(lines, block, separator, candidates)
    candidates = candidates[len(own) :]
    if pairs := _paired(candidates):
        return replace(pairs, more_rows=own)
    plain = [(k, cells) for k, cells in candidates if not is_comment(lines[k])]
    header = _names_and_units(plain or candidates)
    if not header.names:
        header = _numbered(lines, block, separator) or _short(lines, block, separator)
    notes = header.notes
    names = header.names or ("",) * block.width
    return Header(names, header.units, own, notes, sample_times, {}, header.in_first_row)


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
    text = without_mark(line) if is_comment(line) else line
    cells = cells_of(text, separator)
    if len(cells) > width and (all(c.lower() in REMARKS for c in cells[width:]) or all(map(is_reading, cells[:width]))):
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


def _rows_above(
    lines: Sequence[str], block: Block, separator: str, candidates: Sequence[tuple[int, list[str]]]
) -> tuple[int, ...]:
    """Lines above the table that are its first rows: readings in all its columns of numbers, or names stand above them."""
    head = [cells_of(lines[k], separator) for k in block.rows[:HEAD]]
    numeric = [i for i in range(block.width) if any(i < len(row) and is_number(row[i]) for row in head)]
    named = [not any(map(is_number, cells)) for _, cells in candidates]
    own: list[int] = []
    for n, (k, cells) in enumerate(candidates):
        if k != block.rows[0] - n - 1:  # other lines, or none, between it and the table
            break
        whole = (
            bool(numeric) and all(is_reading(cells[i]) for i in numeric) and any(is_number(cells[i]) for i in numeric)
        )
        spoilt = any(is_number(cells[i]) for i in numeric) and any(named[n + 1 :]) and not _with_units(cells)
        if is_comment(lines[k]) or _of_factors(cells) or not (whole or spoilt):
            break
        own.insert(0, k)
    return tuple(own)


def _of_factors(cells: Sequence[str]) -> bool:
    """Whether a row says in its first cell that it scales the columns."""
    return cells[0].strip("[]():").lower() in FACTOR_LABELS and any(map(is_number, cells[1:]))


def _with_units(cells: Sequence[str]) -> bool:
    """Whether all that is no number in a row is a unit: one of units with some numbers of the logger beside them."""
    texts = [c for c in cells if c and not is_number(c)]
    return bool(texts) and all(is_unit_cell(c) or unit_of(c) for c in texts)


def _names_and_units(candidates: Sequence[tuple[int, list[str]]]) -> Header:
    """Names and units of rows above a table, nearest first."""
    if not candidates:
        return Header(())
    labels = {cells[0].rstrip(":").lower(): n for n, (_, cells) in reversed(list(enumerate(candidates)))}
    at = next((labels[word] for word in UNIT_LABELS if word in labels), None)
    names_at = next((labels[word] for word in NAME_LABELS if word in labels and at is not None), None)
    if at is None:
        at = next(
            (n for n in range(min(2, len(candidates) - 1)) if _is_units(candidates[n][1], candidates[n + 1][1])), None
        )
    if at is None and not any(map(is_number, candidates[0][1])):  # units above the names
        at = next((n for n in range(1, min(4, len(candidates))) if is_unit_row(candidates[n][1])), None)
        names_at = names_at if at is None else 0
    names_at = names_at if names_at is not None else 0 if at is None else min(at + 1, len(candidates) - 1)
    above = candidates[names_at + 1][1] if names_at + 1 < len(candidates) and names_at + 1 != at else []
    if at is not None and _tells_more(above, candidates[names_at][1]):
        names_at, above = names_at + 1, []
    line, names = candidates[names_at]
    notes = [f"names in line {line + 1}"] if line else []
    if not all(names) and _is_text(above) and all(a or n for a, n in zip(above, names, strict=True)):
        notes.append(f"columns without a name there are named by line {candidates[names_at + 1][0] + 1}")
        names = [name or other for name, other in zip(names, above, strict=True)]
        above = []
    if any(map(is_number, names)):
        notes = [f"line {line + 1} ({', '.join(names)}) is taken as the columns' names"]
    units = _units_behind(names)
    if at is not None and at != names_at:
        notes.append(f"line {candidates[at][0] + 1} holds units")
        units |= {
            k: c.strip("[](){} ") for k, c in enumerate(candidates[at][1]) if c and not is_number(c) and unit_of(c)
        }
    passed = [(k + 1, c) for n, (k, c) in enumerate(candidates[: max(names_at, at or 0)]) if n not in (names_at, at)]
    notes += [
        f"line {k} ({_shown(cells)}) is not applied: write its factors as `scale` of the columns"
        if _of_factors(cells)
        else f"line {k} ({_shown(cells)}) holds neither names nor units"
        for k, cells in passed
    ]
    found = _grouped(names, above)
    if found == names and at is not None and _is_text(above):
        notes.append(f"above them stands {', '.join(filter(None, above))}")
        found = [name or other for name, other in zip(names, above, strict=True)]
        found = found if len(set(found)) == len(found) else names
    return Header(tuple(found), units, notes=tuple(notes))


def _shown(cells: Sequence[str]) -> str:
    """Cells as a note shows them."""
    shown = ", ".join(filter(None, cells))
    return shown if len(shown) <= LONGEST_SHOWN else f"{shown[:LONGEST_SHOWN]}..."


def _is_text(cells: Sequence[str]) -> bool:
    return any(cells) and not any(map(is_number, cells))


def _tells_more(above: Sequence[str], names: Sequence[str]) -> bool:
    """Whether a row names every column by a text of its own, and the row below it, such as one of types, does not."""
    return (
        _is_text(above)
        and all(above)
        and len(set(above)) == len(above)
        and len({n for n in names if n}) < sum(map(bool, names))
    )


def _is_units(cells: list[str], above: list[str]) -> bool:
    """Whether a row under one of names states units."""
    texts = [c for c in cells if not is_number(c)]
    dated = {
        k for k, c in enumerate(cells) if DATES.fullmatch(c) and DATES.search(above[k])
    }  # the word stands for a unit
    rest = [c for k, c in enumerate(cells) if k not in dated and not is_number(c)]
    units = is_unit_row(rest if len(rest) > len(dated) else texts)
    return units and not is_unit_row(above) and not all(is_number(c) for c in above if c)


def _grouped(names: list[str], above: list[str]) -> list[str]:
    """Names that repeat, with the group that stands above them where that tells them apart."""
    filled = [n for n in names if n]
    if len(set(filled)) == len(filled) or not above or all(map(is_number, above)):
        return names
    groups, group = [], ""
    for cell in above:
        group = cell or group
        groups.append(group)
    whole = [f"{group}.{name}" if name and group else name for group, name in zip(groups, names, strict=True)]
    return whole if len({n for n in whole if n}) == len(filled) else names


def _units_behind(names: Sequence[str]) -> dict[int, str]:
    return {k: unit for k, name in enumerate(names) if (unit := split_name(name)[1]) is not None}


def _paired(candidates: Sequence[tuple[int, list[str]]]) -> Header | None:
    """The header of a file in which each channel has a time and a value, with a key before every entry, as TwinCAT Scope exports."""
    rows: dict[str, list[str]] = {}
    for _, cells in candidates:
        if len(cells) % 2 == 0 and cells[0] and len(set(cells[::2])) == 1:
            rows[cells[0]] = cells[1::2]
    if len(rows) < PAIRED or "Name" not in rows:
        return None
    names = tuple(text for name in rows["Name"] for text in (f"time of {name}", name))
    units = {2 * k + 1: unit for k, unit in enumerate(rows.get("Unit", ())) if unit_of(unit)}
    notes = ["each channel has its own time, named 'time of ...'"]
    scaled = [
        name for name, factor in zip(rows["Name"], rows.get("ScaleFactor", ()), strict=False) if factor not in ("", "1")
    ]
    if scaled:
        notes.append(f"the header states a scale for {', '.join(scaled)}; the numbers are taken as they stand")
    steps = rows.get("SampleTime[ms]", ())
    sample_times = {2 * k + 1: 1e-3 * float(step) for k, step in enumerate(steps) if re.fullmatch(r"\d+(\.\d+)?", step)}
    return Header(
        names,
        units,
        notes=tuple(notes),
        sample_times=sample_times,
        times={2 * k + 1: 2 * k for k in range(len(names) // 2)},
    )


def _stated(lines: Sequence[str], block: Block, separator: str, line: int) -> Header:
    """The header in the line that the reader names. Raises `Ambiguous` where it does not have as many cells as the table."""
    cells = _fitting(lines[line], block.width, separator) if line < len(lines) else None
    if cells is None:
        raise Ambiguous(
            f"line {line + 1}, said to hold the names, does not have {number_of(block.width, 'cell')}, as the rows of the table do"
        )
    below = [(k, c) for k in block.above if k > line and (c := _fitting(lines[k], block.width, separator)) is not None]
    units = next(({i: c for i, c in enumerate(cells) if unit_of(c)} for _, cells in below if is_unit_row(cells)), {})
    return Header(tuple(cells), _units_behind(cells) | units)


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
    if n == block.width - 1 and [row[0] for row in head] == [str(k) for k in range(1, len(head) + 1)]:
        named = ["row", *cells]
        return Header(tuple(named), _units_behind(named), notes=("the first column numbers the rows and has no name",))
    if is_comment(lines[line]) or separator == " ":  # a sentence has blanks, too
        return Header(())
    what = f"line {line + 1} has {number_of(n, 'name')}, and the rows below it have {number_of(block.width, 'cell')}"
    mend = "and name columns by their number from 0, or repair it; where a comma both separates and marks decimals, export with semicolons"
    raise Ambiguous(what, {"header = 0": mend})

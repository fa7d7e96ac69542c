"""Rows of names and of units above a table: which line is which, and what is told of the others."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from ctrlgen.recordings.formats.number_cells import is_number, is_reading
from ctrlgen.recordings.formats.time_stamps import TIME_NAME
from ctrlgen.recordings.formats.unit_texts import is_unit_cell, is_unit_row, split_name, unit_of

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
UNIT_LABELS = {"unit", "units", "einheit", "einheiten", "vunit", "vertical units", "yunits", "y_unit_label"}
DATES = re.compile("time|date|zeit|datum", re.IGNORECASE)
MOST_PASSED = 3  # lines that hold neither names nor units and are shown
LONGEST_SHOWN = 60  # characters of a line that a note shows


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


def of_factors(cells: Sequence[str]) -> bool:
    """Whether a row says in its first cell that it scales the columns."""
    return cells[0].strip("[]():").lower() in FACTOR_LABELS and any(map(is_number, cells[1:]))


def with_units(cells: Sequence[str]) -> bool:
    """Whether all that is no number in a row is a unit: one of units with some numbers of the logger beside them."""
    texts = [c for c in cells if c and not is_number(c)]
    return bool(texts) and all(is_unit_cell(c) or unit_of(c) for c in texts)


def names_and_units(candidates: Sequence[tuple[int, list[str]]], numeric: Collection[int]) -> Header:
    """Names and units of rows above a table, nearest first; `numeric`: its columns of numbers, which alone have a unit."""
    if not candidates:
        return Header(())
    lines, rows = [line + 1 for line, _ in candidates], [cells for _, cells in candidates]
    names_at, units_at = _roles(rows, numeric)
    if units_at == names_at == 0 and len(rows) == 1:  # labelled units, and no names
        stated = {k: cell for k, cell in enumerate(rows[0]) if k and unit_of(cell)}
        return Header(("",) * len(rows[0]), stated, notes=(f"line {lines[0]} holds units",))
    above = rows[names_at + 1] if names_at + 1 < len(rows) and names_at + 1 != units_at else []
    if units_at is not None and _tells_more(above, rows[names_at]):
        names_at, above = names_at + 1, []
    names, notes = rows[names_at], [f"names in line {lines[names_at]}"] if lines[names_at] > 1 else []
    if not all(names) and _is_text(above) and all(a or n for a, n in zip(above, names, strict=True)):
        notes.append(f"columns without a name there are named by line {lines[names_at + 1]}")
        names, above = [name or other for name, other in zip(names, above, strict=True)], []
    if (
        units_at is not None
        and units_at != names_at
        and any(n and u for n, u in zip(names, rows[units_at], strict=True))
    ):
        names = [
            name or ("" if is_number(unit) else unit) for name, unit in zip(names, rows[units_at], strict=True)
        ]  # Date, Time
    if any(map(is_number, names)):
        notes = [f"line {lines[names_at]} ({', '.join(names)}) is taken as the columns' names"]
    units = units_behind(names)
    if units_at is not None and units_at != names_at:
        notes.append(f"line {lines[units_at]} holds units")
        stated = {k: cell for k, cell in enumerate(rows[units_at]) if cell and not is_number(cell) and unit_of(cell)}
        notes += [
            f"{names[k]}: its name says {unit}, line {lines[units_at]} says {stated[k]}, which is taken: write the right one"
            for k, unit in units.items()
            if k in stated and unit_of(unit) not in (None, unit_of(stated[k]))
        ]
        units |= {k: cell.strip("[](){} ") for k, cell in stated.items()}
    between = range(max(names_at, units_at or 0))
    notes += _passed([(lines[n], rows[n]) for n in between if n not in (names_at, units_at)])
    found = _grouped(names, above)
    if found == names and units_at is not None and _is_text(above):
        notes.append(f"above them stands {', '.join(filter(None, above))}")
        joined = [name or other for name, other in zip(names, above, strict=True)]
        found = joined if len(set(joined)) == len(joined) else names
    return Header(tuple(found), units, notes=tuple(notes))


def _roles(rows: Sequence[list[str]], numeric: Collection[int]) -> tuple[int, int | None]:
    """Which of the rows above a table, nearest first, holds the names, and which the units; None where none does."""
    last = len(rows) - 1
    labels = {cells[0].rstrip(":").lower(): n for n, cells in reversed(list(enumerate(rows)))}
    labelled = sorted(labels[word] for word in UNIT_LABELS & labels.keys())
    units = next((n for n in labelled if any(map(unit_of, rows[n][1:]))), None)
    if units is not None:
        names = min((labels[word] for word in NAME_LABELS & labels.keys()), default=None)
        # Settings of an oscilloscope, units among them, stand above the names
        if names is None and units and TIME_NAME.match(rows[0][0]) and not any(map(is_reading, filter(None, rows[0]))):
            names = 0
        return min(units + 1, last) if names is None else names, units
    units = next((n for n in range(min(2, last)) if _is_units(rows[n], rows[n + 1], numeric)), None)
    if units is not None:
        return units + 1, units
    if not any(map(is_number, rows[0])):
        units = next((n for n in range(1, min(4, len(rows))) if is_unit_row(rows[n])), None)
    rate_of_each = len(set(rows[0])) == 1 < len(rows[0])  # one word over every column names none
    return (min(units + 1, last) if units is not None and rate_of_each else 0), units


def without_labelled_numbers(
    candidates: Sequence[tuple[int, list[str]]],
) -> tuple[list[tuple[int, list[str]]], list[tuple[int, list[str]]]]:
    """Rows above a table without those of a word and numbers alone, such as factors or the largest readings, where another holds names; and
    these, as lines from 1."""
    labelled = [
        bool(cells[0]) and not is_reading(cells[0]) and not TIME_NAME.match(cells[0]) for _, cells in candidates
    ]
    numbers = [
        has and len(filled := [c for c in cells[1:] if c]) > 0 and all(map(is_number, filled))
        for has, (_, cells) in zip(labelled, candidates, strict=True)
    ]
    if not any(numbers) or not any(
        all(cells[1:]) and not any(map(is_number, cells)) and not is_unit_row(cells) for _, cells in candidates
    ):
        return list(candidates), []
    rows = list(zip(numbers, candidates, strict=True))
    return [row for drop, row in rows if not drop], [(k + 1, cells) for drop, (k, cells) in rows if drop]


def told_of(rows: Sequence[tuple[int, list[str]]], header: int) -> list[str]:
    """Notes of rows of labelled numbers: (number of the line, cells), nearest first, of those that are factors or stand below the line
    `header` from 0."""
    return _passed([(line, cells) for line, cells in rows if of_factors(cells) or line > header + 1])


def _passed(rows: Sequence[tuple[int, list[str]]]) -> list[str]:
    """What is told of lines between the table and its names and units: (number, cells), nearest first."""
    told = [
        f"line {line} ({_shown(cells)}) is not applied: write its factors as `scale` of the columns"
        for line, cells in rows
        if of_factors(cells)
    ]
    others = [(line, cells) for line, cells in rows if not of_factors(cells)]
    if len(others) > MOST_PASSED:
        return [*told, f"lines {', '.join(str(k) for k, _ in reversed(others))} hold neither names nor units"]
    return [*told, *(f"line {line} ({_shown(cells)}) holds neither names nor units" for line, cells in others)]


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


def _is_units(cells: list[str], above: list[str], numeric: Collection[int]) -> bool:
    """Whether a row under one of names states units: above columns of numbers; a word such as Time may stand for that of dates."""
    dated = {k for k, c in enumerate(cells) if DATES.fullmatch(c) and DATES.search(above[k])}
    texts = {k for k, c in enumerate(cells) if not is_number(c)}
    stated = set(numeric) if set(numeric) - dated and texts >= set(numeric) else texts
    rest = [cells[k] for k in sorted(stated - dated)]
    units = is_unit_row(rest if len(rest) > len(dated) else [cells[k] for k in sorted(texts)])
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


def units_behind(names: Sequence[str]) -> dict[int, str]:
    """The unit behind each name that has one, by number of column."""
    return {k: unit for k, name in enumerate(names) if (unit := split_name(name)[1]) is not None}

"""Tables that hold one reading a row, with the name of its signal beside it, as data bases and message logs write them."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from ctrlgen.recordings.formats import number_cells, time_stamps
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.unit_texts import bare_name, is_unit_row, unit_of

MOST_SIGNALS = 200
MOST_COLUMNS = 12  # among which such a table is sought
SHARED = 1.5  # rows an instant, from which several signals are read at one time
CHANGING = (
    0.5  # share of rows whose name is another than the row's before, from which a name is no state of the machine
)
SOURCES = frozenset((
    "axis", "axes", "ch", "chan", "channel", "sensor", "probe", "motor", "joint", "node", "device", "slave", "addr", "address",
    "id", "achse", "kanal",
))  # fmt: skip
"""Words of columns that name what a row was read of."""
MOST_IN_TURN, FEWEST_IN_TURN = 16, 12
Column = np.ndarray[Any, Any]


def widened(table: MeasurementTable) -> MeasurementTable:
    """The table with a column a signal; itself where it is none of one reading a row.

    Raises InputError where the signals of such a table are read at times of their own.
    """
    found = _parts(table)
    if found is None:
        _check_in_turn(table)
        _check_mixed(table)
        return table
    names, time, value, unit = found
    signals = list(dict.fromkeys(table.columns[names]))
    instants, row = np.unique(_comparable(table.columns[time]), return_inverse=True)
    place = np.array([signals.index(name) for name in table.columns[names]])
    told = f"column {names!r} names the signal of each row, {value!r} holds its reading"
    listed = ", ".join(signals[:5]) + (", ..." if len(signals) > 5 else "")
    if len(row) < SHARED * len(instants):
        if np.mean(place[1:] != place[:-1]) < CHANGING:
            return table
        raise table.fault(
            f"holds one reading a row: {told} ({listed}), at times of their own; export each signal to its own file, or all at one rate"
        )
    if len(set(zip(row.tolist(), place.tolist(), strict=True))) < len(row):
        return table
    first = np.full(len(instants), len(row))
    np.minimum.at(first, row, np.arange(len(row)))
    order = np.argsort(first, kind="stable")  # as the file goes on, also where its clock was set back
    rank = np.argsort(order)
    spread = np.full((len(instants), len(signals)), None if table.columns[value].dtype.kind == "O" else np.nan)
    spread[rank[row], place] = table.columns[value]
    at = first[order]
    return replace(
        table,
        columns={
            time: table.columns[time][at],
            **{name: spread[:, k] for k, name in enumerate(signals)},
        },
        units={
            **{name: unit_text for name, unit_text in table.units.items() if name == time},
            **({} if unit is None else _units(table, names, unit)),
        },
        lines=[table.lines[k] for k in at] if len(table.lines) else (),
        notes=(*table.notes, f"one reading a row: {told}; read as columns {listed}"),
        nameless=frozenset(),
    )


def _parts(table: MeasurementTable) -> tuple[str, str, str, str | None] | None:
    """The columns of names, time, value and unit of a table of three or four, besides those that say the same in every row or number the
    signals; None for other tables."""
    if not any(map(_begins_with_a_word, table.columns.values())):
        return None
    telling = _telling(table) if 4 < len(table.columns) <= MOST_COLUMNS else list(table.columns)
    if len(telling) == 4 and sum(_holds_words(table.columns[name]) for name in telling) == 1:
        telling = _telling(table)
    if len(telling) not in (3, 4) or table.clocks:
        return None
    words = [name for name in telling if _holds_words(table.columns[name])]
    others = [name for name in telling if name not in words]
    units = [name for name in words if all(map(unit_of, set(table.columns[name])))] if len(words) > 1 else []
    names = [name for name in words if name not in units]
    if len(names) != 1 or len(others) != 2 or len(units) > 1:
        return None
    signals = len(set(table.columns[names[0]]))
    if is_unit_row(list(dict.fromkeys(table.columns[names[0]]))):  # of an instrument that changes its range
        return None
    if not 2 <= signals <= min(MOST_SIGNALS, len(table.columns[names[0]]) // 2):
        return None
    timed = [name for name in others if time_stamps.TIME_NAME.match(bare_name(name))] or [
        name for name in others if _is_stamp(table.columns[name])
    ]
    timed = timed or [name for name in others if _is_epoch(table.columns[name])]
    if len(timed) != 1:
        return None
    value = next(name for name in others if name != timed[0])
    return names[0], timed[0], value, units[0] if units else None


def _check_mixed(table: MeasurementTable) -> None:
    """Raises InputError for a table of names and their readings alone: several signals in one column, and no time that tells which rows
    are of one instant."""
    if len(table.columns) != 2 or not any(map(_begins_with_a_word, table.columns.values())):
        return
    words = [name for name in table.columns if _holds_words(table.columns[name])]
    cells = [str(cell) for cell in table.columns[words[0]]] if len(words) == 1 else []
    changing = float(np.mean([a != b for a, b in pairwise(cells)])) if len(cells) > 1 else 0.0
    if 2 <= len(set(cells)) <= min(MOST_SIGNALS, len(cells) // 2) and changing >= CHANGING:
        told = f"column {words[0]!r} names its signal ({', '.join(sorted(set(cells))[:5])})"
        raise table.fault(f"holds one reading a row and no time: {told}; log each with a time stamp")


def _check_in_turn(table: MeasurementTable) -> None:
    """Raises InputError where a column names the axis, or the sensor, of each row and several are written in turn: their readings are no
    motion of one."""
    for name, column in table.columns.items():
        if len(column) < FEWEST_IN_TURN or name in table.units or not _names_a_source(bare_name(name)):
            continue
        cells = [str(cell) for cell in column]
        changing = float(np.mean([a != b for a, b in pairwise(cells)]))
        if 2 <= len(set(cells)) <= MOST_IN_TURN and changing >= CHANGING and _as_often(cells):
            listed = ", ".join(sorted(set(cells))[:5])
            told = f"holds rows of several sources in turn: column {name!r} goes through {listed}"
            raise table.fault(f"{told}; write those of each to a file of its own")


def _names_a_source(name: str) -> bool:
    """Whether a name is that of what a row was read of, `axis` or `node id`: CH1 is a reading, and an x-axis a coordinate."""
    words = re.findall(r"[a-z]+\d*", name.lower())
    return bool(words) and (words[0] in SOURCES or words[-1] == "id")


def _as_often(cells: list[str]) -> bool:
    """Whether different cells stand in about as many rows each, and in more than one: a coordinate that rises goes through none again."""
    counts = sorted(map(cells.count, set(cells)))
    return counts[0] >= max(CHANGING * counts[-1], 2)


def _begins_with_a_word(column: Column) -> bool:
    first = column[0] if column.dtype.kind == "O" and len(column) else None
    return isinstance(first, str) and bool(first) and not number_cells.is_reading(first)


def _telling(table: MeasurementTable) -> list[str]:
    """The columns whose cells differ, without numbers that only count the signals of another column."""
    keys = {name: list(map(str, column)) for name, column in table.columns.items()}
    kept = [name for name, cells in keys.items() if len(set(cells)) > 1]
    words = [name for name in kept if _holds_words(table.columns[name])]
    counted = {
        name
        for name in kept
        for word in words
        if name not in words
        and len(set(keys[name])) == len(set(keys[word])) == len(set(zip(keys[name], keys[word], strict=True)))
    }
    return [name for name in kept if name not in counted]


def _holds_words(column: Column) -> bool:
    """Whether every cell is a text that is neither a number nor a time."""
    return column.dtype.kind == "O" and all(
        isinstance(cell, str) and cell and not number_cells.is_reading(cell) for cell in dict.fromkeys(column)
    )


def _is_stamp(column: Column) -> bool:
    try:
        return time_stamps.seconds(column, "day first") is not None
    except ValueError:
        return False


def _is_epoch(column: Column) -> bool:
    """Whether numbers are times since 1970, as of exporters that name no column."""
    return column.dtype.kind in "iuf" and time_stamps.epoch_unit(column.astype(float)) not in (None, "day")


def _comparable(column: Column) -> Column:
    return column.astype(str) if column.dtype.kind == "O" else column


def _units(table: MeasurementTable, names: str, unit: str) -> dict[str, str]:
    """The unit of each signal that states one and the same in all its rows."""
    seen: dict[str, set[str]] = {}
    for name, text in zip(table.columns[names], table.columns[unit], strict=True):
        seen.setdefault(name, set()).add(text)
    return {name: next(iter(texts)) for name, texts in seen.items() if len(texts) == 1}

"""Time in two columns: whole seconds and their fraction, a stamp of ROS, a date with milliseconds beside it; a date and the time of day."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.number_cells import CLOCK, DATE
from ctrlgen.recordings.formats.unit_texts import bare_name

FRACTIONS = (
    (re.compile(r"fraction(al)?([ _]?(secs?|seconds?))?|frac[ _]?secs?", re.IGNORECASE), 1.0),
    (re.compile(r"(ms|msecs?|millis?|milli(tm|secs?|seconds?))", re.IGNORECASE), 1e3),
    (re.compile(r"(us|usecs?|micros?|micro(secs?|seconds?))", re.IGNORECASE), 1e6),
    (re.compile(r"(ns|nsecs?|nanos?|nano(secs?|seconds?))", re.IGNORECASE), 1e9),
)
"""Names of columns of a fraction, and how many of it are a second."""
EVEN = 0.25  # of a step: how exactly a time goes on where its largest part begins again
PARTS = (
    (re.compile(r"h|hh|hrs?|hours?|std|stunden?", re.IGNORECASE), 3600.0, 24.0),
    (re.compile(r"m|mm|mins?|minutes?|minuten?", re.IGNORECASE), 60.0, 60.0),
    (re.compile(r"s|ss|secs?|seconds?|sek|sekunden?", re.IGNORECASE), 1.0, 60.0),
    *((pattern, 1 / size, size) for pattern, size in FRACTIONS[1:]),
)
"""Names of columns of the parts of a time of day, their size in seconds, and at how many the part before them goes on."""


def with_whole_time(table: MeasurementTable) -> MeasurementTable:
    """The table with one column of time more, at its end, where a column of whole seconds has that of their fraction behind it, or one of
    dates, which change, that of the time of day beside it: alone, this would tell a midnight, but not how many."""
    names = list(table.columns)
    for pair in pairwise(names):
        for date, clock in (pair, pair[::-1]):
            cells = _dated(table.columns[date], table.columns[clock])
            if cells is not None:
                whole = f"time ({date} + {clock})"
                note = f"{whole}: {date} holds dates and {clock} the time of day, read as one time"
                columns, parts = {**table.columns, whole: cells}, frozenset(pair)
                return replace(table, columns=columns, notes=(*table.notes, note), time_parts=parts)
    if (whole_day := _parts(table)) is not None:
        return whole_day
    for before, name in pairwise(names):
        last = re.split(r"[./]", bare_name(name))[-1]
        size = next((size for pattern, size in FRACTIONS if pattern.fullmatch(last)), 0.0)
        if size and (time := _joined(table, before, name, size)) is not None:
            whole = f"time ({before} + {name})"
            note = f"{whole}: {before} holds whole seconds and {name} what is over, read as one time"
            columns = {**table.columns, whole: time}
            units, parts = {**table.units, whole: "s"}, frozenset((before, name))
            return replace(table, columns=columns, units=units, notes=(*table.notes, note), time_parts=parts)
    return table


def _parts(table: MeasurementTable) -> MeasurementTable | None:
    """The table with the time of day that columns of hours, minutes, seconds and parts of them are, beside one another in that order;
    None where no such columns are, or where the seconds alone go on all the time."""
    names = list(table.columns)
    sizes = [next((k for k, (word, *_) in enumerate(PARTS) if word.fullmatch(bare_name(name))), -1) for name in names]
    for first in range(len(names)):
        last = first
        while last + 1 < len(names) and sizes[first] >= 0 and sizes[last + 1] == sizes[last] + 1:
            last += 1
        chosen = range(first, last + 1)
        if last == first or sizes[first] > 1 or sizes[last] < 2:
            continue
        try:
            columns = [table.numbers(names[k]) for k in chosen]
        except InputError:
            continue
        if (time := _summed(columns, [PARTS[sizes[k]][1:] for k in chosen])) is not None:
            whole = f"time ({' + '.join(names[k] for k in chosen)})"
            note = f"{whole}: parts of one time of day, read as one time"
            held, units = {**table.columns, whole: time}, {**table.units, whole: "s"}
            parts = frozenset(names[k] for k in chosen)
            return replace(table, columns=held, units=units, notes=(*table.notes, note), time_parts=parts)
    return None


def _summed(columns: list[np.ndarray], sizes: list[tuple[float, float]]) -> np.ndarray | None:
    """Seconds since the first row (n,), over the end of the largest part; None where columns are no parts of one time that rises."""
    if len(columns[0]) < 2 or not all(np.isfinite(column).all() for column in columns):
        return None
    for k, (column, (_, most)) in enumerate(zip(columns, sizes, strict=True)):
        whole = k == len(columns) - 1 or np.all(column == np.round(column))
        if not whole or column.min() < 0 or (k > 0 and column.max() >= most):
            return None
    total = sum(column * size for column, (size, _) in zip(columns, sizes, strict=True))
    turn = sizes[0][0] * sizes[0][1]  # a day; without hours the next hour
    steps = np.diff(total)
    falls, usual = steps < 0, float(np.median(steps))
    if np.any(np.abs(steps[falls] + turn - usual) > EVEN * usual):  # another run, or rows are missing there
        return None
    total = np.asarray(total + turn * np.concatenate([[0.0], np.cumsum(falls)]))
    return np.round(total - total[0], 9) if np.all(np.diff(total) > 0) else None


def _dated(dates: np.ndarray, clock: np.ndarray) -> np.ndarray | None:
    """Texts of dates and of times of day (n,) as one text a row; None where the columns are no such pair or hold one date."""
    if any(np.asarray(column).dtype.kind != "O" for column in (dates, clock)) or len(dates) != len(clock):
        return None
    days, times = ([c.strip() if isinstance(c, str) else "" for c in column] for column in (dates, clock))
    if len(set(days) - {""}) < 2 or not all(re.fullmatch(DATE, day, re.ASCII) for day in set(days) - {""}):
        return None
    known = [time for time in times if time]
    if not known or not all(re.fullmatch(CLOCK, time, re.ASCII) for time in known):
        return None
    return np.array(
        [f"{day} {time}" if day and time else None for day, time in zip(days, times, strict=True)], dtype=object
    )


def _joined(table: MeasurementTable, before: str, name: str, size: float) -> np.ndarray | None:
    """Seconds since the first row (n,), rounded to the fraction; None where the two columns are no parts of one time."""
    try:
        whole, over = table.time(before, "s").values, table.numbers(name)
    except InputError:
        return None
    if len(whole) != len(over) or len(over) < 2 or not (np.isfinite(whole).all() and np.isfinite(over).all()):
        return None
    parts = np.all(whole == np.round(whole)) and over.min() >= 0 and over.max() < size
    falls = np.diff(over) < 0
    within = not falls.any() and np.ptp(whole) == 0 and np.all(np.diff(over) > 0)  # one second
    if not parts or not (falls.any() or within) or not np.all(np.diff(whole)[falls] > 0):
        return None
    return np.asarray(np.round(whole + (over - over[0]) / size, 9))

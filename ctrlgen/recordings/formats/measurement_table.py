"""The columns of one measurement file, as every reader gives them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.names import meant
from ctrlgen.core.units import to_si
from ctrlgen.recordings.formats import clock_numbers, number_cells, over_range, time_stamps, wrapped_counters
from ctrlgen.recordings.formats.layout_question import Ambiguous, AmbiguousFile
from ctrlgen.recordings.formats.number_cells import NumberStyle
from ctrlgen.recordings.formats.unit_texts import bare_name, split_name

MOST_LISTED = 20  # columns that a message lists
TOGETHER = 0.5  # of the rows of the scarcer of two columns: both are filled in so many where they are sampled together


class Clock(NamedTuple):
    """The time axis of a channel that brings its own: its first instant and the time between its readings [s]."""

    start: float
    step: float


class Numbers(NamedTuple):
    """A column as float64 (n,), NaN where there is no reading, and what was interpreted on the way, one line each; of a time when the
    first was, `begin` [s] on the column's own clock, and whether it is `dated`: dates or a clock, whose unit is no question."""

    values: np.ndarray
    notes: tuple[str, ...] = ()
    begin: float = 0.0
    dated: bool = False


@dataclass(frozen=True)
class MeasurementTable:
    """The columns of one file by name: numbers (n,), instants (datetime64), or the cells of a text file.

    `units`: those that the file itself states. `lines`: the line number of each row in a text file. `notes`: what was interpreted to
    read the file, one line each. `aliases`: further names of columns. `nameless`: columns that have no name of their own, by their
    number from 0. `clocks`: of channels whose time axis the file states.
    `own_times`: the column of time of each column, where channels have times that differ.
    `time_parts`: columns that are one time together, which is a column of its own.
    `style`: how numbers are written as text. `missing`: numbers and texts that the reader says are no reading,
    None where nothing is said. `stated_rate`: words of the file that state how often rows were read, and the rate [Hz].
    `doubtful`: numbers of columns that are written otherwise than all others there, and may be marks.
    `factors`: what the file says of a column by a factor or an offset that nobody applied.
    `scales`: factors that stand beside columns of whole numbers, which lack them.
    """

    path: Path
    columns: Mapping[str, Any]
    units: Mapping[str, str] = field(default_factory=dict)
    lines: Sequence[int] = ()
    notes: tuple[str, ...] = ()
    aliases: Mapping[str, str] = field(default_factory=dict)
    nameless: frozenset[int] = frozenset()
    clocks: Mapping[str, Clock] = field(default_factory=dict)
    time_parts: frozenset[str] = frozenset()
    own_times: Mapping[str, str] = field(default_factory=dict)
    style: NumberStyle = field(default_factory=NumberStyle)
    missing: tuple[str | int | float, ...] | None = None
    stated_rate: tuple[str, float] | None = None
    scales: Mapping[str, float] = field(default_factory=dict)
    doubtful: Mapping[str, float] = field(default_factory=dict)
    factors: Mapping[str, str] = field(default_factory=dict)

    def find(self, wanted: str | int) -> str:
        """The full name of a column that is given by name, by number from 0, without its unit, or without its group.

        Raises InputError that lists the columns, or the nearest name.
        """
        names = list(self.columns)
        if isinstance(wanted, int):
            if not 0 <= wanted < len(names):
                raise self.fault(f"has columns 0 to {len(names) - 1}, not {wanted}")
            named = str(wanted) in names and names.index(str(wanted)) != wanted
            if named and len(self.nameless) < len(names):
                what = f"has a column that is named {wanted}, and column number {wanted} from 0 is another, {names[wanted]!r}"
                raise self.fault(f'{what}: write column = "{wanted}" for the first, or the name of the other')
            return names[wanted]
        shorter = (str, bare_name, _without_group, lambda name: bare_name(_without_group(name)))
        for shorten in shorter:
            matching = [name for name in names if shorten(name) == wanted]
            matching += [
                name for alias, name in self.aliases.items() if shorten(alias) == wanted and name not in matching
            ]
            if len(matching) == 1:
                return matching[0]
            if matching:
                raise self.fault(f"has {len(matching)} columns {wanted!r}: write one of {', '.join(matching)}")
        raise self.fault(f"has no column {wanted!r}; {self._instead(wanted, names)}")

    def _instead(self, wanted: str, names: list[str]) -> str:
        if wanted.isdecimal() and int(wanted) < len(names):
            k = int(wanted)
            return f"write column = {k}, without quotes, for the one with {k} before it: {names[k]!r}"
        listed = ", ".join(names[:MOST_LISTED]) + (", ..." if len(names) > MOST_LISTED else "")
        return meant(wanted, [*names, *map(bare_name, names)], f"its columns are: {listed or 'none'}")

    def unit(self, name: str) -> str | None:
        """The unit that the file states of a column, beside it or behind its name; None where it states none."""
        return self.units.get(name) or split_name(_without_group(name))[1]

    def numbers(self, name: str) -> np.ndarray:
        """Column `name` as float64 (n,), NaN where there is no reading. Raises InputError for text that is no number."""
        return self.reading(name).values

    def reading(self, name: str) -> Numbers:
        """Column `name` with over-range marks and words for missing left out. Raises InputError for other text."""
        column = np.asarray(self.columns[name])
        if column.dtype.kind == "M":
            raise self.fault(f"column {name!r} holds instants, which are no reading; name it as the time")
        notes: list[str] = []
        if column.dtype.kind == "O":
            cells = number_cells.to_numbers(column, self.style, self.missing or ())
            if cells.bad:
                raise self._bad_cells(name, cells)
            column = cells.values
            notes += [
                f"{name}: {number_of(len(k), 'reading is', 'readings are')} {word!r} ({self._first(k[0])}), taken as missing"
                for word, k in cells.words.items()
            ]
            notes += [f"{name}: true is read as 1, false as 0"] if cells.truths else []
            plain = self.style.plain(number_cells.usual(cells.otherwise))
            notes += [f"{name}: numbers such as {cells.otherwise!r} are read as {plain}"] if cells.otherwise else []
        try:
            values, marks = over_range.without_marks(np.asarray(column, dtype=float), self.missing)
        except Ambiguous as error:
            raise AmbiguousFile(self.path, error.of_column(name)) from None
        if (found := int(np.sum(values == self.doubtful.get(name, np.nan)))) > 0:
            raise AmbiguousFile(self.path, over_range.mark_or_reading(self.doubtful[name], found).of_column(name))
        notes += [
            f"{name}: {number_of(m.readings, 'reading is', 'readings are')} {m.text} ({self._first(m.row)}), {m.meaning}; left out"
            for m in marks
        ]
        if (again := wrapped_counters.wrapped(values)) is not None:
            times = f"{number_of(len(again.rows), 'time')} ({self._first(int(again.rows[0]))})"
            what = f"{name}: jumps from one end of {again.words} to the other {times}, {again.told}"
            notes.append(f"{what}, or these rows are jumps of the reading")
        return Numbers(values, tuple(notes))

    def time(self, name: str, unit: str, scale: float = 1.0) -> Numbers:
        """Column `name` as time since its first reading, in `scale` times `unit`: instants and time stamps as seconds.

        Raises InputError for what is no time, for dates that can be read two ways, and for an epoch in another unit than stated.
        """
        column = np.asarray(self.columns[name])
        try:
            stamps = time_stamps.seconds(column, self.style.dates)
        except Ambiguous as error:
            raise AmbiguousFile(self.path, error.of_column(name)) from None
        except ValueError as error:
            raise self.fault(f"column {name!r} {error}") from None
        if stamps is not None:
            if unit != "s":
                raise self.fault(
                    f'column {name!r} holds time stamps, which are read as seconds: write unit = "s", not "{unit}"'
                )
            return Numbers(stamps.values, stamps.notes, stamps.begin, dated=True)
        if column.dtype.kind == "O":
            column = self._exact(name, column)
        if (clock := clock_numbers.clock_of(np.asarray(column, dtype=float))) is not None:
            if unit != "s" or scale != 1:
                what = f"holds a clock written as numbers (115559 is 11:55:59), which is read as seconds, not as {scale:g} {unit}"
                raise self.fault(f'column {name!r} {what}: write unit = "s" without a scale')
            begin = float(clock[np.isfinite(clock)][0])
            return Numbers(np.round(clock - begin, 6), (f"{name} {clock_numbers.AS_SECONDS}",), begin, dated=True)
        try:
            values, notes = time_stamps.from_first(column, unit, scale)
        except ValueError as error:
            raise self.fault(f"column {name!r} {error}") from None
        values, told = wrapped_counters.unwrapped_clock(values, float(column[0]) if len(column) else 0.0)
        known = np.asarray(column, dtype=float)[np.isfinite(values)]
        begin = scale * to_si(float(known[0]), unit) if len(known) else 0.0
        return Numbers(values, (*notes, f"{name}: {told}") if told else notes, begin)

    def _exact(self, name: str, column: np.ndarray) -> np.ndarray:
        """Cells of text as numbers, those of a long epoch as the whole numbers that they are."""
        return self.numbers(name) if not number_cells.are_whole(column) else np.array([int(c) for c in column])

    def differing_times(self, names: Sequence[str]) -> str:
        """What is wrong where columns of these names have times that differ; empty where they have one."""
        used = {name: self.own_times[name] for name in names if name in self.own_times}
        if len(set(used.values())) < 2:
            return self._filled_apart(names)
        listed = ", ".join(f"{name} has {time}" for name, time in used.items() if name != time)
        mend = "export them at one rate, or each to its own file, named by `file` of its column"
        return f"holds channels that each have a time of their own, and these differ ({listed}); {mend}"

    def _filled_apart(self, names: Sequence[str]) -> str:
        """What is wrong where two columns of these names are hardly ever filled in one row; empty where they are."""
        filled = {name: number_cells.are_filled(np.asarray(self.columns[name])) for name in dict.fromkeys(names)}
        for (a, has), (b, also) in combinations(filled.items(), 2):
            fewest = min(has.sum(), also.sum())
            if fewest > 1 and len(has) == len(also) and np.sum(has & also) < TOGETHER * fewest:
                told = f"fills {a} in {number_of(int(has.sum()), 'row')} and {b} in {also.sum()}, hardly ever the same"
                return (
                    f"{told}; export them resampled to one time, or each to its own file, named by `file` of its column"
                )
        return ""

    def _bad_cells(self, name: str, cells: number_cells.Cells) -> InputError:
        bad = cells.bad
        words = list(dict.fromkeys(text for _, text in bad))
        listed = ", ".join(f"{self._place(k)} {text!r}" for k, text in bad[: number_cells.MOST_LISTED])
        more = f" and {len(bad) - number_cells.MOST_LISTED} more" if len(bad) > number_cells.MOST_LISTED else ""
        key = ", ".join(f'"{word}"' for word in words[: number_cells.MOST_WORDS]).replace("\\", "\\\\")
        what = f"column {name!r} holds text that is no number in {len(bad)} of {number_of(len(self.columns[name]), 'row')} ({listed}{more})"
        remarks = not np.isfinite(cells.values).any()
        if why := number_cells.written_otherwise([text for _, text in bad]):
            # one text in every row may be a state: nothing is asked of it, and who names its column is told
            state = remarks and len(words) == 1
            return self.fault(f"{what}: {why}") if state else AmbiguousFile(self.path, Ambiguous(f"{what}: {why}"))
        if any(number_cells.has_unit(text) for _, text in bad):
            if all(re.fullmatch(r"[^a-z]*m", text) for text in words):
                mend = "metres, or thousandths? Write the unit of its numbers into its name: 'x (m)', 'x (V)' for thousandths of it"
                return self.fault(f"{what}: {mend}")
            units = list(dict.fromkeys(re.sub(r"^[-+.,\d]+([eE][-+]?\d+)?\s*", "", text) for text in words))
            what += f", in several units ({', '.join(units[: number_cells.MOST_LISTED])})" if len(units) > 1 else ""
            return self.fault(f"{what}; numbers stand alone: write the unit into the name, such as 'x (um)'")
        if len(bad) == len(self.columns[name]):
            return self.fault(f"{what}; name another column")
        if number_cells.are_digits(words):
            mend = "numbers with marks that are not known; write plain ones, such as -1234.5"
            return AmbiguousFile(self.path, Ambiguous(f"{what}: {mend}"))
        if remarks:
            return self.fault(f"{what}, and numbers in none; name another column")
        left = len(words) - number_cells.MOST_WORDS
        all_of_them = f"with {number_of(left, 'more text')} of the column " if left > 0 else ""
        answers = {f"missing = [{key}]": f"{all_of_them}if that means a missing reading, or numbers in their place"}
        return AmbiguousFile(self.path, Ambiguous(what, answers))

    def _first(self, row: int) -> str:
        return f"first in {self._place(row)}"

    def _place(self, row: int) -> str:
        return f"line {self.lines[row]}" if row < len(self.lines) else f"row {row}"

    def fault(self, what: str) -> InputError:
        """The error that says `what` is wrong with this file."""
        return InputError(self.path, [Fault(self.path.name, what)])


def _without_group(name: str) -> str:
    return name.replace("/", ".").rpartition(".")[2]

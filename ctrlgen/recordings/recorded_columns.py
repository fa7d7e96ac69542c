"""Columns of a record's measurement files in SI, and what was interpreted to read them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import same_dimension, to_si
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.measurement_table import Clock, MeasurementTable, Numbers
from ctrlgen.recordings.formats.unit_texts import scaled_unit, unclear_factor, unit_of
from ctrlgen.recordings.recorded_files import sha256
from ctrlgen.recordings.schema import Column, RecordingFile, RecordTable
from ctrlgen.recordings.usual_step import usual_step

SAME_CLOCK = 1e-3  # of a time between readings: as far as two clocks may differ by the rounding of a file


class RecordedColumns:
    """Reads the columns of one [[record]]; `faults` collects what is wrong on the way, `notes` what was interpreted."""

    def __init__(self, folder: Path, written: RecordingFile, table: RecordTable, where: str) -> None:
        self.folder, self.written, self.table, self.where = folder, written, table, where
        self.faults: list[Fault] = []
        self.notes: list[str] = []
        # [s] when the record's first row was, by its column of time
        self.begin = 0.0
        # whether that time is dates or a clock: its unit is no question then
        self.dated = False
        self.files: dict[str, MeasurementTable | None] = {}
        self.clocks: dict[str, Clock] = {}
        self.used: dict[str, list[str]] = {}
        self.differing = False

    def signals(self, columns: dict[str, Column]) -> dict[str, np.ndarray]:
        """The columns (n,) in SI by signal, without those that cannot be read."""
        read = {name: self.column(f"{self.where}.columns.{name!r}", column, name) for name, column in columns.items()}
        return {name: values for name, values in read.items() if values is not None}

    def column(self, where: str, column: Column, signal: str = "") -> np.ndarray | None:
        """A column in SI (n,); None, with a fault, where it cannot be read. A `signal` remembers a clock of the column's own."""
        file = column.file or self.table.file
        table = self._file(where, column)
        if table is None:
            return None
        try:
            scale = to_si(1.0, column.unit), to_si(0.0, column.unit)
        except ValueError:  # already among the faults of recording.toml
            return None
        try:
            name = table.find(column.column)
            is_time = column is self.table.time
            given = table.time(name, column.unit, column.scale) if is_time else table.reading(name)
        except InputError as error:
            self.faults += [Fault(where, f"{file} {fault.what}") for fault in error.faults]
            return None
        if is_time:
            self.begin, self.dated = given.begin, given.dated
        self.used.setdefault(file, []).append(name)
        if not self.differing and (differing := table.differing_times(self.used[file])):
            self.differing = True
            self.faults.append(Fault(where, f"{file} {differing}"))
        if column.scale == 1 and (fault := _other_unit(table.unit(name), scale, column.unit)):
            self.faults.append(
                Fault(where, f"{file} says {table.unit(name)}, recording.toml says {column.unit}; {fault}")
            )
        if signal and name in table.clocks and not column.sample_rate:
            self.clocks[signal] = table.clocks[name]
        self._note(file, table, column, given)
        return column.scale * given.values * (scale[0] - scale[1]) + scale[1]

    def own_clocks(self, signals: Sequence[str], time: np.ndarray | None) -> dict[str, Clock]:
        """Signals whose files give them another clock than the record's, each with its clock from the record's first row on.

        The record's clock is that of its first drive; a fault where that is not the stated rate or the column of `time` (n,) [s].
        """
        clocks = {name: self.clocks[name] for name in sorted(signals, key=_is_reading) if name in self.clocks}
        if not clocks:
            return {}
        first, clock = next(iter(clocks.items()))
        rate = self.table.sample_rate
        step = 1 / rate.si if rate else None if time is None or len(time) < 2 else usual_step(time)
        if step is not None and abs(clock.step / step - 1) > SAME_CLOCK:
            key, stated = (
                ("sample_rate", f"sample_rate = {rate.text}") if rate else ("time", f"its time steps by {step:.6g} s")
            )
            what = f"{self.table.file} says that {first} is read every {clock.step:.6g} s, but {stated}"
            self.faults.append(Fault(f"{self.where}.{key}", f'{what}; write sample_rate = "{1 / clock.step:.9g} Hz"'))
        own = {
            name: Clock(start - clock.start, step)
            for name, (start, step) in clocks.items()
            if abs(step / clock.step - 1) > SAME_CLOCK or abs(start - clock.start) > SAME_CLOCK * clock.step
        }
        self.notes += [
            f"{self.table.file}: {name} is read every {c.step:.6g} s from {c.start:.6g} s on, as the file says: taken linearly at the "
            f"times of {first}."
            for name, c in own.items()
        ]
        return own

    def _file(self, where: str, column: Column) -> MeasurementTable | None:
        """The table that a column stands in; None, with a fault the first time, where it cannot be read."""
        file = column.file or self.table.file
        if file not in self.files:
            self.files[file] = None
            try:
                self.files[file] = self._read(self.folder / file)
            except InputError as error:
                place = f"{self.where}.file" if column.file is None else f"{where}.file"
                self.faults += [Fault(place, f"{file} {fault.what}") for fault in error.faults]
        return self.files[file]

    def _read(self, path: Path) -> MeasurementTable:
        """A file's columns. Raises InputError; for a file that is not kept with the recording it says where to get it."""
        stated = self.written.sha256.get(path.name)
        which = self.table.table if path.name == Path(self.table.file).name else None
        layout = self.table.layout or self.written.layout
        if stated is None:
            return read_table(path, which, layout)
        source = f"{self.written.source or 'its source is not stated'}; file {path.name}, SHA-256 {stated}"
        if not path.is_file():
            what = f"is not here; the recording does not bring it along. Source: {source}. Put it at {path.resolve()}"
            raise InputError(path, [Fault(path.name, what)])
        actual = sha256(path)
        # Rows, units and filters were chosen for that file and would mean something else in another
        if actual != stated:
            what = f"is another file, SHA-256 {actual}. Wanted: {source}. If you mean this one, state its SHA-256 in [sha256]"
            raise InputError(path, [Fault(path.name, what)])
        return read_table(path, which, layout)

    def _note(self, file: str, table: MeasurementTable, column: Column, given: Numbers) -> None:
        """What was interpreted to read a column of a file, each once."""
        names, k = list(table.columns), column.column
        said = [*table.notes, *given.notes]
        if isinstance(k, int) and k in table.nameless and len(table.nameless) < len(names):
            before = f"; the one before it is {names[k - 1]!r}" if k else ""
            said.append(f"column {k}, counted from 0, has no name{before}")
        for text in said:
            if (note := f"{file}: {text}.") not in self.notes:
                self.notes.append(note)


def _is_reading(signal: str) -> bool:
    return not signal.startswith("drive.")


def _other_unit(stated: str | None, scale: tuple[float, float], unit: str) -> str:
    """What to do about a unit that differs from the one given; empty where it does not."""
    if stated is not None and (several := scaled_unit(stated)) is not None:
        factor, single = several
        same = same_dimension(single, unit) and np.isclose(factor * to_si(1.0, single), scale[0], rtol=1e-9, atol=0)
        return "" if same else f'write scale = {factor:g}, unit = "{single}"'
    if stated is not None and unclear_factor(stated):
        return "write scale = 10 or scale = 0.1 (for ten), as its numbers are meant"
    return "correct the one that is wrong" if contradicts(stated, scale, unit) else ""


def contradicts(stated: str | None, scale: tuple[float, float], unit: str) -> bool:
    """Whether a file's own unit differs from the one given; a text that is no unit contradicts nothing."""
    known = None if stated is None else unit_of(stated)
    if known is None:
        return False
    try:
        other = to_si(1.0, known), to_si(0.0, known)
        return not same_dimension(known, unit) or not np.allclose(other, scale, rtol=1e-9, atol=0)
    except ValueError:
        return False

"""The schema of recording.toml, and the faults that show against the model before any data are read."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ctrlgen.core.errors import Fault
from ctrlgen.core.names import meant
from ctrlgen.core.units import In, Quantity, parse, parse_difference, same_dimension
from ctrlgen.devices.section import Section
from ctrlgen.model.model import Model
from ctrlgen.recordings.derived_drives import derived_drives, written
from ctrlgen.recordings.formats.written_layout import Layout

FILE = "recording.toml"
LAST_ROW = 1 << 62  # stands for the end of a file whose length is not known yet


class Column(Section):
    """A column of a measurement file."""

    column: str | Annotated[int, Field(strict=True, ge=0)]
    """Name of the column in the file's header, or its number from 0."""
    unit: str
    """Unit of the column's numbers after `scale`."""
    noise: str | None = None
    """Standard deviation of the noise, with its unit, such as `"10 nm"`. Left out: estimated from the recording."""
    tolerance: str | None = None
    """Error of this reading that does not matter, with its unit, such as `"2 um"`. Left out: the noise is what matters."""
    file: str | None = None
    """Another file than the record's. Left out: the record's file. Without a clock of its own it has the same samples row by
    row.
    """
    sample_rate: Annotated[Quantity, In("Hz", positive=True)] | None = None
    """Rows a second of a file of another recorder, which begins with the record; it is read linearly between its rows."""
    scale: float = 1.0
    """Factor that brings the column's numbers to `unit`: newtons per volt of a recorded amplifier voltage, -1 for
    reversed polarity.
    """
    later: Annotated[Quantity, In("s")] | None = None
    """How much later than its row's time a number acts: the one cycle after which a recorded command takes effect; earlier
    where negative. Rows at the record's ends that this leaves without a number are left out.
    """


class Derivative(Section):
    """A signal that was not recorded: the derivative of another one in time, by central differences, or its integral."""

    of: str
    """Name of the recorded signal."""
    order: Literal[-1, 1, 2]
    """Order of the derivative in time; -1 is the integral from the record's first row, by the trapezoidal rule."""


class Conditions(Section):
    """The surroundings of the device: the ambient temperature, constant or recorded."""

    ambient: str | Column | None = None
    """Ambient temperature: constant, such as `"22 degC"`, or a column. Left out: no effect of it is considered."""


class RecordTable(Section):
    """One `[[record]]` of recording.toml: a stretch of one measurement file, and what it is used for."""

    file: str
    """The measurement file, relative to recording.toml; its ending tells the format."""
    table: Annotated[int, Field(strict=True, ge=1)] | str | None = None
    """Which table of a file that holds several, from 1, or the name of a sheet of a workbook."""
    layout: Layout | None = None
    """How this record's files are written, where they leave it open. Left out: as `layout` of the whole file says."""
    role: Literal["fit", "hold_out", "rest"]
    """`fit`: parameters are estimated from it; `hold_out`: it only judges predictions; `rest`: nothing moves, it gives
    the noise. Without a `hold_out`, part of the longest record is held out.
    """
    time: Column | None = None
    """Column of the time of each row. A series has either this or `sample_rate`; poses have neither."""
    sample_rate: Annotated[Quantity, In("Hz", positive=True)] | None = None
    """Rows a second, for a series without a column of time."""
    dwell: Annotated[Quantity, In("s", positive=True)] | None = None
    """Time from pose to pose, for poses that did not settle. Left out: every pose has settled."""
    start: Annotated[Quantity, In("s")] | None = None
    """Time of the first row on the clock common to all records. Left out everywhere: as the columns of time say, where files go on from
    each other by them and lie close together; else 0 s.
    """
    between_samples: Literal["held", "linear", "unstated"] = "unstated"
    """What the drive does between samples: it is held at a sample's value until the next one, or goes in straight lines. `unstated`: nobody
    knows; a diagnosis takes what of these or of a smooth curve the readings fit, and says so, everything else takes straight lines.
    """
    gap: Literal["linear", "held", "split"] | None = None
    """What the drive does across rows that are missing, or that hold no number for it: `linear` or `held` bridges every gap that is a
    whole number of samples so, `split` ends a record there and begins another. Left out: gaps of at most 100 samples are bridged where
    the drive itself tells what it did there, by its steps or its smoothness, well enough for the readings after them, and the others
    split.
    """
    rows: tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]] | None = None
    """The half-open range [first, one past the last] of the file's rows that is used, from 0. Left out: all."""
    lead_in: Annotated[int, Field(ge=0)] = 0
    """The first so many used rows only set the device's states and memories; their readings are not compared."""
    period: Annotated[Quantity, In("s", positive=True)] | None = None
    """Time after which the drive repeats; differences of periods give the noise. Left out: sought in the drive."""
    conditions: Conditions = Conditions()
    """The surroundings of the device."""
    columns: dict[str, Column] = {}
    """Columns of this record alone, by signal; they replace those of the whole file."""

    @property
    def begins_within(self) -> bool:
        """Whether rows of the file come before it, of which no lead-in tells what the device remembers."""
        return self.rows is not None and self.rows[0] > 0 and not self.lead_in

    @property
    def used_rows(self) -> tuple[int, int]:
        """The half-open range of rows whose readings are used; ends at `LAST_ROW` where `rows` is not given."""
        a, b = self.rows or (0, LAST_ROW)
        return a + self.lead_in, b

    def at_rows(self, places: np.ndarray) -> RecordTable:
        """The same record of a table whose rows stand at `places` (n,) of another one."""
        a, b = self.rows or (0, len(places))
        first = min(a + self.lead_in, len(places) - 1)
        rows = (int(places[a]), int(places[b - 1]) + 1)
        return self.model_copy(update={"rows": rows, "lead_in": int(places[first]) - rows[0]})

    def shares_rows(self, other: RecordTable) -> bool:
        """Whether both have rows of one file in common: they were taken at the same time."""
        (first, end), (begin, last) = self.used_rows, other.used_rows
        return (self.file, self.table) == (other.file, other.table) and max(first, begin) < min(end, last)


class RecordingFile(Section):
    """The file beside the measurements: on which device they were made, and what their columns are."""

    title: str
    """The recording in words, for reports."""
    device: str
    """`name` of the device that it was made on."""
    source: str = ""
    """Who measured it and where it is published."""
    sha256: dict[str, Annotated[str, Field(pattern="^[0-9a-f]{64}$")]] = {}
    """SHA-256 of measurement files that are not kept beside this one, by name without folder; they are checked."""
    kind: Literal["series", "poses"]
    """`series`: motion in time; `poses`: a list of settled poses."""
    layout: Layout = Layout()
    """How the measurement files are written, where they leave it open: decimal mark, separator, what stands for none."""
    low_pass: Annotated[Quantity, In("Hz", positive=True)] | None = None
    """Cut-off of a zero-phase low-pass filter, which all columns and `derivatives` of a series pass."""
    keep_every: Annotated[int, Field(ge=1)] | None = None
    """One row in so many is kept, after the filter. Without it all rows are or, after a low-pass, as many as make four times
    its cut-off: more hold nothing more."""
    columns: dict[str, Column] = {}
    """Columns by signal of the model, such as `"drive.1X"` or `"reading.delta_x"`, for every record."""
    derivatives: dict[str, Derivative] = {}
    """Signals that were not recorded, by their name: derivatives of recorded ones."""
    record: Annotated[tuple[RecordTable, ...], Field(min_length=1)]
    """`[[record]]` tables: the measurement files."""

    def columns_of(self, record: RecordTable) -> dict[str, Column]:
        """The columns of one record by signal: its own, else those of the whole file."""
        return {**self.columns, **record.columns}


def deviation(text: str, unit: str) -> float:
    """A standard deviation or tolerance in SI; of a temperature, as a difference. Raises ValueError for text that is none."""
    value = parse_difference(text, unit)
    if value < 0:
        raise ValueError(f"{text!r} is negative")
    return value


def stated_noise(columns: Mapping[str, Column]) -> dict[str, float]:
    """The noise of columns that state it, in SI; without what is no deviation, which `check` tells."""
    noise = {}
    for name, column in columns.items():
        with suppress(ValueError):
            if column.noise:
                noise[name] = deviation(column.noise, column.unit)
    return noise


def check(written: RecordingFile, model: Model) -> list[Fault]:
    """Every fault of the file against the model: device, clock, signals, units, rows, filter."""
    return _Check(written, model).faults


def fits(name: str, column: Column, model: Model) -> bool:
    """Whether a column's name is a signal of the model and its unit has that signal's dimension."""
    try:
        return name in signal_units(model) and same_dimension(column.unit, signal_units(model)[name])
    except ValueError:
        return False


def signal_units(model: Model) -> dict[str, str]:
    """The unit of every channel of the model by its name in a recording: {'drive.1X': 'W', ...}."""
    return {
        f"{role}.{channel}": unit
        for role, signal in model.signals.items()
        for channel, unit in zip(signal.channels, signal.units, strict=True)
    }


class _Check:
    """Collects the faults of one file."""

    def __init__(self, written: RecordingFile, model: Model) -> None:
        self.written, self.model = written, model
        self.faults: list[Fault] = []
        if written.device != model.device.name:
            what = (
                f"{written.device!r} is not {model.device.name!r}, the device given; give the device it was recorded on"
            )
            self._fault("device", what)
        for k, record in enumerate(written.record):
            self._check_time(f"record[{k}]", record)
            self._check_channels(f"record[{k}]", written.columns_of(record))
            self._check_rows(k, record)
        self._check_filter()
        files = {r.file for r in written.record} | {
            c.file for r in written.record for c in r.columns.values() if c.file
        }
        names = {Path(file).name for file in files | {c.file for c in written.columns.values() if c.file}}
        for name in sorted(set(written.sha256) - names):
            self._fault(f"sha256.{name!r}", f"is no file of this recording; its files are {', '.join(sorted(names))}")

    def _fault(self, where: str, what: str) -> None:
        fault = Fault(where, what)
        if fault not in self.faults:
            self.faults.append(fault)

    def _check_time(self, where: str, record: RecordTable) -> None:
        """The record has a clock that fits the kind of recording: one for a series, none for poses."""
        if self.written.kind == "series":
            if (record.time is None) == (record.sample_rate is None):
                what = 'give either time = { column = "...", unit = "s" } or sample_rate = "1 kHz"'
                self._fault(f"{where}.time", what)
            if record.dwell is not None:
                self._fault(f"{where}.dwell", 'is for poses only; leave it out, or write kind = "poses"')
        elif record.gap is not None:
            self._fault(f"{where}.gap", 'is for series only; leave it out, or write kind = "series"')
        elif record.time is not None or record.sample_rate is not None:
            self._fault(
                f"{where}.time", 'poses have no clock; leave it out and give dwell = "2 s" if they did not settle'
            )
        elif record.dwell is not None and self.model.inertial:
            what = "is for stages in balance; this one has inertia: leave it out if the poses settled, else record a series"
            self._fault(f"{where}.dwell", what)
        if record.time is not None:
            self._check_unit(f"{where}.time", record.time, "s")
        ambient = record.conditions.ambient
        if isinstance(ambient, Column):
            self._check_unit(f"{where}.conditions.ambient", ambient, "K")
        elif ambient is not None:
            try:
                parse(ambient, "degC")
            except ValueError as error:
                self._fault(f"{where}.conditions.ambient", str(error))

    def _check_channels(self, where: str, columns: dict[str, Column]) -> None:
        """Every drive has a column, a reading is observed, names are signals of the model, units of their dimension."""
        taken: dict[tuple[object, ...], str] = {}
        for name, column in columns.items():
            same = taken.setdefault((column.column, column.file, column.scale, column.later), name)
            if same != name:
                what = f"is read from column {column.column!r}, as {same} is; name its own, or give a scale if one signal drives both"
                self._fault(f"columns.{name!r}", what)
        units = signal_units(self.model)
        for name, column in columns.items():
            place = "columns" if column is self.written.columns.get(name) else f"{where}.columns"
            if name not in units:
                hint = meant(name, units, f"its signals are {', '.join(self.model.signals)}")
                self._fault(f"{place}.{name!r}", f"is no signal of {self.model.device.name}; {hint}")
            else:
                self._check_unit(f"{place}.{name!r}", column, units[name])
            if column.tolerance is not None and name.startswith("drive."):
                self._fault(f"{place}.{name!r}", "tolerance: is for readings, which are predicted; a drive is given")
        for name, unit in units.items():
            if name.startswith("drive.") and name not in columns and name not in self.written.derivatives:
                what = f'is missing, and the device cannot be simulated without it; add "{name}" = {{ column = "...", unit = "{unit}" }}'
                for of in derived_drives([name], columns).values():
                    what += f', or under [derivatives] "{name}" = {written(*of)}'
                self._fault(f"{where}.columns", f"{name} {what}")
        if all(name.startswith("drive.") for name in columns):
            known = next((name for name in units if name.startswith("reading.")), "reading")
            self._fault(
                f"{where}.columns",
                f'name drives only, no reading to compare with; add "{known}" = {{ column = "...", unit = "..." }}',
            )

    def _check_unit(self, where: str, column: Column, unit: str) -> None:
        try:
            if not same_dimension(column.unit, unit):
                self._fault(
                    where, f"unit = {column.unit!r} is of the wrong dimension; {unit} or a multiple of it is needed"
                )
                return
        except ValueError as error:
            self._fault(where, f"{error}; write for example {unit!r}")
            return
        for key, stated in (("noise", column.noise), ("tolerance", column.tolerance)):
            try:
                if stated is not None and deviation(stated, column.unit) == 0 and key == "tolerance":
                    raise ValueError(
                        f"{stated!r} would call every error large; leave it out, or give a size above zero"
                    )
            except ValueError as error:
                self._fault(where, f"{key}: {error}")

    def _readings(self, record: RecordTable) -> set[tuple[object, ...]]:
        """The columns of a record that are no drive, each by its file, table and column: other columns are other readings."""
        return {
            (c.file or record.file, None if c.file else record.table, c.column)
            for name, c in self.written.columns_of(record).items()
            if not name.startswith("drive.")
        }

    def _check_rows(self, k: int, record: RecordTable) -> None:
        """The rows are not empty, and no reading is used twice, or fitted and held out."""
        if record.rows and record.used_rows[0] >= record.used_rows[1]:
            what = f"{list(record.rows)} is empty" + (f" after a lead-in of {record.lead_in}" if record.lead_in else "")
            self._fault(f"record[{k}].rows", f"{what}; write [first, one past the last]")
        for i, other in enumerate(self.written.record[:k]):
            a, b = record.used_rows, other.used_rows
            twice = self._readings(record) & self._readings(other)
            if max(a[0], b[0]) < min(a[1], b[1]) and "rest" not in (record.role, other.role) and twice:
                file, _, column = min(twice, key=repr)
                what = f"share samples of column {column!r} of {file} with record[{i}]; no reading is fitted twice, or fitted and held out"
                self._fault(f"record[{k}].rows", what)

    def _check_filter(self) -> None:
        """Filter and derivatives are for series only; a derivative is of a recorded column and has the right dimension."""
        w, units = self.written, signal_units(self.model)
        series_only = {"derivatives": w.derivatives, "low_pass": w.low_pass, "keep_every": (w.keep_every or 1) > 1}
        if w.kind == "poses":
            for key in (key for key, given in series_only.items() if given):
                self._fault(key, 'is for series only; leave it out, or write kind = "series"')
        for name, derivative in w.derivatives.items():
            where = f"derivatives.{name!r}"
            if name not in units or not all(derivative.of in w.columns_of(r) for r in w.record):
                what = (
                    f"must be a signal of {self.model.device.name} and `of` a signal that every record has a column for"
                )
                self._fault(where, f"{what}; got {name} of {derivative.of}")
            elif derivative.of in units and not same_dimension(
                f"({units[derivative.of]})/s^{derivative.order}", units[name]
            ):
                self._fault(
                    where,
                    f"derivative {derivative.order} of {derivative.of} does not have the dimension of {name}; check `order` and `of`",
                )
            if any(name in w.columns_of(r) for r in w.record):
                self._fault(where, "is given as a column as well; keep one of the two")

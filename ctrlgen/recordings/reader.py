"""recording.toml and its files -> a `Recording` in SI, validated and never filled in.

`recording.toml` names the files, their columns and units (`ctrlgen.recordings.schema`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import read_toml, validate
from ctrlgen.core.units import parse, same_dimension, to_si
from ctrlgen.model.model import Model
from ctrlgen.recordings import preprocessing, validation
from ctrlgen.recordings.formats import MeasurementTable, read_table
from ctrlgen.recordings.recording import Record, Recording
from ctrlgen.recordings.schema import FILE, Column, RecordingFile, RecordTable, check, deviation, fits


def load_recordings(paths: Sequence[Path | str], model: Model) -> Recording:
    """The recordings in `paths` (recording.toml, or the folders that hold one) joined, each sample judged by the validation.

    At least one record is to be fitted and one held out; where none is named, part of the longest is held out.
    Raises InputError with every fault of every file.
    """
    read = [_File(Path(path), model, many=len(paths) > 1) for path in paths]
    if not read:
        raise InputError("recordings", [Fault("paths", "are none; name a recording.toml")])
    faults = [fault for file in read for fault in file.faults]
    kinds = {file.written.kind for file in read if file.written}
    if len(kinds) > 1:
        faults.append(Fault("kind", "series and poses cannot be joined; diagnose them one after the other"))
    twice = [file.path for k, file in enumerate(read) if file.path.resolve() in [f.path.resolve() for f in read[:k]]]
    faults += [Fault(str(path), "is given twice; name each recording once") for path in twice]
    source = read[0].path if len(read) == 1 else "recordings"
    written = [column for file in read for record in file.columns for column in record.items()]
    channels = tuple(dict.fromkeys(name for name, _ in written if not name.startswith("drive.")))
    first = {name: column.unit for name, column in reversed(written)}
    if faults:
        raise InputError(source, faults + [f for file in read for f in file.judge(channels, first)[2]])
    judged = [file.judge(channels, first) for file in read]
    names = _names(model, channels, tuple(first[name] for name in channels))
    faults = [fault for *_, found in judged for fault in found]
    records = [record for found, *_ in judged for record in found]
    if not faults:
        faults = validation.compare_records([record for _, record in records], [where for where, _ in records], names)
    parts = (
        validation.with_hold_out([record for _, record in records], read[0].written.kind)
        if not faults
        else validation.Validated()
    )
    if faults or parts.faults:
        raise InputError(source, [*faults, *parts.faults])
    noise, said = _noise(channels, written)
    return Recording(
        title=" + ".join(dict.fromkeys(file.written.title for file in read)),
        device=model.device.name,
        kind=read[0].written.kind,
        channels=channels,
        units=names.units,
        noise=noise,
        records=parts.records,
        notes=tuple(note for _, notes, _ in judged for note in notes) + said + parts.notes,
    )


def _names(model: Model, channels: tuple[str, ...], units: tuple[str, ...]) -> validation.ChannelNames:
    drive = model.signals["drive"]
    return validation.ChannelNames(tuple(f"drive.{c}" for c in drive.channels), drive.units, channels, units)


def _noise(
    channels: tuple[str, ...], written: Sequence[tuple[str, Column]]
) -> tuple[tuple[float | None, ...], tuple[str, ...]]:
    """The stated noise of each channel [SI]; where records differ the largest, with a note."""
    stated, notes = [], []
    for channel in channels:
        values = {deviation(c.noise, c.unit) for name, c in written if name == channel and c.noise}
        stated.append(max(values, default=None))
        if len(values) > 1:
            notes.append(f"{channel}: records state different noise; the largest is taken for all.")
    return tuple(stated), tuple(notes)


class _File:
    """One recording.toml, its faults against the model, and its records once read."""

    def __init__(self, path: Path, model: Model, many: bool) -> None:
        self.path, self.model = (path / FILE if path.is_dir() else path), model
        self.prefix = f"{self.path}: " if many else ""
        self.written: RecordingFile | None = None
        self.columns: list[dict[str, Column]] = []
        self.faults: list[Fault] = []
        try:
            self.written = validate(RecordingFile, read_toml(self.path), self.path)
        except InputError as error:
            self.faults = [Fault(self.prefix + fault.where, fault.what) for fault in error.faults]
            return
        self.faults = [Fault(self.prefix + fault.where, fault.what) for fault in check(self.written, model)]
        self.columns = [self.written.columns_of(record) for record in self.written.record]

    def judge(
        self, channels: tuple[str, ...], units: dict[str, str]
    ) -> tuple[list[tuple[str, Record]], list[str], list[Fault]]:
        """The records after the gate with their places, its notes, and every fault of reading and validation."""
        records, notes, faults, spans = [], [], [], []
        if self.written is None:
            return records, notes, faults
        names = _names(self.model, channels, tuple(units[name] for name in channels))
        for k, (record, columns) in enumerate(zip(self.written.record, self.columns, strict=True)):
            where = f"{self.prefix}record[{k}]"
            sound = {name: column for name, column in columns.items() if fits(name, column, self.model)}
            reader = _Reader(self.path.parent, self.written, record, sound, where)
            raw = reader.read(names)
            faults += reader.faults
            if raw is None:
                continue
            raw = replace(raw, name=f"{self.path.resolve().parent.name}/{raw.name}") if self.prefix else raw
            found = validation.validate_record(raw, self.written.kind, self.model, names, where)
            records += [(where, piece) for piece in found.records]
            notes += found.notes
            faults += found.faults
            if found.records:
                spans.append((k, record, found.records[0].time[0], found.records[-1].time[-1]))
        return records, _conditioned(self.written) + notes, faults + self._overlaps(spans)

    def _overlaps(self, spans: list[tuple[int, RecordTable, float, float]]) -> list[Fault]:
        """Records that the common clock, where one is stated, has run at the same time."""
        if not any(record.start for _, record, *_ in spans):
            return []
        return [
            Fault(
                f"{self.prefix}record[{k}].start",
                f"{record.file} begins at {begin:.6g} s, before {other.file} ends ({last:.6g} s); give the start of both",
            )
            for k, record, begin, end in spans
            for _, other, earliest, last in spans
            if other is not record and earliest <= begin < last
        ]


class _Reader:
    """Reads one record's files; collects faults on the way."""

    def __init__(
        self, folder: Path, written: RecordingFile, record: RecordTable, columns: dict[str, Column], where: str
    ) -> None:
        self.folder, self.written, self.record, self.columns, self.where = folder, written, record, columns, where
        self.faults: list[Fault] = []
        self.tables: dict[str, MeasurementTable | None] = {}

    def read(self, names: validation.ChannelNames) -> Record | None:
        """The record before any judgement; None where drives or clock cannot be read. `valid`: the channel was read."""
        r, kind = self.record, self.written.kind
        read = {name: self._column(f"{self.where}.columns.{name!r}", column) for name, column in self.columns.items()}
        values = {name: column for name, column in read.items() if column is not None}
        clock = None if r.time is None else self._column(f"{self.where}.time", r.time)
        ambient = self._ambient(r.conditions.ambient)
        sizes = {name: len(column) for name, column in values.items()}
        sizes |= {} if clock is None else {"time": len(clock)}
        sizes |= {"ambient": len(ambient)} if np.ndim(ambient) else {}
        n = min(sizes.values(), default=0)
        if len(set(sizes.values())) > 1:
            listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
            what = f"columns have different numbers of rows ({listed}); export them together"
            self.faults.append(Fault(self.where, what))
            return None
        if r.rows and n and r.rows[1] > n:
            what = f"{list(r.rows)} ends after the last of {n} rows of {r.file}"
            self.faults.append(Fault(f"{self.where}.rows", what))
        timed = kind == "poses" or clock is not None or (r.time is None and r.sample_rate is not None)
        if not timed:
            return None
        time, period = self._clock(kind, clock, n)
        if kind == "series" and n > 1:
            late = {name: c.later.si for name, c in self.columns.items() if c.later and name in values}
            values |= {name: preprocessing.shifted(values[name], time, lag) for name, lag in late.items()}
            rows = slice(*(r.rows or (0, n)))
            inside = self._conditioned({k: v[rows] for k, v in values.items()}, float(np.median(np.diff(time))))
            values = {name: np.full(n, np.nan) for name in inside}
            for name, column in inside.items():
                values[name][rows] = column
        if any(name not in values for name in names.drives):
            return None
        return self._record(names, values, time, period, ambient)

    def _conditioned(self, values: dict[str, np.ndarray], sample_time: float) -> dict[str, np.ndarray]:
        """The columns after the file's low-pass, with its derivatives; nothing where that cannot be done."""
        w = self.written
        if w.low_pass is not None:
            broken = [name for name, column in values.items() if not np.isfinite(column).all()]
            highest = preprocessing.widest(sample_time, w.keep_every)
            if not 0 < w.low_pass.si <= highest:
                what = f"{w.low_pass.text} is too high for the rows that are kept; write {highest:.4g} Hz or less"
                self.faults.append(Fault(f"{self.where}: low_pass", what))
            if broken:
                what = f"{', '.join(broken)} has rows without a number, which a filter smears; leave them out by rows"
                self.faults.append(Fault(f"{self.where}: low_pass", what))
            if broken or not 0 < w.low_pass.si <= highest:
                return {}
            values = {k: preprocessing.low_passed(v, sample_time, w.low_pass.si) for k, v in values.items()}
        made = {
            name: preprocessing.derived(values[d.of], sample_time, d.order)
            for name, d in w.derivatives.items()
            if d.of in values
        }
        return values | made

    def _clock(self, kind: str, clock: np.ndarray | None, n: int) -> tuple[np.ndarray, float]:
        """Time of every row of the file (n,) [s] and the sample time [s], NaN where the gate must find it."""
        r = self.record
        begin = r.start.si if r.start else 0.0
        if clock is not None:
            finite = clock[np.isfinite(clock)]
            return begin + clock - (finite[0] if len(finite) else 0.0), np.nan
        period = r.dwell.si if r.dwell else np.inf if kind == "poses" else 1 / r.sample_rate.si
        return begin + np.arange(n) * (1.0 if np.isinf(period) else period), period

    def _record(
        self,
        names: validation.ChannelNames,
        values: dict[str, np.ndarray],
        time: np.ndarray,
        period: float,
        ambient: np.ndarray | float | None,
    ) -> Record:
        r, n, every = self.record, len(time), self.written.keep_every
        chosen = slice(*(r.rows or (0, n)), every)
        observed = np.full((n, len(names.observed)), np.nan)
        for i, name in enumerate(names.observed):
            observed[:, i] = values.get(name, np.nan)
        judged = (np.arange(n) >= r.judged[0])[:, None]
        there = np.array([name in values for name in names.observed])
        return Record(
            name=r.file + (f"[{r.rows[0]}:{r.rows[1]}]" if r.rows else ""),
            role=r.role,
            time=time[chosen],
            sample_time=period * every,
            drive=np.column_stack([values[name] for name in names.drives])[chosen],
            observed=np.where(judged, observed, np.nan)[chosen],
            linear=r.between_samples == "linear",
            ambient=None if ambient is None else (np.zeros(n) + ambient)[chosen],
            valid=(judged & there)[chosen],
            period=None if r.period is None else r.period.si,
        )

    def _ambient(self, given: Any) -> np.ndarray | float | None:
        if isinstance(given, Column):
            return self._column(f"{self.where}.conditions.ambient", given)
        try:
            return None if given is None else parse(given, "degC")
        except ValueError:  # the check of the file has said so
            return None

    def _table(self, path: Path) -> MeasurementTable:
        """A file's columns. Raises InputError: one that is stated not to be kept here says where it is published."""
        stated = self.written.sha256.get(path.name)
        if stated is None:
            return read_table(path)
        source = f"{self.written.source or 'its source is not stated'}; file {path.name}, SHA-256 {stated}"
        if not path.is_file():
            what = f"is not here; the recording does not bring it along. Source: {source}. Put it at {path.resolve()}"
            raise InputError(path, [Fault(path.name, what)])
        found = hashlib.sha256(path.read_bytes()).hexdigest()
        if (
            found != stated
        ):  # rows, units and filters were chosen for that file: with another one they would mean something else
            what = f"is another file, SHA-256 {found}. Wanted: {source}. If you mean this one, state its SHA-256 in [sha256]"
            raise InputError(path, [Fault(path.name, what)])
        return read_table(path)

    def _column(self, where: str, column: Column) -> np.ndarray | None:
        """A column in SI (n,); None, with a fault, where it cannot be read."""
        file = column.file or self.record.file
        try:
            if file not in self.tables:
                self.tables[file] = None
                self.tables[file] = self._table(self.folder / file)
        except InputError as error:
            place = f"{self.where}.file" if column.file is None else f"{where}.file"
            self.faults += [Fault(place, f"{file} {fault.what}") for fault in error.faults]
        table = self.tables[file]
        if table is None:
            return None
        try:
            name = table.find(column.column)
            values = table.numbers(name)
        except InputError as error:
            self.faults += [Fault(where, f"{file} {fault.what}") for fault in error.faults]
            return None
        try:
            scale = to_si(1.0, column.unit), to_si(0.0, column.unit)
        except ValueError:  # the check of the file has said so
            return None
        if column.scale == 1 and _contradicts(table.units.get(name), scale, column.unit):
            said = f"{file} says {table.units[name]}, recording.toml says {column.unit}; one of them is wrong"
            self.faults.append(Fault(where, said))
        return column.scale * values * (scale[0] - scale[1]) + scale[1]


def _conditioned(written: RecordingFile) -> list[str]:
    """What was done to the columns before they were judged."""
    columns = {k: c for r in written.record for k, c in written.columns_of(r).items() if c.later}
    done = [f"{name} taken as {c.later.text} later than its rows" for name, c in columns.items()]
    done += [f"derivative {d.order} of {d.of} taken as {name}" for name, d in written.derivatives.items()]
    if written.low_pass is not None:
        done.insert(0, f"every column low-passed alike at {written.low_pass.text}, forward and backward")
    if written.keep_every > 1:
        done.append(f"one row in {written.keep_every} kept")
    return [] if not done else ["Before anything else: " + "; ".join(done) + "."]


def _contradicts(stated: str | None, scale: tuple[float, float], unit: str) -> bool:
    """Whether a file's own unit is another one than the one given; a text that is no unit contradicts nothing."""
    if stated is None:
        return False
    try:
        other = to_si(1.0, stated), to_si(0.0, stated)
        return not same_dimension(stated, unit) or not np.allclose(other, scale, rtol=1e-9, atol=0)
    except ValueError:
        return False

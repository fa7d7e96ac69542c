"""recording.toml and its measurement files -> a `Recording` in SI, validated and never filled in.

What recording.toml may say is in `ctrlgen.recordings.schema`, what refuses a record or marks its samples in
`ctrlgen.recordings.validation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.file_format import in_this_format
from ctrlgen.core.files import read_toml, validate
from ctrlgen.core.one_or_several import several
from ctrlgen.model.model import Model
from ctrlgen.recordings import preprocessing, thinning, validation
from ctrlgen.recordings.begun_elsewhere import begun_elsewhere
from ctrlgen.recordings.common_clock import Stretch, common_clock
from ctrlgen.recordings.formats import READERS
from ctrlgen.recordings.plausible_rate import rate_notes
from ctrlgen.recordings.record_reader import RecordReader
from ctrlgen.recordings.recording import Record, Recording
from ctrlgen.recordings.schema import FILE, Column, RecordingFile, RecordTable, check, deviation, fits, stated_noise
from ctrlgen.recordings.units_of_columns import channel_names

ONE_CLOCK = "the files go on from each other by their columns of time, which are taken as one clock: {}; `start` says otherwise."


def load_recordings(paths: Path | str | Sequence[Path | str], model: Model, *, hold_out: bool = True) -> Recording:
    """The recordings in `paths` (each a recording.toml or the folder that holds one; one alone, or several) joined and validated.

    At least one record must be fitted and one held out; where none has role "hold_out", part of the longest is held out. Without
    `hold_out` every record stays as it is.
    Raises InputError with every fault of every file.
    """
    paths = several(paths)
    files = [_File(Path(path), model, several=len(paths) > 1) for path in paths]
    if not files:
        raise InputError("recordings", [Fault("paths", "are none; name a recording.toml")])
    readable = [(file, file.written) for file in files if file.written is not None]
    faults = [fault for file in files for fault in file.faults]
    if len({written.kind for _, written in readable}) > 1:
        faults.append(
            Fault(
                "kind",
                "is series in one file and poses in another, which cannot be joined; diagnose them one at a time",
            )
        )
    resolved = [file.path.resolve() for file in files]
    twice = [file.path for k, file in enumerate(files) if resolved[k] in resolved[:k]]
    faults += [Fault(str(path), "is given twice; name each recording once") for path in twice]
    source = files[0].path if len(files) == 1 else "recordings"
    columns_of = [written.columns_of(r) for _, written in readable for r in written.record]
    columns = [(name, column) for each in columns_of for name, column in each.items()]
    channels = tuple(dict.fromkeys(name for name, _ in columns if not name.startswith("drive.")))
    names = channel_names(model, [written for _, written in readable], columns, channels)
    every = [file.records(names, alone=len(columns_of) == 1) for file in files]
    m = _rows_for_one(every)
    contents = [file.validated(reads, names, m) for file, reads in zip(files, every, strict=True)]
    faults += [fault for content in contents for fault in content.faults]
    if faults:
        raise InputError(source, faults)
    records = [record for content in contents for record in content.records]
    faults = validation.compare_records(records, [where for content in contents for where in content.places], names)
    kind = readable[0][1].kind
    whole = validation.Validated(tuple(records))
    divided = validation.with_hold_out(records, kind) if hold_out and not faults else whole
    if faults or divided.faults:
        raise InputError(source, [*faults, *divided.faults])
    noise, noise_notes = _stated(channels, columns, "noise")
    noise = tuple(None if sd is None else sd / np.sqrt(m) for sd in noise)
    tolerance, tolerance_notes = _stated(channels, columns, "tolerance")
    recording = Recording(
        title=" + ".join(dict.fromkeys(written.title for _, written in readable)),
        device=model.device.name,
        kind=kind,
        channels=channels,
        units=names.units,
        noise=noise,
        records=divided.records,
        notes=(
            *(note for content in contents for note in content.notes),
            *noise_notes,
            *tolerance_notes,
            *divided.notes,
        ),
        tolerance=tolerance,
        drive_units=names.drive_units,
        drives=names.drives,
    )
    return begun_elsewhere(recording, model)


class _Read(NamedTuple):
    """One [[record]] as read before validation: its number, how it was read, the record of `rows`, None where it cannot be read or is read
    again to be used, how far it can be thinned where it is long, the times of its first and last row [s], and how much later than the
    earliest file its file began, where the columns of time tell it."""

    k: int
    reader: RecordReader
    record: Record | None
    rows: int
    can: thinning.Thinnable | None
    ends: tuple[float, float] | None
    later: float | None = None


def _rows_for_one(every: Sequence[Sequence[_Read]]) -> int:
    """How many rows of all records one stands for: 1 where none is long."""
    reads = [read for reads in every for read in reads]
    if all(read.can is None for read in reads):
        return 1
    beside = [read.record for read in reads if read.can is None and read.record is not None and not _is_rest(read)]
    short = [thinning.thinnable(thinning.marked(record), thinning.FEWEST) for record in beside]
    return thinning.common([*(read.can for read in reads if read.can is not None and not _is_rest(read)), *short])


def _on_one_clock(reads: list[_Read]) -> list[_Read]:
    """The records of one recording.toml, each with how much `later` its file began [s], where their columns of time tell it."""
    stretches = []
    for read in reads:
        begin = read.reader.first_time
        if begin is None or read.ends is None:
            return reads
        stretches.append(Stretch(read.reader.table.file, begin, *(begin + end for end in read.ends)))
    later = common_clock(stretches)
    return reads if later is None else [read._replace(later=later[read.reader.table.file]) for read in reads]


def _is_rest(read: _Read) -> bool:
    return read.reader.table.role == "rest"


def _stated(
    channels: tuple[str, ...], columns: Sequence[tuple[str, Column]], key: Literal["noise", "tolerance"]
) -> tuple[tuple[float | None, ...], list[str]]:
    """The stated noise (standard deviation) or tolerance of each channel [SI], and notes where records differ.

    Of different noise the largest is taken, of different tolerances the smallest.
    """
    worst, which = (max, "largest") if key == "noise" else (min, "smallest")
    stated: list[float | None] = []
    notes = []
    for channel in channels:
        texts = {(text, c.unit) for name, c in columns if name == channel and (text := getattr(c, key))}
        values = {deviation(text, unit) for text, unit in texts}
        stated.append(worst(values, default=None))
        if len(values) > 1:
            notes.append(f"{channel}: records state different {key}; the {which} is taken for all of them.")
    return tuple(stated), notes


@dataclass(frozen=True)
class _Content:
    """What one recording.toml gives: validated records, their places in it, notes, and every fault of its files."""

    records: tuple[Record, ...] = ()
    places: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()


def _described(path: Path) -> dict[str, Any]:
    """The tables of a recording.toml. Raises InputError, also for a file that is plainly something else."""
    if path.suffix.lower() in READERS:
        what = (
            f"is a measurement; name the {FILE} that describes it"
            if path.exists()
            else "does not exist; check the path"
        )
        raise InputError(path, [Fault("file", what)])
    table = read_toml(path)
    if "record" not in table and ("path" in table or "name" in table):
        what = f"describes a {'scenario' if 'path' in table else 'device'}; name a {FILE}"
        raise InputError(path, [Fault("file", what)])
    return in_this_format(table, path)


class _File:
    """One recording.toml and its faults against the model; `written` is None where it is not a valid file."""

    def __init__(self, path: Path, model: Model, several: bool) -> None:
        self.path, self.model = (path / FILE if path.is_dir() else path), model
        self.prefix = f"{self.path}: " if several else ""
        self.written: RecordingFile | None = None
        try:
            self.written = validate(RecordingFile, _described(self.path), self.path)
            faults: Sequence[Fault] = check(self.written, model)
        except InputError as error:
            faults = error.faults
        self.faults = [Fault(self.prefix + fault.where, fault.what) for fault in faults]

    def records(self, names: validation.ChannelNames, alone: bool) -> list[_Read]:
        """The records with their columns in SI. Of a long one how far it can be thinned: it is kept only where it is `alone`."""
        if self.written is None:
            return []
        reads = []
        by_itself = self.written.kind == "series" and self.written.low_pass is None and self.written.keep_every is None
        for k in range(len(self.written.record)):
            reader, record = self._read(k, names)
            can, rows = None, 0 if record is None else len(record.time)
            if record is not None and by_itself and rows > thinning.LONG:
                record = thinning.marked(record)
                can = thinning.thinnable(record, thinning.ENOUGH)
            ends = (
                None if record is None or not rows else (float(np.nanmin(record.time)), float(np.nanmax(record.time)))
            )
            reads.append(_Read(k, reader, record if can is None or alone else None, rows, can, ends))
        return _on_one_clock(reads)

    def _read(self, k: int, names: validation.ChannelNames) -> tuple[RecordReader, Record | None]:
        assert self.written is not None  # it was read
        table = self.written.record[k]
        sound = {n: c for n, c in self.written.columns_of(table).items() if fits(n, c, self.model)}
        reader = RecordReader(self.path.parent, self.written, table, sound, f"{self.prefix}record[{k}]")
        return reader, reader.read(names)

    def _thinned(self, read: _Read, names: validation.ChannelNames, m: int) -> tuple[Record | None, list[str]]:
        """The record with one row for m, and what was done to it."""
        record = read.record
        if record is None and read.can is not None:
            record = self._read(read.k, names)[1]
        if record is None:
            return None, []
        record = replace(record, time=record.time + (read.later or 0.0))
        if m == 1:
            said = [] if read.can is None else [thinning.not_thinned(record.name, read.rows, read.can.why)]
            return record, said
        if _is_rest(read) and read.rows < thinning.FEWEST * m:
            return None, [
                f"{record.name}: of its {number_of(read.rows, 'row')} too few would be left beside the others; not used."
            ]
        before = int(np.isfinite(record.observed).sum())
        record = thinning.marked(record)
        lost = before - int(record.valid.sum())
        thin = thinning.thinned(record, m, read.can or thinning.thinnable(record, thinning.FEWEST))
        return thin, [thinning.note(thin, m, read.rows, lost)]

    def validated(self, reads: Sequence[_Read], names: validation.ChannelNames, m: int) -> _Content:
        """The records, with one row for `m` of them, validated one by one."""
        if self.written is None:
            return _Content()
        records: list[Record] = []
        places: list[str] = []
        notes = preprocessing.notes(self.written)
        faults: list[Fault] = []
        spans: list[tuple[int, RecordTable, float, float]] = []
        for read in reads:
            k, reader = read.k, read.reader
            table, where = self.written.record[k], reader.where
            record, thinning_notes = self._thinned(read, names, m)
            notes += thinning_notes
            faults += reader.faults
            if record is None:
                continue
            record = replace(record, name=f"{self.path.resolve().parent.name}/{record.name}") if self.prefix else record
            noise = {name: sd / np.sqrt(m) for name, sd in stated_noise(reader.columns).items()}
            result = validation.validate_record(record, self.written.kind, self.model, names, where, table.gap, noise)
            records += result.records
            places += [where] * len(result.records)
            notes += [note for note in reader.notes if note not in notes] + list(result.notes)
            dated = reader.read_from.dated
            notes += rate_notes(result.records, self.model, table, dated) if self.written.kind == "series" else []
            faults += result.faults
            if result.records:
                spans.append((k, table, result.records[0].time[0], result.records[-1].time[-1]))
        if later := {read.reader.table.file: read.later for read in reads if read.later is not None}:
            notes.append(ONE_CLOCK.format(", ".join(f"{file} at {begin:.6g} s" for file, begin in later.items())))
        return _Content(tuple(records), tuple(places), tuple(notes), (*faults, *self._overlaps(spans)))

    def _overlaps(self, spans: list[tuple[int, RecordTable, float, float]]) -> list[Fault]:
        """Faults of records that overlap on their common clock, where the start of any is stated."""
        if not any(table.start for _, table, *_ in spans):
            return []
        return [
            Fault(
                f"{self.prefix}record[{k}].start",
                f"{table.file} begins at {begin:.6g} s, before {other.file} ends ({last:.6g} s); give the start of both",
            )
            for k, table, begin, _ in spans
            for _, other, earliest, last in spans
            if other is not table and earliest <= begin < last and not table.shares_rows(other)
        ]

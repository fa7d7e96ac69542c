"""One [[record]] of recording.toml -> a `Record` in SI, before it is validated."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault
from ctrlgen.core.units import parse
from ctrlgen.recordings import preprocessing, validation
from ctrlgen.recordings.formats.measurement_table import Clock
from ctrlgen.recordings.gaps import SHORTEST
from ctrlgen.recordings.recorded_columns import RecordedColumns
from ctrlgen.recordings.recording import Record
from ctrlgen.recordings.schema import Column, RecordingFile, RecordTable


class RecordReader:
    """Reads one [[record]] from its files; `faults` collects what is wrong on the way."""

    def __init__(
        self, folder: Path, written: RecordingFile, table: RecordTable, columns: dict[str, Column], where: str
    ) -> None:
        self.written, self.table, self.columns, self.where = written, table, columns, where
        self.read_from = RecordedColumns(folder, written, table, where)
        self.faults, self.rows, self.notes = self.read_from.faults, table.rows, self.read_from.notes
        # [s] of the first row, by a column of time that says when the record was
        self.first_time: float | None = None
        self.file = str(folder / table.file)
        self.name = table.file + (f"[{table.rows[0]}:{table.rows[1]}]" if table.rows else "")

    def read(self, names: validation.ChannelNames) -> Record | None:
        """The record before validation; None where drives or clock cannot be read. `valid`: the channel has a column."""
        table, kind = self.table, self.written.kind
        values = self.read_from.signals(self.columns)
        clock = None if table.time is None else self.read_from.column(f"{self.where}.time", table.time)
        foreign = {name: values.pop(name) for name in list(values) if self.columns[name].sample_rate}
        clocks = self.read_from.own_clocks(list(values), clock)
        foreign |= {name: values.pop(name) for name in clocks}
        ambient = self._ambient(table.conditions.ambient)
        self.read_from.files.clear()  # of a long file, as much again as the columns
        sizes = {name: len(column) for name, column in values.items()}
        sizes |= {} if clock is None else {"time": len(clock)}
        sizes |= {"ambient": len(ambient)} if isinstance(ambient, np.ndarray) else {}
        n = min(sizes.values(), default=0)
        if len(set(sizes.values())) > 1:
            listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
            self._fault("", f"its columns have different numbers of rows ({listed}); export them together")
            return None
        if table.rows and n and table.rows[1] > n:
            self._fault(".rows", f"{list(table.rows)} ends after the last of {number_of(n, 'row')} of {table.file}")
            return None
        if kind == "series" and clock is None and (table.time is not None or table.sample_rate is None):
            return None
        time, period = self._clock(kind, clock, n)
        if self.written.low_pass and clock is not None and (places := preprocessing.rows_on_grid(time)) is not None:
            self.table, values = (
                self.table.at_rows(places),
                {k: preprocessing.spread(v, places) for k, v in values.items()},
            )
            ambient = preprocessing.spread(ambient, places) if isinstance(ambient, np.ndarray) else ambient
            time = np.interp(np.arange(places[-1] + 1), places, time)
            self.notes.append(preprocessing.grid_note(self.name, places))
        if kind == "series" and n > 1:
            values |= {name: self._resampled(name, column, time, clocks) for name, column in foreign.items()}
            values = self._preprocessed(values, time)
            self._check_thinned(float(np.median(np.diff(time))))
        if any(name not in values for name in names.drives) or any(": " in fault.where for fault in self.faults):
            return None
        return self._record(names, values, time, period, ambient)

    def _fault(self, key: str, what: str) -> None:
        self.faults.append(Fault(f"{self.where}{key}", what))

    def _preprocessed(self, values: dict[str, np.ndarray], time: np.ndarray) -> dict[str, np.ndarray]:
        """The columns delayed, low-passed and differentiated as the file says, NaN outside the record's rows."""
        n = len(time)
        late = {name: c.later.si for name, c in self.columns.items() if c.later and name in values}
        values = values | {name: preprocessing.delayed(values[name], time, lag) for name, lag in late.items()}
        moved = [np.isfinite(values[name]) for name in values if name in late or self.columns[name].sample_rate]
        self.rows = preprocessing.inner_rows(moved, *(self.table.rows or (0, n)))
        rows, step = slice(*self.rows), float(np.median(np.diff(time)))
        if not step > 0:  # the clock itself is at fault, which validation says
            return values
        if self.rows == (0, n) and self.written.low_pass is None and not self.written.derivatives:
            return values  # without a copy, for a long record
        inside = self._filtered({k: v[rows] for k, v in values.items()}, step)
        whole = {name: np.full(n, np.nan) for name in inside}
        for name, column in inside.items():
            whole[name][rows] = column
        return whole

    def _resampled(self, name: str, values: np.ndarray, time: np.ndarray, clocks: dict[str, Clock]) -> np.ndarray:
        """A column (m,) of another recorder at the record's `time` (n,) [s]: both began at once, or it states its own clock."""
        rate = self.columns[name].sample_rate
        start, step = clocks[name] if name in clocks else (0.0, 1 / rate.si if rate else 1.0)
        return preprocessing.resampled(values, start + step * np.arange(len(values)), time - time[0])

    def _filtered(self, values: dict[str, np.ndarray], sample_time: float) -> dict[str, np.ndarray]:
        """The columns after the file's low-pass, with its derivatives; empty, with a fault, where that cannot be done."""
        w, missing = self.written, dict[str, np.ndarray]()
        if w.low_pass is not None:
            longest = preprocessing.longest_gap(sample_time, w.low_pass.si)
            missing = {name: ~np.isfinite(column) for name, column in values.items() if not name.startswith("drive.")}
            values = {name: preprocessing.bridged(column, longest) for name, column in values.items()}
            incomplete = [name for name, column in values.items() if not np.isfinite(column).all()]
            highest = preprocessing.highest_cutoff(sample_time, self._kept(sample_time))
            if odd := preprocessing.cannot_pass(w.low_pass, highest, min(map(len, values.values()), default=0)):
                self._fault(": low_pass", odd)
            if incomplete:
                what = f"{', '.join(incomplete)} has rows without a number, which a filter would smear; leave them out with `rows`"
                self._fault(": low_pass", what)
            if incomplete or odd:
                return {}
            values = {k: preprocessing.low_passed(v, sample_time, w.low_pass.si) for k, v in values.items()}
        derivatives = {
            name: preprocessing.derivative(values[d.of], sample_time, d.order)
            for name, d in w.derivatives.items()
            if d.of in values
        }
        whole = values | derivatives
        for name, lost in missing.items():
            readings = (k for k in whole if k == name or (k in derivatives and w.derivatives[k].of == name))
            whole |= {k: np.where(lost, np.nan, whole[k]) for k in readings if not k.startswith("drive.")}
        return whole

    def _check_thinned(self, sample_time: float) -> None:
        """A fault where the filter leaves too few rows of a record that has enough of them."""
        first, last = self.rows or (0, 0)
        if not np.isfinite(sample_time):  # a clock that has a fault of its own
            return
        every, least = self._kept(sample_time), SHORTEST["series"]
        if last - first < least or (last - first) // every >= least:
            return
        what = f"leaves {(last - first) // every} of {number_of(last - first, 'row')}, one in {every}, and {least} are needed"
        if self.written.keep_every is None and self.written.low_pass is not None:
            lowest = preprocessing.lowest_cutoff(sample_time, (last - first) // least)
            self._fault(
                ": low_pass", f"{self.written.low_pass.text} {what}; write {lowest:.4g} Hz or more, or record longer"
            )
        else:
            self._fault(": keep_every", f"{what}; write {(last - first) // least} or less, or record longer")

    def _kept(self, sample_time: float) -> int:
        """The number n of which every n-th row is kept, where rows are `sample_time` [s] apart."""
        w = self.written
        return w.keep_every or (preprocessing.enough_rows(sample_time, w.low_pass.si) if w.low_pass else 1)

    def _clock(self, kind: str, clock: np.ndarray | None, n: int) -> tuple[np.ndarray, float]:
        """Time of every row of the file (n,) [s] and the sample time [s], NaN where validation must find it."""
        table = self.table
        begin = table.start.si if table.start else 0.0
        if clock is not None:
            finite = clock[np.isfinite(clock)]
            self.first_time = None if table.start else self.read_from.begin
            return begin + clock - (finite[0] if len(finite) else 0.0), np.nan
        unclocked = 1 / table.sample_rate.si if kind == "series" and table.sample_rate else np.inf
        period = table.dwell.si if table.dwell else unclocked
        return begin + np.arange(n) * (1.0 if np.isinf(period) else period), period

    def _record(
        self,
        names: validation.ChannelNames,
        values: dict[str, np.ndarray],
        time: np.ndarray,
        period: float,
        ambient: np.ndarray | float | None,
    ) -> Record:
        """The rows that are kept, as a record: the lead-in drives the device, but its readings are not valid."""
        table, n = self.table, len(time)
        every = self._kept(float(np.median(np.diff(time)))) if n > 1 else 1
        kept = slice(*(self.rows or (0, n)), every)
        drive = np.column_stack([values.pop(name) for name in names.drives])
        observed = np.full((n, len(names.observed)), np.nan)
        for i, name in enumerate(names.observed):
            observed[:, i] = values.get(name, np.nan)
        recorded = np.array([name in values for name in names.observed], dtype=bool)
        values.clear()
        after_lead_in = (np.arange(n) >= table.used_rows[0])[:, None]
        observed[~after_lead_in[:, 0]] = np.nan
        return Record(
            name=self.name,
            file=self.file,
            role=table.role,
            time=time[kept],
            sample_time=period * every,
            drive=drive[kept],
            observed=observed[kept],
            linear=table.between_samples != "held",
            either=table.between_samples == "unstated" and self.written.kind == "series",
            poses=self.written.kind == "poses",
            ambient=None if ambient is None else (np.zeros(n) + ambient)[kept],
            valid=(after_lead_in & recorded)[kept],
            period=None if table.period is None else table.period.si,
            band=None if self.written.low_pass is None else self.written.low_pass.si,
            resumed=self.written.kind == "series" and table.begins_within,
        )

    def _ambient(self, given: str | Column | None) -> np.ndarray | float | None:
        """The ambient temperature [K]: recorded (n,), constant, or None."""
        if isinstance(given, Column):
            return self.read_from.column(f"{self.where}.conditions.ambient", given)
        try:
            return None if given is None else parse(given, "degC")
        except ValueError:  # already among the faults of recording.toml
            return None

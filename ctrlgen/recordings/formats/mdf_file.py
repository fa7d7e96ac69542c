"""ASAM MDF, versions 3 and 4: channels raster by raster, invalid readings left out."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.recordings.formats.checked_files import fault, package
from ctrlgen.recordings.formats.measurement_table import Clock, MeasurementTable
from ctrlgen.recordings.formats.nested_columns import columns_of
from ctrlgen.recordings.formats.written_layout import Layout

LISTED = 4  # channels that tell a raster from the others
EVEN = 1e-3  # of its step: as far as a raster may be off a clock
TOGETHER = "all rasters, each channel on its own clock"


@dataclass
class _Raster:
    """The channels that were sampled at the times `clock` [s]."""

    clock: np.ndarray
    columns: dict[str, np.ndarray] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def title(self) -> str:
        """'u, x every 0.001 s', as a reader is asked which raster he wants."""
        step = f" every {np.median(np.diff(self.clock)):.4g} s" if len(self.clock) > 1 else ""
        listed = list(self.columns)[:LISTED]
        return ", ".join(listed) + (", ..." if len(self.columns) > LISTED else "") + step

    def take(self, path: Path, signal: Any) -> None:
        """Adds a channel; readings that are marked invalid become NaN."""
        if signal.name in self.units:
            raise fault(path, f"channel {signal.name!r} occurs in several groups of one raster; keep one")
        invalid = None if signal.invalidation_bits is None else np.asarray(signal.invalidation_bits, dtype=bool)
        for column in columns_of(np.asarray(signal.samples), signal.name):
            values = column.values
            if invalid is not None and invalid.any():
                values = np.where(invalid, np.nan, values.astype(float))
                marked = number_of(int(invalid.sum()), f"reading of {column.name} is", f"readings of {column.name} are")
                self.notes.append(f"{marked} marked invalid: left out")
            self.columns[column.name] = values
            self.units[column.name] = signal.unit

    def table(self, path: Path, layout: Layout) -> MeasurementTable:
        """Its columns, behind their time."""
        columns = {"time": self.clock, **{name: column for name, column in self.columns.items() if name != "time"}}
        stated = {name: unit for name, unit in {"time": "s", **self.units}.items() if unit}
        return MeasurementTable(path, columns, stated, notes=tuple(self.notes), missing=layout.missing)


def read(path: Path, layout: Layout) -> dict[str, MeasurementTable]:
    """A table a raster: its channels by name, `time` is the master channel; where all are even, also one table of them all. A file of one
    raster is one table."""
    asammdf = package("asammdf", path)
    rasters: list[_Raster] = []
    with asammdf.MDF(path) as file:
        for signal in file.iter_channels(skip_master=True):
            clock = np.array(signal.timestamps)
            same = next((r for r in rasters if np.array_equal(r.clock, clock)), None)
            if same is None:
                rasters.append(same := _Raster(clock))
            same.take(path, signal)
    if not rasters:
        return {"data": MeasurementTable(path, {}, {}, missing=layout.missing)}
    tables = {raster.title: raster.table(path, layout) for raster in rasters}
    return tables | _together(path, rasters, layout)


def _together(path: Path, rasters: list[_Raster], layout: Layout) -> dict[str, MeasurementTable]:
    """One table of the channels of several even rasters, each on its own clock; none where a raster is uneven or a name occurs twice."""
    names = [name for raster in rasters for name in raster.columns if name != "time"]
    if len(rasters) < 2 or len(set(names)) < len(names) or not all(map(_is_even, rasters)):
        return {}
    n = max(len(raster.clock) for raster in rasters)
    columns, units, clocks = dict[str, np.ndarray](), dict[str, str](), dict[str, Clock]()
    for raster in rasters:
        clock = Clock(float(raster.clock[0]), float(np.median(np.diff(raster.clock))))
        for name, values in {f"time of {raster.title}": raster.clock, **raster.columns}.items():
            if name == "time" or values.dtype.kind not in "iufb":
                continue
            columns[name] = np.concatenate([values.astype(float), np.full(n - len(values), np.nan)])
            units |= {name: unit} if (unit := raster.units.get(name, "" if name in raster.columns else "s")) else {}
            clocks |= {name: clock} if name in raster.columns else {}
    notes = tuple(note for raster in rasters for note in raster.notes)
    return {TOGETHER: MeasurementTable(path, columns, units, notes=notes, clocks=clocks, missing=layout.missing)}


def _is_even(raster: _Raster) -> bool:
    steps = np.diff(raster.clock)
    return len(steps) > 1 and bool(np.all(np.abs(steps - np.median(steps)) < EVEN * np.median(steps)))

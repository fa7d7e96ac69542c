"""ASAM MDF, versions 3 and 4: channels raster by raster, invalid readings left out."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.recordings.formats.checked_files import fault, package
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.nested_columns import columns_of
from ctrlgen.recordings.formats.written_layout import Layout

LISTED = 4  # channels that tell a raster from the others


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
    """A table a raster: its channels by name, `time` is the master channel. A file of one raster is one table."""
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
    return {raster.title: raster.table(path, layout) for raster in rasters}

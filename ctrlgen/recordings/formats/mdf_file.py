"""ASAM MDF, versions 3 and 4: channels on one raster, invalid readings left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ctrlgen.recordings.formats.checked_files import fault, package
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.nested_columns import columns_of
from ctrlgen.recordings.formats.written_layout import Layout


def read(path: Path, layout: Layout) -> dict[str, MeasurementTable]:
    """Channels by name; `time` is the master channel. Raises InputError where channels have different ones."""
    asammdf = package("asammdf", path)
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    clocks: list[np.ndarray] = []
    notes: list[str] = []
    with asammdf.MDF(path) as file:
        for signal in file.iter_channels(skip_master=True):
            if signal.name in columns:
                raise fault(path, f"channel {signal.name!r} occurs in several groups; keep one")
            invalid = signal.invalidation_bits
            invalid = None if invalid is None else np.asarray(invalid, dtype=bool)
            for column in columns_of(np.asarray(signal.samples), signal.name):
                values = column.values
                if invalid is not None and invalid.any():
                    values = np.where(invalid, np.nan, values.astype(float))
                    notes.append(f"{int(invalid.sum())} readings of {column.name} are marked invalid: left out")
                columns[column.name] = values
                units[column.name] = signal.unit
            clocks.append(np.array(signal.timestamps))
    if any(not np.array_equal(clock, clocks[0]) for clock in clocks):
        raise fault(
            path, "holds channels sampled at different times; resample them to one raster (MDF.resample) and save"
        )
    if clocks:
        columns = {"time": clocks[0], **{name: column for name, column in columns.items() if name != "time"}}
        units = {"time": "s", **units}
    stated = {name: unit for name, unit in units.items() if unit}
    return {"data": MeasurementTable(path, columns, stated, notes=tuple(notes), missing=layout.missing)}

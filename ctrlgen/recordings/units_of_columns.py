"""The units in which a reader states the drives and readings of a recording: those of its columns."""

from __future__ import annotations

from collections.abc import Sequence

from ctrlgen.devices.reported_units import derived_unit, serves
from ctrlgen.model.model import Model
from ctrlgen.recordings.schema import Column, RecordingFile
from ctrlgen.recordings.validation import ChannelNames


def channel_names(
    model: Model, written: Sequence[RecordingFile], columns: Sequence[tuple[str, Column]], channels: tuple[str, ...]
) -> ChannelNames:
    """Names of drives and of the observed `channels`, each with the unit of its first column; a derivative has that of its source over
    time. A drive that has no column, or one of a wrong unit, keeps the unit of the model."""
    units = {name: column.unit for name, column in reversed(columns)}
    derived = {
        name: derived_unit(units[d.of], d.order)
        for file in written
        for name, d in file.derivatives.items()
        if d.of in units
    }
    drive = model.signals["drive"]
    drives = {f"drive.{c}": unit for c, unit in zip(drive.channels, drive.units, strict=True)}
    told = {name: {**derived, **units}.get(name, unit) for name, unit in drives.items()}
    return ChannelNames(
        tuple(drives),
        tuple(told[name] if serves(told[name], unit) else unit for name, unit in drives.items()),
        channels,
        tuple(units[name] for name in channels),
    )

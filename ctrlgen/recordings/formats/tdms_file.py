"""TDMS of LabVIEW: channels by group, waveforms with their own time, instants."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ctrlgen.recordings.formats.checked_files import check_size, package
from ctrlgen.recordings.formats.measurement_table import Clock, MeasurementTable
from ctrlgen.recordings.formats.nested_columns import columns_of
from ctrlgen.recordings.formats.stated_rate import rate_of
from ctrlgen.recordings.formats.unapplied import NI_SCALE, factors_of, scale_of_counts, unapplied
from ctrlgen.recordings.formats.written_layout import Layout

UNSET = 1.0  # s: the time between readings of a waveform whose programmer did not set it


def read(path: Path, layout: Layout) -> dict[str, MeasurementTable]:
    """Channels as `group/channel`; their unit is the property `unit_string`, their time `wf_start_offset` and `wf_increment`."""
    nptdms = package("nptdms", path)
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    notes: list[str] = []
    scales: dict[str, float] = {}
    starts: dict[str, tuple[np.datetime64 | None, float, float]] = {}
    with nptdms.TdmsFile.open(path) as file:
        channels = [(group, channel) for group in file.groups() for channel in group.channels()]
        check_size(path, sum(8.0 * len(channel) for _, channel in channels))
        for group, channel in channels:
            for column in columns_of(np.asarray(channel[:]), f"{group.name}/{channel.name}"):
                columns[column.name] = column.values
                given = channel.properties
                factors = factors_of(item for item in given.items() if not item[0].startswith(NI_SCALE))
                notes += unapplied(column.name, factors)
                if (scale := scale_of_counts(np.asarray(column.values), factors)) is not None:
                    scales[column.name] = scale
                if given.get("unit_string"):
                    units[column.name] = str(given["unit_string"])
                if given.get("wf_increment") == UNSET:
                    notes.append(
                        f"wf_increment of {channel.name} is 1 s, which LabVIEW writes where nobody set it: not compared"
                    )
                elif given.get("wf_increment"):
                    begin = given.get("wf_start_time")
                    instant = None if begin is None else np.datetime64(begin)
                    starts[column.name] = (
                        instant,
                        float(given.get("wf_start_offset", 0.0)),
                        float(given["wf_increment"]),
                    )
    steps = {step for _, _, step in starts.values()}
    rate = rate_of(("wf_increment", step) for step in steps) if len(steps) == 1 else None
    return {
        "data": MeasurementTable(
            path,
            columns,
            units,
            clocks=_clocks(starts),
            notes=tuple(notes),
            missing=layout.missing,
            stated_rate=rate,
            scales=scales,
        )
    }


def _clocks(starts: dict[str, tuple[np.datetime64 | None, float, float]]) -> dict[str, Clock]:
    """The time axis of each waveform on one clock, whose zero is the earliest start time."""
    instants = [
        instant for instant, *_ in starts.values() if instant is not None and instant > np.datetime64("1971-01-01")
    ]
    first = min(instants, default=None)
    clocks = {}
    for name, (instant, offset, step) in starts.items():
        late = (
            0.0
            if instant is None or first is None or instant < first
            else float((instant - first) / np.timedelta64(1, "ns")) * 1e-9
        )
        clocks[name] = Clock(late + offset, step)
    return clocks

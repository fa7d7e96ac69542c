"""A recording: what a device was driven with and what was measured, in SI."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ctrlgen.core.shown import Shown
from ctrlgen.core.tabular import Column, Drawn, Tabular
from ctrlgen.core.units import from_si
from ctrlgen.recordings.smooth_drive import with_lines_as_strong


class Timing(NamedTuple):
    """What of a record a simulation is built for: see `Record`. `poses`: each drive is held for a sample time and read at its end."""

    sample_time: float
    linear: bool = False
    poses: bool = False
    resumed: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Record(Shown):
    """One uninterrupted run, SI; n samples of n_u drives and n_y observed channels.

    `name`: file and rows. `role`: fit, hold_out or rest. `time` (n,) [s] on the clock common to the records of one
    recording.toml; the pose's number for settled poses. `sample_time` [s]; of poses the dwell, inf where they settled.
    `drive` (n, n_u) in the order of `model.signals["drive"].channels`, always finite. `observed` (n, n_y) in the order of
    `Recording.channels`, NaN where not `valid` (n, n_y): missing, in a gap, an outlier, stuck, or belonging to the other
    part of a divided record. `linear`: the drive is linear between samples; otherwise it is held. `poses`: a row is the
    drive of a pose and what was read at the end of its dwell; otherwise drive and reading of one instant. `ambient` (n,)
    [K], None where not given. `period` [s] after which the drive is stated to repeat, None where it is not. `band` [Hz]:
    cut-off of the low-pass that every column passed, half of the amplitude there and less than a hundredth an octave above;
    None where nothing was filtered. Half of `1/sample_time` is the highest frequency that the rows can hold. `spikes`: row,
    channel and deviation [SI] from its
    neighbours of each outlier that was marked. `held`: first row, row behind the last and channel of each stretch in which a
    reading was found to be held although the device moves. `resumed`: the device had moved before it, after a gap in which the drive is not
    known, in the rest of a divided record or before the first row, so that what it remembers of that is not known either.
    `smooth`: the drive is a curve between samples, not one of straight lines, as which `applied` has it; it is `linear` too.
    `either`: nobody stated what the drive does between samples; `linear` and `smooth` are what is taken. `file`: that of which it is a
    part, empty where it is of none.
    """

    name: str
    role: str
    time: np.ndarray
    sample_time: float
    drive: np.ndarray
    observed: np.ndarray
    linear: bool
    ambient: np.ndarray | None
    valid: np.ndarray
    period: float | None = None
    band: float | None = None
    spikes: tuple[tuple[int, int, float], ...] = ()
    poses: bool = False
    held: tuple[tuple[int, int, int], ...] = ()
    resumed: bool = False
    either: bool = False
    file: str = ""
    smooth: bool = False

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "file": self.name,
            "role": self.role,
            "samples": len(self.time),
            "step": "settled poses" if np.isinf(self.sample_time) else f"{self.sample_time:.6g} s",
            "usable": f"{100 * self.valid.mean():.3g} %" if self.valid.size else "none",
        }

    def __post_init__(self) -> None:
        if np.isinf(self.sample_time):  # not where it is still to be found
            object.__setattr__(self, "poses", True)

    @cached_property
    def applied(self) -> np.ndarray:
        """(n, n_u) the drive as a simulation takes it: held, or in straight lines (`with_lines_as_strong` of one that is `smooth`)."""
        return with_lines_as_strong(self.drive) if self.smooth else self.drive

    @property
    def timing(self) -> Timing:
        """What a simulation of this record is built for."""
        return Timing(self.sample_time, self.linear, self.poses, self.resumed)


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Tabular, Drawn):
    """Records of one device.

    `kind`: "series" or "poses". `channels` observed, such as 'reading.delta_x', with the reader's `units` and the stated
    standard deviation of their `noise` in SI, None where none is stated. `notes`: what validation marked or could not do.
    `tolerance`: error of each channel in SI that does not matter to the reader, None where none is stated. `drive_units`: the reader's
    unit of each drive of the model, empty where they are the model's. `drives`: their names, such as 'drive.1X',
    empty where they were not told.
    """

    title: str
    device: str
    kind: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    noise: tuple[float | None, ...]
    records: tuple[Record, ...]
    notes: tuple[str, ...]
    tolerance: tuple[float | None, ...] = ()
    drive_units: tuple[str, ...] = ()
    drives: tuple[str, ...] = ()

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "title": self.title,
            "device": self.device,
            "readings": ", ".join(f"{c} [{u}]" for c, u in zip(self.channels, self.units, strict=True)),
            "records": ", ".join(f"{len(r.time)} {r.role}" for r in self.records),
        }

    def columns(self) -> tuple[Column, ...]:
        """Time, the record and its role, drives and readings in the reader's units, of all records one after the other; NaN where a
        reading is not valid."""
        tables = [self.columns_of(record) for record in self.records]
        names, roles = (
            np.repeat([getattr(r, n) for r in self.records], [len(r.time) for r in self.records])
            for n in ("name", "role")
        )
        joined = [replace(c[0], values=np.concatenate([each.values for each in c])) for c in zip(*tables, strict=True)]
        return (joined[0], Column("record", "", names), Column("role", "", roles), *joined[1:])

    def columns_of(self, record: Record) -> tuple[Column, ...]:
        """Those of one record."""
        observed = np.where(record.valid, record.observed, np.nan)
        index = Column("pose", "", record.time) if self.kind == "poses" else Column("time", "s", record.time)
        return (
            index,
            *(
                Column(n, u, from_si(record.drive[:, i], u))
                for i, (n, u) in enumerate(zip(self.drives, self.drive_units, strict=False))
            ),
            *(
                Column(n, u, from_si(observed[:, i], u))
                for i, (n, u) in enumerate(zip(self.channels, self.units, strict=True))
            ),
        )

    def __post_init__(self) -> None:
        if not self.tolerance:  # none stated
            object.__setattr__(self, "tolerance", (None,) * len(self.channels))

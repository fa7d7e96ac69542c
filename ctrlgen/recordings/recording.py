"""A recording: what a device was driven with and what was measured, in SI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Record:
    """One uninterrupted run, SI; n samples of n_u drives and n_y observed channels.

    `name` file with rows; `role` fit, hold_out or rest; `time` (n,) [s] on the clock common to the records of one
    recording.toml, k for settled poses; `sample_time` [s], inf for settled poses; `drive` (n, n_u) in the order of
    `model.signals["drive"].channels`, always finite; `observed` (n, n_y) in the order of `Recording.channels`, NaN
    where not `valid` (n, n_y): missing, in a gap, spike, stuck, or a pose that belongs to the other part. `linear`:
    the drive goes straight between samples, else it is held. `ambient` (n,) [K], None where not given. `period` [s] after
    which the run is stated to repeat itself.
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


@dataclass(frozen=True, eq=False)
class Recording:
    """Records of one device. `channels` observed, such as 'reading.delta_x', with the reader's `units` and the stated
    standard deviation of the `noise` in SI (None where nobody stated one); `notes` what the gate marked or could not do."""

    title: str
    device: str
    kind: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    noise: tuple[float | None, ...]
    records: tuple[Record, ...]
    notes: tuple[str, ...]

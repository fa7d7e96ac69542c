"""A record with its drive at another time"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from ctrlgen.estimation.settings import SIMULATION
from ctrlgen.recordings.recording import Record


def with_drive_at(record: Record, tau: float) -> Record:
    """The record with its drive at t + tau [s] in place of t, held at its ends.

    Between samples a drive that is linear is interpolated by a cubic spline, a held one by its mean over a sample.
    """
    if tau == 0 or len(record.time) < SIMULATION.shortest_spline:
        return record
    at = np.clip(record.time + tau, record.time[0], record.time[-1])
    if not record.linear:
        return replace(record, drive=np.column_stack([np.interp(at, record.time, u) for u in record.drive.T]))
    return replace(record, drive=_spline(record)(at))


@lru_cache(maxsize=SIMULATION.kept_splines)
def _spline(record: Record) -> CubicSpline:
    """The drive of a record as a function of time."""
    return CubicSpline(record.time, record.drive)

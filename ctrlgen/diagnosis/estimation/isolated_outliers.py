"""Readings that stand alone: a fault of the sensor, which no mechanism could follow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter

from ctrlgen.diagnosis.settings import OUTLIERS, STATISTICS
from ctrlgen.recordings.recording import Record, Recording


def mark_outliers(recording: Recording, predicted: Callable[[Record], np.ndarray]) -> tuple[Recording, str]:
    """A series with what stands alone, for one or two samples, in what `predicted` leaves over as not valid; how many.

    A mechanism cannot jump there and back within two samples, so this takes no physics away.
    """
    if recording.kind == "poses":
        return recording, ""
    records, count = [], 0
    for record in recording.records:
        if record.role == "rest":
            records.append(record)
            continue
        left = np.where(record.valid, record.observed - predicted(record), 0.0)
        spikes = record.valid & isolated_outliers(np.nan_to_num(left))
        count += int(spikes.sum())
        records.append(replace(record, valid=record.valid & ~spikes) if spikes.any() else record)
    said = f"{count} samples stand out alone and are left out as spikes of the sensor." if count else ""
    return replace(recording, records=tuple(records)), said


def isolated_outliers(left: np.ndarray) -> np.ndarray:
    """Isolated outliers (n, n_y) of the residual `left` (n, n_y).

    A sample is one that lies more than `OUTLIERS.threshold` robust standard deviations from the running median. No outlier
    is wider than `OUTLIERS.widest` samples, and a channel with more than `OUTLIERS.largest_share` of them has none.
    """
    rough = left - median_filter(left, size=(OUTLIERS.median_window, 1), mode="nearest")
    overall = STATISTICS.mad_to_sd * np.median(np.abs(rough), axis=0)
    local = median_filter(np.abs(rough), size=(OUTLIERS.scale_window, 1)) * STATISTICS.mad_to_sd
    near = OUTLIERS.threshold * np.maximum(overall, local)
    found = np.abs(rough) > near
    found[:, found.mean(axis=0) > OUTLIERS.largest_share] = False
    for column, size in zip(found.T, np.abs(rough).T, strict=True):
        for run in np.split(np.flatnonzero(column), np.flatnonzero(np.diff(np.flatnonzero(column)) > 1) + 1):
            beside = [size[k] for k in (run[0] - 1, run[-1] + 1) if 0 <= k < len(size)] if len(run) else []
            if len(run) > OUTLIERS.widest or (beside and max(beside) > OUTLIERS.neighbour_share * size[run].max()):
                column[run] = False  # a mass that is pushed moves before and after too
    return found

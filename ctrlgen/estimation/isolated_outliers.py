"""Outliers of the residual: faults of a sensor that the recorded channel alone does not show.

Next to a jump of the drive the channel itself moves like an outlier; what the model does not predict of it does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter

from ctrlgen.estimation.settings import OUTLIERS, STATISTICS
from ctrlgen.recordings.recording import Record, Recording


def mark_outliers(recording: Recording, predicted: Callable[[Record], np.ndarray]) -> Recording:
    """The recording with outliers of the residual, observed minus `predicted` (n, n_y), marked not valid, and their sizes in
    `Record.spikes`.

    Series only: a mechanism cannot leave and return within two samples, so no physics is taken away; settled poses have no
    neighbours in time. Records at rest are left as they are.
    """
    if recording.kind == "poses":
        return recording
    records = [r if r.role == "rest" else _marked(r, predicted(r)) for r in recording.records]
    return replace(recording, records=tuple(records))


def _marked(record: Record, predicted: np.ndarray) -> Record:
    residual = np.nan_to_num(np.where(record.valid, record.observed - predicted, 0.0))
    marked = record.valid & isolated_outliers(residual)
    spikes = tuple((int(k), int(i), float(residual[k, i])) for k, i in np.argwhere(marked))
    return replace(record, valid=record.valid & ~marked, spikes=(*record.spikes, *spikes)) if spikes else record


def isolated_outliers(residual: np.ndarray) -> np.ndarray:
    """Isolated outliers (n, n_y) of the `residual` (n, n_y): large deviations e from the median of the samples around.

    |e| must exceed `OUTLIERS.threshold` standard deviations, the larger of the whole channel's and the local one, for at most
    `OUTLIERS.widest` samples, and the samples on either side must have little of it. A channel with more than
    `OUTLIERS.largest_share` of them has none.

    `ctrlgen.recordings.outliers` compares with the chord between the neighbours instead, because a recorded channel moves. A
    residual hardly moves, and the noise in it is often filtered: the chord then follows the noise, and samples of a smooth
    residual that the model merely does not explain would be taken out.
    """
    e = np.abs(residual - median_filter(residual, size=(OUTLIERS.around, 1), mode="nearest"))
    whole, local = np.median(e, axis=0), median_filter(e, size=(OUTLIERS.local, 1))
    marked = e > OUTLIERS.threshold * STATISTICS.mad_to_sd * np.maximum(whole, local)
    marked[:, marked.mean(axis=0) > OUTLIERS.largest_share] = False
    for column, size in zip(marked.T, e.T, strict=True):
        at = np.flatnonzero(column)
        for run in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1):
            if not len(run):
                continue
            neighbours = [size[k] for k in (run[0] - 1, run[-1] + 1) if 0 <= k < len(size)]
            if len(run) > OUTLIERS.widest or max(neighbours, default=0.0) > OUTLIERS.neighbour_share * size[run].max():
                # a mass that is pushed moves before and after, too
                column[run] = False
    return marked

"""Outliers of the residual: faults of a sensor that the recorded channel alone does not show.

Next to a jump of the drive the channel itself moves like an outlier; what the model does not predict of it does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ctrlgen.diagnosis.settings import OUTLIERS
from ctrlgen.recordings.outliers import outliers
from ctrlgen.recordings.recording import Record, Recording


def mark_outliers(recording: Recording, predicted: Callable[[Record], np.ndarray]) -> tuple[Recording, str]:
    """The recording with outliers of the residual, observed minus `predicted` (n, n_y), marked not valid, and a note.

    Series only: a mechanism cannot leave and return within two samples, so no physics is taken away; settled poses have no
    neighbours in time. Records at rest are left as they are. The note is empty where nothing is marked.
    """
    if recording.kind == "poses":
        return recording, ""
    records, count = [], 0
    for record in recording.records:
        if record.role == "rest":
            records.append(record)
            continue
        marked = isolated_outliers(np.where(record.valid, record.observed - predicted(record), np.nan))
        count += int(marked.sum())
        records.append(replace(record, valid=record.valid & ~marked) if marked.any() else record)
    note = f"{count} samples lie off the model's prediction alone, without their neighbours: taken for sensor faults, not used."
    return replace(recording, records=tuple(records)), note if count else ""


def isolated_outliers(residual: np.ndarray) -> np.ndarray:
    """Isolated outliers (n, n_y) of the `residual` (n, n_y), NaN where a sample is not valid.

    A channel with more than `OUTLIERS.largest_share` of them has none.
    """
    marked = [outliers(column, threshold=OUTLIERS.threshold, widest=OUTLIERS.widest) for column in residual.T]
    return np.column_stack([m & (m.mean() <= OUTLIERS.largest_share) for m in marked])

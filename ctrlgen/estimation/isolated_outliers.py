"""Outliers of the residual: faults of a sensor that the recorded channel alone does not show.

Next to a jump of the drive the channel itself moves like an outlier; what the model does not predict of it does not. They are marked
against the device as described, and again against every model that is accepted: a law that is missing hides them behind its residual,
and takes peaks of its own for them.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import stats
from scipy.ndimage import median_filter

from ctrlgen.estimation.held_stretches import held_stretches
from ctrlgen.estimation.noise import Noise
from ctrlgen.estimation.pose_outliers import pose_outliers
from ctrlgen.estimation.settings import OUTLIERS, STATISTICS
from ctrlgen.recordings.recording import Record, Recording


def mark_outliers(recording: Recording, predicted: Callable[[Record], np.ndarray]) -> Recording:
    """The recording with outliers of the residual, observed minus `predicted` (n, n_y), marked not valid, and their sizes in
    `Record.spikes`; the same object where there are none.

    A mechanism cannot leave and return within two samples, so no physics is taken away; of settled poses see `pose_outliers`.
    Records at rest are left as they are.
    """
    if recording.kind == "poses":
        return _with_pose_marks(recording, predicted)
    records = [r if r.role == "rest" else _marked(r, predicted(r)) for r in recording.records]
    same = all(map(operator.is_, records, recording.records))
    return recording if same else replace(recording, records=tuple(records))


def mark_again(recording: Recording, predicted: Callable[[Record], np.ndarray], noise: Noise) -> Recording:
    """The recording marked against another model; the same object where nothing changes.

    Outliers of its residual are marked as in `mark_outliers`, up to `OUTLIERS.largest_share_again` of a channel. A mark of before
    stays where the reading is still more than `OUTLIERS.explained` standard deviations of the `noise` off the residual around; the
    others are taken back: the model explains them. Stretches in which a reading is held are marked where the rest is noise.
    """
    if recording.kind == "poses":
        marked = _with_pose_marks(_unmarked(recording), predicted, of_accepted=True)
    else:
        records = [r if r.role == "rest" else _marked_again(r, predicted(r), noise) for r in recording.records]
        marked = replace(recording, records=tuple(records))
    same = all(np.array_equal(a.valid, b.valid) for a, b in zip(marked.records, recording.records, strict=True))
    return recording if same else marked


def _marked(record: Record, predicted: np.ndarray) -> Record:
    residual = np.nan_to_num(np.where(record.valid, record.observed - predicted, 0.0))
    marked = _without_motion(record.valid & isolated_outliers(residual), predicted)
    spikes = tuple((int(k), int(i), float(residual[k, i])) for k, i in np.argwhere(marked))
    return replace(record, valid=record.valid & ~marked, spikes=(*record.spikes, *spikes)) if spikes else record


def _marked_again(record: Record, predicted: np.ndarray, noise: Noise) -> Record:
    whole = without_marks(record)
    if not np.isfinite(predicted).all():
        return record
    residual = _bridged(whole.observed - predicted, whole.valid)
    e = _off_median(residual)
    still = whole.valid & ~record.valid & (np.abs(e) > OUTLIERS.explained * noise.floor)
    marked = whole.valid & isolated_outliers(residual, OUTLIERS.largest_share_again)
    marked = still | _without_motion(marked, predicted)
    held = held_stretches(whole, predicted, marked, noise)
    valid = whole.valid & ~marked
    for first, last, i in held:
        valid[first:last, i] = marked[first:last, i] = False
    spikes = tuple((int(k), int(i), float(e[k, i])) for k, i in np.argwhere(marked))
    return replace(whole, valid=valid, spikes=spikes, held=held)


def _without_motion(marked: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """The outliers `marked` (n, n_y) but those of channels in which they come with the motion `predicted` (n, n_y): where it stands, how
    fast it moves, by Kolmogorov and Smirnov. A fault of a sensor comes at any place and speed, a stop that is hit at one end of the
    range, stick-slip at reversals, a scratch at its place."""
    marked = marked.copy()
    for i in np.flatnonzero(marked.sum(axis=0) >= OUTLIERS.fewest_by_motion).tolist():
        speed = np.gradient(predicted[:, i])
        for motion in (predicted[:, i], speed, np.abs(speed)):
            p = float(stats.ks_2samp(motion[marked[:, i]], motion).pvalue)
            if p < OUTLIERS.by_motion_p:
                marked[:, i] = False
                break
    return marked


def without_marks(record: Record) -> Record:
    """The record with the readings that were marked as spikes or held valid again.

    Validation keeps no such reading: it is the chord between its neighbours and the size of the spike.
    """
    observed, valid = record.observed.copy(), record.valid.copy()
    for i in {i for _, i, _ in record.spikes}:
        marked = [(k, size) for k, channel, size in record.spikes if channel == i]
        known = np.flatnonzero(record.valid[:, i])
        for k, size in marked:
            if not np.isfinite(observed[k, i]):
                observed[k, i] = np.interp(k, known, record.observed[known, i]) + size
            valid[k, i] = True
    for first, last, i in record.held:
        valid[first:last, i] = np.isfinite(observed[first:last, i])
    return replace(record, observed=observed, valid=valid, spikes=(), held=())


def _unmarked(recording: Recording) -> Recording:
    records = (r if r.role == "rest" else without_marks(r) for r in recording.records)
    return replace(recording, records=tuple(records))


def _with_pose_marks(
    recording: Recording,
    predicted: Callable[[Record], np.ndarray],
    of_accepted: bool = False,
) -> Recording:
    """Pose sets with their outliers, which are sought in all records together, marked not valid."""
    residuals = [np.where(r.valid, r.observed - predicted(r), np.nan) for r in recording.records]
    if not recording.records or not all(
        np.isfinite(e[r.valid]).all() for e, r in zip(residuals, recording.records, strict=True)
    ):
        return recording
    marked = pose_outliers(np.vstack([r.drive for r in recording.records]), np.vstack(residuals), of_accepted)
    parts = np.split(marked, np.cumsum([len(r.drive) for r in recording.records])[:-1])
    records = []
    for record, e, at in zip(recording.records, residuals, parts, strict=True):
        spikes = tuple((int(k), int(i), float(e[k, i])) for k, i in np.argwhere(at))
        marks = {"valid": record.valid & ~at, "spikes": (*record.spikes, *spikes)}
        records.append(replace(record, **marks) if spikes else record)
    return replace(recording, records=tuple(records))


def _bridged(residual: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """The `residual` (n, n_y) with straight lines where it is not `valid`, which no median takes for a step."""
    filled = np.zeros(residual.shape)
    for i, good in enumerate(valid.T):
        at = np.flatnonzero(good)
        if len(at):
            filled[:, i] = np.interp(np.arange(len(residual)), at, residual[at, i])
    return filled


def _off_median(residual: np.ndarray) -> np.ndarray:
    """Deviation (n, n_y) of the `residual` from the median of the samples around."""
    return residual - median_filter(residual, size=(OUTLIERS.around, 1), mode="nearest")


def isolated_outliers(residual: np.ndarray, largest_share: float = OUTLIERS.largest_share) -> np.ndarray:
    """Isolated outliers (n, n_y) of the `residual` (n, n_y): large deviations e from the median of the samples around.

    |e| must exceed `OUTLIERS.threshold` standard deviations, the larger of the whole channel's and the local one, for at most
    `OUTLIERS.widest` samples, and the samples on either side must have little of it. A channel with more than
    `largest_share` of them has none.

    `ctrlgen.recordings.outliers` compares with the chord between the neighbours instead, because a recorded channel moves. A
    residual hardly moves, and the noise in it is often filtered: the chord then follows the noise, and samples of a smooth
    residual that the model merely does not explain would be taken out.
    """
    e = np.abs(_off_median(residual))
    whole, local = np.median(e, axis=0), median_filter(e, size=(OUTLIERS.local, 1))
    marked = e > OUTLIERS.threshold * STATISTICS.mad_to_sd * np.maximum(whole, local)
    marked[:, marked.mean(axis=0) > largest_share] = False
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

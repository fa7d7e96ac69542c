"""Noise of settled poses that was stated, against what a model leaves and how poses repeat."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.noise import Noise, NoiseSource, ljung_box, repeatability
from ctrlgen.estimation.settings import NOISE, NOISE_UPDATE
from ctrlgen.recordings.recording import Record


def stated_pose_noise(fitter: Fitter, fit: Fit) -> Noise:
    """The noise with the size of the residual of `fit` for channels whose stated noise is wrong; the same object where none is.

    What is left is noise of another size where no function of the drive predicts it (F test of drives, their squares and the way
    that each came), it has no memory from pose to pose (Ljung-Box), and the held-out poses have no more of it. Where poses repeat, they
    vary as much: lost motion and creep only widen that. Channels whose noise is stated as the same number have the same noise: those
    of which what is left is noise must agree on its size, and none may have less; one that has more holds physics beside it.
    """
    noise = fitter.noise
    every = ((i, _left(fitter, fit, i)) for i in np.flatnonzero(noise.stated).tolist())
    left = {i: e for i, e in every if e is not None}
    sd, notes, sources, count = noise.sd.copy(), list(noise.notes), list(noise.sources), noise.count.copy()
    for alike in _stated_alike(fitter, left):
        told = [left[i] for i in alike if left[i].is_noise]
        free = sum(e.free for e in told)
        size = float(np.sqrt(sum(e.squares for e in told) / free)) if told else np.nan
        ratio = size / noise.floor[alike[0]]
        if not told or not 1 / NOISE_UPDATE.stated_factor < ratio < NOISE_UPDATE.stated_factor:
            continue
        off = 2 * min(float(f(ratio**2 * free, free)) for f in (stats.chi2.cdf, stats.chi2.sf))
        if abs(ratio - 1) < NOISE_UPDATE.stated_margin or off > NOISE_UPDATE.noise_alone_p:
            continue
        if not all(_agrees(left[i], size, len(alike)) for i in alike):
            continue
        for i in alike:
            sd[i], count[i], sources[i] = size, free, NoiseSource.RESIDUAL
            notes[i] = (
                f"{fitter.recording.channels[i]}: the stated noise is {1 / ratio:.2f} of what is left, which has nothing to do with "
                f"the drive and no memory; {NoiseSource.RESIDUAL.value}"
            )
    if np.array_equal(sd, noise.sd):
        return noise
    return replace(noise, sd=sd, sources=tuple(sources), notes=tuple(notes), count=count)


@dataclass(frozen=True)
class _Left:
    """The `squares` that a fit leaves of a channel, in `free` readings, and whether they are those of noise alone (`is_noise`)."""

    squares: float
    free: float
    is_noise: bool


def _left(fitter: Fitter, fit: Fit, i: int) -> _Left | None:
    """What is left of channel `i`; None of too few readings."""
    records = [r for r in fitter.recording.records if r.role != "rest"]
    e = [(r.observed - fitter.predict(fit, r))[r.valid[:, i], i] for r in records]
    features = np.vstack([_features(r.drive)[r.valid[:, i]] for r in records])
    fitted = np.concatenate([np.full(len(v), r.role == "fit") for v, r in zip(e, records, strict=True)])
    values = np.concatenate(e)
    squares = float(values @ values)
    # each channel pays for its part of the numbers that were fitted
    free = len(values) - len(fit.theta) / len(fitter.noise.sd)
    if len(values) < NOISE_UPDATE.fewest_poses or free < len(values) / 2 or not np.isfinite(values).all():
        return None
    alone = _is_noise_alone(values, features, fitted, e)
    return _Left(squares, free, alone and not _repeats_better(records, i, float(np.sqrt(squares / free)), free))


def _stated_alike(fitter: Fitter, channels: Iterable[int]) -> list[list[int]]:
    """The channels in groups whose noise is stated as the same number of one unit."""
    groups: dict[tuple[str, float], list[int]] = {}
    for i in channels:
        groups.setdefault((fitter.recording.units[i], float(fitter.noise.floor[i])), []).append(i)
    return list(groups.values())


def _agrees(left: _Left, size: float, channels: int) -> bool:
    """Whether a channel, one of several, may have noise of this `size`: what is left is as large where it is noise, and no smaller
    where it is not."""
    x = left.squares / size**2
    p = float(stats.chi2.cdf(x, left.free))
    if left.is_noise:
        p = 2 * min(p, float(stats.chi2.sf(x, left.free)))
    return p * channels > NOISE_UPDATE.pose_alone_p


def _features(drive: np.ndarray) -> np.ndarray:
    """What a law may go with (n, m): drives, their squares, and the way that each pose came from the one before."""
    scaled = (drive - drive.mean(axis=0)) / np.where(np.ptp(drive, axis=0) > 0, np.ptp(drive, axis=0), 1.0)
    came = np.sign(np.diff(scaled, axis=0, prepend=scaled[:1]))
    return np.hstack([scaled, scaled**2, came])


def _is_noise_alone(e: np.ndarray, features: np.ndarray, fitted: np.ndarray, runs: list[np.ndarray]) -> bool:
    """Whether `e` (n,) goes with none of the `features` (n, m), has no memory within its `runs`, and is no larger where it was not
    `fitted` (n,)."""
    features = features[:, : max(len(e) // NOISE_UPDATE.poses_per_feature, 1)]
    X = np.column_stack([np.ones(len(e)), features])
    rank = int(np.linalg.matrix_rank(X))
    rest = e - X @ np.linalg.lstsq(X, e, rcond=None)[0]
    free, taken = len(e) - rank, float(e @ e - rest @ rest)
    p = [float(stats.f.sf(taken / rank / max(float(rest @ rest) / free, 1e-300), rank, free))]
    p += [ljung_box(run, NOISE_UPDATE.pose_lags) for run in runs if len(run) >= NOISE_UPDATE.fewest_poses]
    if fitted.any() and not fitted.all():
        ratio = float(np.mean(e[~fitted] ** 2) / max(np.mean(e[fitted] ** 2), 1e-300))
        p.append(float(stats.f.sf(ratio, int((~fitted).sum()), int(fitted.sum()))))
    return min(p) > NOISE_UPDATE.pose_alone_p


def _repeats_better(records: list[Record], i: int, size: float, free: float) -> bool:
    """Whether poses of one drive vary by less than `size`, which `free` degrees tell: then physics is left beside the noise."""
    sd, count = repeatability(tuple(records), i)
    if count < NOISE.fewest_repeats or sd <= 0:
        return False
    return bool(stats.f.sf((size / sd) ** 2, free, count) < NOISE_UPDATE.pose_alone_p)

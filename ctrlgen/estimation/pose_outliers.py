"""Outliers of settled poses: single readings far off what a model leaves elsewhere.

Poses have no neighbours in time, and physics that acts in few of them must not be taken out: a stop is touched at an end of the
range, a scratch is met by its neighbours in the range, and what bends a mechanism shows in several channels.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from ctrlgen.estimation.settings import OUTLIERS, POSE_OUTLIERS, STATISTICS

BY_CHANCE = 0.95
"""Chance that a channel whose sensor fails in the largest share of poses shows no more failures than are taken for such."""


def pose_outliers(drive: np.ndarray, residual: np.ndarray, of_accepted: bool = False) -> np.ndarray:
    """Outliers (n, n_y) of the `residual` (n, n_y), NaN where a pose has no reading, at the `drive` (n, n_u).

    |e| of a reading exceeds `POSE_OUTLIERS.threshold` robust standard deviations of its channel; no other channel of the pose does;
    the poses before and after and the nearest ones by drive have little of it; and no drive stands there at an end of its range.
    A channel with more than `POSE_OUTLIERS.largest_share` of them, but at least one, has none; where the residual is that `of_accepted`
    causes, with more than chance makes of that share, by a Poisson distribution: little is left that could be taken for one.
    """
    e = residual - np.nanmedian(residual, axis=0) if np.isfinite(residual).any() else residual
    size = np.nan_to_num(np.abs(e))
    seen = np.isfinite(e)
    marked = np.zeros(e.shape, bool)
    fewest = seen.sum(axis=0) >= POSE_OUTLIERS.fewest
    if not fewest.any():
        return marked
    sd = np.array([STATISTICS.mad_to_sd * np.median(size[s, i]) if s.any() else np.inf for i, s in enumerate(seen.T)])
    far = seen & (size > POSE_OUTLIERS.threshold * sd) & fewest & (sd > 0)
    span = np.ptp(drive, axis=0)
    scaled = drive / np.where(span > 0, span, 1.0)
    # a drive that has two values alone has no inside
    inside = ((drive > drive.min(axis=0)) & (drive < drive.max(axis=0)))[:, span > 0].all(axis=1)
    for k in np.flatnonzero((far.sum(axis=1) == 1) & inside):
        i = int(np.argmax(far[k]))
        distance = np.where(seen[:, i], np.linalg.norm(scaled - scaled[k], axis=1), np.inf)
        distance[k] = np.inf
        nearest = np.argsort(distance, kind="stable")[: POSE_OUTLIERS.nearest]
        beside = [j for j in (k - 1, k + 1) if 0 <= j < len(e) and seen[j, i]]
        marked[k, i] = size[[*nearest, *beside], i].max() < OUTLIERS.neighbour_share * size[k, i]
    share = POSE_OUTLIERS.largest_share * seen.sum(axis=0)
    most = np.maximum(stats.poisson.ppf(BY_CHANCE, share) if of_accepted else share, 1)
    return marked & (marked.sum(axis=0) <= most)

"""The time between the rows of a clock whose numbers are rounded."""

from __future__ import annotations

import numpy as np

BREAK = 1.5  # usual steps without a row: a gap
NEAR = 0.4  # of the median step, by which others of one clock differ at most


def usual_step(time: np.ndarray) -> float:
    """The mean of the steps of `time` (n,) that are near their median, in its unit; the median where none is.

    Numbers that are rounded to a part of a step, 0, 0.167, 0.333, make their median 0.167 where the mean is right.
    """
    steps = np.diff(time)
    median = float(np.nanmedian(steps)) if np.isfinite(steps).any() else np.nan
    near = steps[np.abs(steps - median) < NEAR * abs(median)]
    return float(np.mean(near)) if len(near) else median

"""The quantisation step of readings: what a converter, a counter or numbers printed with few digits leave."""

from __future__ import annotations

import numpy as np

FEWEST = 200  # readings among which a common step is no coincidence
OFF_STEP = 0.1  # of a step: how far a reading may lie from a multiple, because it was rounded again when it was written
SAME_LEVEL = 1e-9  # of the largest reading: levels nearer than this differ by the rounding of the file


def quantisation_step(values: np.ndarray, fewest: int = FEWEST) -> float:
    """The largest step of which all differences of `values` (n,) are multiples, in their unit; NaN are left out.

    Zero where there is none: fewer than `fewest` values, or values off every common step by more than `OFF_STEP`.
    """
    levels = np.unique(values[np.isfinite(values)])
    if len(values) < fewest or len(levels) < 2:
        return 0.0
    gaps = np.diff(levels)
    gaps = gaps[gaps > SAME_LEVEL * np.abs(levels).max()]
    if not len(gaps):
        return 0.0
    step, distance = float(gaps.min()), levels - levels[0]
    # The first level that is another one, not the lowest one rounded otherwise
    reach = distance[distance > step / 2][0]
    # the longer the distance, the more precise the step, and the farther it can be counted without an error of one
    while True:
        near = distance[distance <= reach]
        count = np.round(near / step)
        if np.abs(near - count * step).max() > OFF_STEP * step:
            return 0.0
        step = float(near @ count / (count @ count))
        if reach >= distance[-1]:
            return step
        reach *= 2

"""Readings that lie on a lattice: what a converter, a counter or a printed number of few digits leaves."""

from __future__ import annotations

import numpy as np

FEWEST = 200  # readings that a lattice is seen in
OFF = 0.1  # of a step: how far a reading may lie from the lattice, for what was rounded again when it was written


def quantisation_step(values: np.ndarray) -> float:
    """The step of which all differences of `values` are multiples; zero where there is none to be seen."""
    levels = np.unique(values[np.isfinite(values)])
    if len(values) < FEWEST or len(levels) < 2:
        return 0.0
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * np.abs(levels).max()]
    if not len(gaps):
        return 0.0
    step, way = float(gaps.min()), levels - levels[0]
    reach = max(step, way[1])
    while True:  # the longer the way, the better known the step, and the farther it can be counted
        near = way[way <= reach]
        count = np.round(near / step)
        if np.abs(near - count * step).max() > OFF * step:
            return 0.0
        step = float(near @ count / (count @ count))
        if reach >= way[-1]:
            return step
        reach *= 2

"""How far the rounding of printed data can move a number computed from them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

SAMPLES = 1000
COVERED = 0.9973  # three standard deviations of a normal variable


def half_units(values: np.ndarray, digits: int) -> np.ndarray:
    """Half a unit of the last of `digits` significant digits of every value; 0 for a printed zero."""
    size = np.abs(values)
    exponent = np.floor(np.log10(np.where(size > 0, size, 1.0)) + 1e-12)
    return np.where(size > 0, 0.5 * 10.0 ** (exponent - digits + 1), 0.0)


def carried(statistics: Callable[[np.ndarray], np.ndarray], data: np.ndarray, half: np.ndarray) -> np.ndarray:
    """How far each statistic may lie from that of the data before they were rounded, (k,).

    Every rounding error counts as uniform within its half unit and independent; the answer is the move that
    COVERED of SAMPLES draws stay below, the same on every run. `data`, `half` (m,); `statistics` gives (k,).
    """
    rng = np.random.default_rng(0)
    here = statistics(data)
    moves = (np.abs(statistics(data + half * rng.uniform(-1, 1, data.shape)) - here) for _ in range(SAMPLES))
    return np.quantile(list(moves), COVERED, axis=0)

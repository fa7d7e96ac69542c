"""Propagation of the rounding of printed data to the numbers computed from them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

SAMPLES = 1000
COVERED = 0.9973  # three standard deviations of a normal variable


def half_units(values: np.ndarray, digits: int) -> np.ndarray:
    """Half a unit of the last of `digits` significant digits of each value; 0 for a printed zero."""
    size = np.abs(values)
    exponent = np.floor(np.log10(np.where(size > 0, size, 1.0)) + 1e-12)
    return np.where(size > 0, 0.5 * 10.0 ** (exponent - digits + 1), 0.0)


def propagated_rounding(
    statistics: Callable[[np.ndarray], np.ndarray], data: np.ndarray, half: np.ndarray
) -> np.ndarray:
    """How far each statistic (k,) may be from its value for the data before they were rounded.

    By Monte Carlo: the rounding errors of `data` (m,) are independent and uniform within `half` (m,) a unit; the COVERED
    quantile of the changes of `statistics` (data) over SAMPLES draws, the same on every run.
    """
    rng = np.random.default_rng(0)
    nominal = statistics(data)
    changes = (np.abs(statistics(data + half * rng.uniform(-1, 1, data.shape)) - nominal) for _ in range(SAMPLES))
    return np.quantile(list(changes), COVERED, axis=0)

"""Along the path: after which ways what is left over repeats, as fringes, teeth and screws do, and where it jumps.

The path is what was read, which is right where the device is not yet understood, or what was foreseen, which does not
drift with the sensor.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ctrlgen.diagnosis.settings import SPATIAL_PERIODS
from ctrlgen.numerics.spectral_peaks import highest_peaks, periodogram


def spatial_periods(path: np.ndarray, left: np.ndarray) -> tuple[float, ...]:
    """The ways [path's unit] after which `left` (n,) repeats along `path` (n,), the most conspicuous first.

    From |sum left exp(-2 pi i path/way)|^2 over the mean square and n, which is exponential where nothing repeats.
    """
    span = float(np.ptp(path))
    power = float(np.sum((left - np.mean(left)) ** 2))
    if span == 0 or power == 0:
        return ()
    n, padding = SPATIAL_PERIODS.cells, SPATIAL_PERIODS.padding
    cell = np.minimum(((path - path.min()) / span * n).astype(int), n - 1)
    along = np.bincount(cell, weights=left - np.mean(left), minlength=n)
    spectrum = periodogram(along, padding=padding) / power
    first, last = padding * SPATIAL_PERIODS.fewest_cycles, padding * n // SPATIAL_PERIODS.finest_cells
    least = np.log((last - first) / SPATIAL_PERIODS.false_alarm_p)
    best = highest_peaks(spectrum[first:last], SPATIAL_PERIODS.most, distance=2 * padding, height=least)
    return tuple(float(padding * span / (first + k)) for k in best)


def merged_periods(periods: Iterable[tuple[float, ...]]) -> tuple[float, ...]:
    """The ways along several paths, such as the one read and the one foreseen, each once."""
    kept: list[float] = []
    for way in (way for ways in periods for way in ways):
        if all(abs(way / other - 1) > SPATIAL_PERIODS.same_period for other in kept):
            kept.append(way)
    return tuple(kept)


def jump_positions(path: np.ndarray, left: np.ndarray) -> tuple[float, ...]:
    """The places [path's unit] at which the mean of `left` (n,) on both sides differs most, apart from its usual slope."""
    span = float(np.ptp(path))
    if span == 0:
        return ()
    n, side = SPATIAL_PERIODS.jump_cells, SPATIAL_PERIODS.jump_side
    cell = np.minimum(((path - path.min()) / span * n).astype(int), n - 1)
    count = np.bincount(cell, minlength=n)
    total = np.bincount(cell, weights=left, minlength=n)
    read = np.flatnonzero(count)
    mean = np.interp(np.arange(n), read, total[read] / count[read])
    sums = np.concatenate([[0.0], np.cumsum(mean)])
    step = (sums[2 * side :] - 2 * sums[side:-side] + sums[: -2 * side]) / side
    step = np.abs(step - np.median(step))
    best = highest_peaks(np.concatenate([[0.0], step, [0.0]]), SPATIAL_PERIODS.most, distance=side) - 1
    return tuple(float(path.min() + (k + side) / n * span) for k in best)

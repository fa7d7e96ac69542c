"""Along the path: after which ways what is left over repeats, as fringes, teeth and screws do, and where it jumps.

The path is what was read, which is right where the device is not yet understood, or what was foreseen, which does not
drift with the sensor.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.signal import find_peaks

from ctrlgen.diagnosis.settings import SPATIAL_PERIODS


def pitches(path: np.ndarray, left: np.ndarray) -> tuple[float, ...]:
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
    spectrum = np.abs(np.fft.rfft(along, n=padding * n)) ** 2 / power
    first, last = padding * SPATIAL_PERIODS.fewest_cycles, padding * n // SPATIAL_PERIODS.finest_cells
    least = np.log((last - first) / SPATIAL_PERIODS.false_alarm_p)
    found, _ = find_peaks(spectrum[first:last], height=least, distance=2 * padding)
    best = found[np.argsort(-spectrum[first + found])][: SPATIAL_PERIODS.most]
    return tuple(float(padding * span / (first + k)) for k in best)


def both(found: Iterable[tuple[float, ...]]) -> tuple[float, ...]:
    """The ways along several paths, such as the one read and the one foreseen, each once."""
    kept: list[float] = []
    for way in (way for ways in found for way in ways):
        if all(abs(way / other - 1) > SPATIAL_PERIODS.same_period for other in kept):
            kept.append(way)
    return tuple(kept)


def jumps(path: np.ndarray, left: np.ndarray) -> tuple[float, ...]:
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
    found, _ = find_peaks(np.concatenate([[0.0], step, [0.0]]), distance=side)
    best = (found - 1)[np.argsort(-step[found - 1])][: SPATIAL_PERIODS.most]
    return tuple(float(path.min() + (k + side) / n * span) for k in best)

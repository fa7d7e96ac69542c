"""Along the path: after which ways what is left over repeats, as fringes, teeth and screws do, and where it jumps.

The path is what was read, which is right where the device is not yet understood, or what was foreseen, which does not
drift with the sensor.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.signal import find_peaks

CELLS = 2**14  # of the path read
FINEST = 4  # cells of the shortest way
FINER = 4  # padding: the way is then right to a sixteenth of a period over the whole path
SLOW = 20  # periods in the path: longer ways are in the grids
SAME = 1e-4  # of itself: ways so near are one
SURE = 1e-4  # p of one so conspicuous anywhere where nothing repeats
MOST = 3
NEAR = 512  # cells for jumps: both sides of a place are compared over SIDE of them
SIDE = 16


def pitches(path: np.ndarray, left: np.ndarray) -> tuple[float, ...]:
    """The ways [path's unit] after which `left` (n,) repeats along `path` (n,), the most conspicuous first.

    From |sum left exp(-2 pi i path/way)|^2 over the mean square and n, which is exponential where nothing repeats.
    """
    span = float(np.ptp(path))
    power = float(np.sum((left - np.mean(left)) ** 2))
    if span == 0 or power == 0:
        return ()
    cell = np.minimum(((path - path.min()) / span * CELLS).astype(int), CELLS - 1)
    along = np.bincount(cell, weights=left - np.mean(left), minlength=CELLS)
    spectrum = np.abs(np.fft.rfft(along, n=FINER * CELLS)) ** 2 / power
    first, last = FINER * SLOW, FINER * CELLS // FINEST
    found, _ = find_peaks(spectrum[first:last], height=np.log((last - first) / SURE), distance=2 * FINER)
    best = found[np.argsort(-spectrum[first + found])][:MOST]
    return tuple(float(FINER * span / (first + k)) for k in best)


def both(found: Iterable[tuple[float, ...]]) -> tuple[float, ...]:
    """The ways along several paths, such as the one read and the one foreseen, each once."""
    kept: list[float] = []
    for way in (way for ways in found for way in ways):
        if all(abs(way / other - 1) > SAME for other in kept):
            kept.append(way)
    return tuple(kept)


def jumps(path: np.ndarray, left: np.ndarray) -> tuple[float, ...]:
    """The places [path's unit] at which the mean of `left` (n,) on both sides differs most, apart from its usual slope."""
    span = float(np.ptp(path))
    if span == 0:
        return ()
    cell = np.minimum(((path - path.min()) / span * NEAR).astype(int), NEAR - 1)
    count = np.bincount(cell, minlength=NEAR)
    total = np.bincount(cell, weights=left, minlength=NEAR)
    read = np.flatnonzero(count)
    mean = np.interp(np.arange(NEAR), read, total[read] / count[read])
    sums = np.concatenate([[0.0], np.cumsum(mean)])
    step = (sums[2 * SIDE :] - 2 * sums[SIDE:-SIDE] + sums[: -2 * SIDE]) / SIDE
    step = np.abs(step - np.median(step))
    found, _ = find_peaks(np.concatenate([[0.0], step, [0.0]]), distance=SIDE)
    best = (found - 1)[np.argsort(-step[found - 1])][:MOST]
    return tuple(float(path.min() + (k + SIDE) / NEAR * span) for k in best)

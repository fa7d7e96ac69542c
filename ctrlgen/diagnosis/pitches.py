"""Along the path: after which ways what is left over repeats, as fringes, teeth and screws do."""

from __future__ import annotations

import numpy as np
from scipy.signal import find_peaks

CELLS = 2**14  # of the path read
FINEST = 4  # cells of the shortest way
FINER = 4  # padding: the way is then right to a sixteenth of a period over the whole path
SLOW = 20  # periods in the path: longer ways are in the grids
SURE = 1e-4  # p of one so conspicuous anywhere where nothing repeats
MOST = 3


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

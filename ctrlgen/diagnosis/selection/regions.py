"""Regions: where along a coordinate of the motion most of what is left over is; places from which laws in a region are fitted.

The samples are sorted by the coordinate x into cells of as many samples each. At an edge the mean squares M of the residual change,

    B = p_1 p_2 (M_1 - M_2)^2/M^2,

p the shares of the samples: what two levels explain of the variance of the squares. A ringing device carries what happens in a
region out of it, so that squares and not their logarithms are compared. Whether a law acts there, fits decide.
"""

from __future__ import annotations

import numpy as np

from ctrlgen.diagnosis.settings import REGIONS
from ctrlgen.numerics.spectral_peaks import highest_peaks


def region_edges(x: np.ndarray, squares: np.ndarray, side: int) -> tuple[float, ...]:
    """The edges on x (n,) beyond which, on the `side` 1 above and -1 below, the `squares` (n,) of a residual are clearly larger; the
    most conspicuous first."""
    n = len(x)
    if n < REGIONS.cells * REGIONS.fewest_in_cell or np.ptp(x) == 0:
        return ()
    order = np.argsort(x, kind="stable")
    cell = np.empty(n, int)
    cell[order] = np.arange(n) * REGIONS.cells // n
    # a few outliers are no region
    squares = np.minimum(squares, np.quantile(squares, REGIONS.outlying))
    contrast = _contrasts(cell, squares, side)
    best = highest_peaks(np.concatenate([[0.0], contrast, [0.0]]), REGIONS.most, distance=REGIONS.apart) - 1
    edges = x[order][(np.arange(1, REGIONS.cells) * n) // REGIONS.cells]
    return tuple(float(edges[k]) for k in best if contrast[k] > 0)


def _contrasts(cell: np.ndarray, squares: np.ndarray, side: int) -> np.ndarray:
    """B at each edge between two cells; zero where the side beyond the edge has not clearly more."""
    total = np.bincount(cell, weights=squares, minlength=REGIONS.cells)
    count = np.bincount(cell, minlength=REGIONS.cells)
    below, n_below = np.cumsum(total)[:-1], np.cumsum(count)[:-1]
    n, whole = count.sum(), max(float(total.sum()), 1e-300)
    mean_below = np.maximum(below, 1e-300) / n_below
    mean_above = np.maximum(whole - below, 1e-300) / (n - n_below)
    ratio = mean_above / mean_below if side > 0 else mean_below / mean_above
    share = n_below / n
    value = share * (1 - share) * ((mean_above - mean_below) / (whole / n)) ** 2
    return np.where(ratio > REGIONS.least_ratio, value, 0.0)

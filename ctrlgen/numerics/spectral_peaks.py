"""Lines of a spectrum: the zero-padded periodogram, the level around each bin, and the highest peaks.

Two users of spectra need no peaks and do not come here: the lines of a periodic drive are tested bin by bin against the
variance from period to period, and the residual is summed over bands.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import find_peaks


def periodogram(values: np.ndarray, window: np.ndarray | None = None, padding: int = 1) -> np.ndarray:
    """|FFT|^2 of `values` (n, ...) along the first axis times `window` (n,), padded with zeros to `padding` n samples.

    Not normalised: bin k belongs to k/(padding n) periods per sample. Shape (padding n // 2 + 1, ...).
    """
    if window is not None:
        values = values * window.reshape(-1, *(1,) * (values.ndim - 1))
    return np.abs(np.fft.rfft(values, n=padding * len(values), axis=0)) ** 2


def local_floor(power: np.ndarray, width: int) -> np.ndarray:
    """The level around each bin of `power` (n,): the median over `width` bins, which one narrow line does not move."""
    return median_filter(power, width, mode="reflect")


def highest_peaks(power: np.ndarray, count: int, distance: int, height: float | None = None) -> np.ndarray:
    """Bins of the `count` highest local maxima of `power` (n,), the highest first.

    Of two closer than `distance` bins the higher counts; those below `height` do not.
    """
    bins, _ = find_peaks(power, height=height, distance=distance)
    return bins[np.argsort(-power[bins])][:count]


def vertex(power: np.ndarray, k: int) -> float:
    """Place of the maximum of `power` near its local maximum k, in bins from k: that of the parabola through three bins."""
    if not 0 < k < len(power) - 1:
        return 0.0
    below, at, above = power[k - 1 : k + 2]
    bend = below - 2 * at + above
    return float((below - above) / (2 * bend)) if bend < 0 else 0.0

"""Noise where no rest, repeat or dwell tells it: from what the described device leaves over at the quiet frequencies.

At the half of the frequencies at which the readings move least, what is left over is noise rather than physics left
out. There its spectrum is fitted by that of autoregressive noise of order one, S(w) = s^2/|1 - a e^(-iw)|^2, by Whittle's
likelihood (P. Whittle, Arkiv for Matematik 2 (1953) 423), and continued to the others.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import minimize_scalar
from scipy.signal.windows import blackmanharris

SHORTEST = 200  # samples
WIDTH = 31  # bins over which a spectrum is smoothed
OUTSTANDING = 10.0  # times the median around: a line, no noise
MOST = 0.95  # of a: slower noise cannot be told from drift at quiet frequencies
MEDIAN = 1 / np.log(2)  # mean over median of a spectrum's bins, which are exponential
ALIKE, WIDENINGS = 2.0, 4  # frequencies that agree with the noise found, to so much, tell it too
LOBE = 2.0  # independent bins are so much fewer: the window's main lobe
FIRST = 4  # bins: below, the window sees the mean


def noise_from_residual(left: np.ndarray, motion: np.ndarray) -> tuple[float, np.ndarray, float] | None:
    """Innovation deviation, coefficients and how many samples that is worth, from what is `left` over of a record and the
    `motion` predicted, both (n,); None where it is too short, or where physics left out goes through all frequencies."""
    n = len(left)
    if n < SHORTEST:
        return None
    window = blackmanharris(n)
    window /= np.sqrt(np.sum(window**2))
    spectrum, moving = (np.abs(np.fft.rfft(window * (y - np.mean(y)))[FIRST:-1]) ** 2 for y in (left, motion))
    moving = median_filter(moving, WIDTH, mode="reflect")
    around = median_filter(spectrum, WIDTH, mode="reflect")
    turn = np.exp(-2j * np.pi * (np.arange(len(spectrum)) + FIRST) / n)
    lines = spectrum > OUTSTANDING * around
    chosen = (moving <= np.median(moving)) & ~lines
    if not np.any(spectrum[chosen] > 0):
        return None
    for _ in range(1 + WIDENINGS):
        sd, a = _fitted(spectrum[chosen], turn[chosen], n)
        chosen |= (around * MEDIAN <= ALIKE * sd**2 / np.abs(1 - a * turn) ** 2) & ~lines
    if a > 0.999 * MOST:  # that is physics left out, fast as well as slow
        return None
    return sd, np.array([a] if a else []), np.count_nonzero(chosen) / LOBE


def _fitted(power: np.ndarray, turn: np.ndarray, n: int) -> tuple[float, float]:
    """s and a; a = 0 unless the spectrum is surely not level."""

    def gain(a: float) -> np.ndarray:
        return np.abs(1 - a * turn) ** 2

    def unlikely(a: float) -> float:
        """-2 ln L, up to a constant, with the best s."""
        return float(2 * len(power) * np.log(np.mean(power * gain(a))) - 2 * np.sum(np.log(gain(a))))

    best = minimize_scalar(unlikely, bounds=(-MOST, MOST), method="bounded").x
    a = best if (unlikely(0.0) - unlikely(best)) / LOBE > np.log(n) else 0.0
    return float(np.sqrt(np.mean(power * gain(a)))), a

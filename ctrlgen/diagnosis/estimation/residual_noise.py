"""Noise where no rest, repeat or dwell tells it: from what the described device leaves over at the quiet frequencies.

At the half of the frequencies at which the readings move least, what is left over is noise rather than physics left
out. There its spectrum is fitted by that of autoregressive noise of order one, S(w) = s^2/|1 - a e^(-iw)|^2, by Whittle's
likelihood (P. Whittle, Arkiv for Matematik 2 (1953) 423), and continued to the others.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal.windows import blackmanharris

from ctrlgen.diagnosis.settings import RESIDUAL_NOISE
from ctrlgen.numerics.spectral_peaks import local_floor, periodogram

MEDIAN = 1 / np.log(2)  # mean over median of a spectrum's bins, which are exponential


def noise_from_residual(left: np.ndarray, motion: np.ndarray) -> tuple[float, np.ndarray, float] | None:
    """Innovation deviation, coefficients and how many samples that is worth, from what is `left` over of a record and the
    `motion` predicted, both (n,); None where it is too short, or where physics left out goes through all frequencies."""
    n = len(left)
    if n < RESIDUAL_NOISE.shortest:
        return None
    window = blackmanharris(n)
    window /= np.sqrt(np.sum(window**2))
    spectrum, moving = (periodogram(y - np.mean(y), window)[RESIDUAL_NOISE.first_bin : -1] for y in (left, motion))
    moving = local_floor(moving, RESIDUAL_NOISE.smoothing_bins)
    around = local_floor(spectrum, RESIDUAL_NOISE.smoothing_bins)
    turn = np.exp(-2j * np.pi * (np.arange(len(spectrum)) + RESIDUAL_NOISE.first_bin) / n)
    lines = spectrum > RESIDUAL_NOISE.line_ratio * around
    chosen = (moving <= np.median(moving)) & ~lines
    if not np.any(spectrum[chosen] > 0):
        return None
    for _ in range(1 + RESIDUAL_NOISE.widenings):
        sd, a = _fitted(spectrum[chosen], turn[chosen], n)
        chosen |= (around * MEDIAN <= RESIDUAL_NOISE.agreement * sd**2 / np.abs(1 - a * turn) ** 2) & ~lines
    if a > 0.999 * RESIDUAL_NOISE.largest_pole:  # that is physics left out, fast as well as slow
        return None
    return sd, np.array([a] if a else []), np.count_nonzero(chosen) / RESIDUAL_NOISE.window_bins


def _fitted(power: np.ndarray, turn: np.ndarray, n: int) -> tuple[float, float]:
    """s and a; a = 0 unless the spectrum is surely not level."""

    def gain(a: float) -> np.ndarray:
        return np.abs(1 - a * turn) ** 2

    def unlikely(a: float) -> float:
        """-2 ln L, up to a constant, with the best s."""
        return float(2 * len(power) * np.log(np.mean(power * gain(a))) - 2 * np.sum(np.log(gain(a))))

    best = minimize_scalar(
        unlikely, bounds=(-RESIDUAL_NOISE.largest_pole, RESIDUAL_NOISE.largest_pole), method="bounded"
    ).x
    a = best if (unlikely(0.0) - unlikely(best)) / RESIDUAL_NOISE.window_bins > np.log(n) else 0.0
    return float(np.sqrt(np.mean(power * gain(a)))), a

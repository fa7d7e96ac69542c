"""Noise of a channel from the residual of the described device at quiet frequencies, where no better source exists.

At the half of the frequencies at which the readings move least, the residual is noise rather than physics that was left
out. There its spectrum is fitted by that of first-order autoregressive noise, S(w) = s^2/|1 - a exp(-i w)|^2, by Whittle's
likelihood (P. Whittle, Arkiv for Matematik 2 (1953) 423), which also gives the noise at the other frequencies.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter
from scipy.signal.windows import blackmanharris

from ctrlgen.estimation.noise import fastest_part
from ctrlgen.estimation.settings import RESIDUAL_NOISE
from ctrlgen.numerics.spectral_peaks import local_floor, periodogram
from ctrlgen.recordings.recording import Recording

# of an exponential variable, as the bins of a noise spectrum are
MEAN_OVER_MEDIAN = 1 / np.log(2)
LOUDER = 3.0
"""Times by which noise may have larger third differences than most readings have, noise and motion together: a noise that is louder on
the move than in the quieter half of the samples is so by a factor. Judgement."""


def louder_than_readings(recording: Recording, i: int, sd: float, a: np.ndarray) -> bool:
    """Whether autoregressive noise with innovations `sd` and coefficients `a` (p,) is louder than channel i: its third differences are
    beyond those of most readings. Not of readings that passed a low-pass, whose noise has hardly any.
    """
    if any(r.band for r in recording.records):
        return False
    impulse = np.zeros(4096)
    impulse[:4] = 1.0, -3.0, 3.0, -1.0
    alone = sd * np.linalg.norm(lfilter([1.0], np.concatenate([[1.0], -a]), impulse))
    return bool(alone > LOUDER * fastest_part(recording, i)[0])


def noise_from_residual(
    residual: np.ndarray, motion: np.ndarray, highest: float = 1.0
) -> tuple[float, np.ndarray, float] | None:
    """Standard deviation of the innovations, coefficients (0,) or (1,), and number of independent samples of the estimate.

    `residual` (n,) is observed minus predicted, `motion` (n,) the prediction, of one channel without gaps. Frequencies up to
    the share `highest` of half the rate count: readings that passed a low-pass hold no noise beyond its cut-off. None where the
    record is too short, the residual is zero, or its slope in the spectrum is that of physics left out at all frequencies.
    """
    n = len(residual)
    if n < RESIDUAL_NOISE.shortest:
        return None
    window = blackmanharris(n)
    window /= np.sqrt(np.sum(window**2))
    last = int(RESIDUAL_NOISE.within_band * highest * (n // 2)) if highest < 1 else n // 2
    if last - RESIDUAL_NOISE.first_bin < RESIDUAL_NOISE.smoothing_bins:
        return None
    bins = slice(RESIDUAL_NOISE.first_bin, last)
    power, moving = (periodogram(y - np.mean(y), window)[bins] for y in (residual, motion))
    moving, level = (local_floor(spectrum, RESIDUAL_NOISE.smoothing_bins) for spectrum in (moving, power))
    # exp(-i w) of each bin
    turn = np.exp(-2j * np.pi * (np.arange(len(power)) + RESIDUAL_NOISE.first_bin) / n)
    lines = power > RESIDUAL_NOISE.line_ratio * level
    chosen = (moving <= np.median(moving)) & ~lines
    if not np.any(power[chosen] > 0):
        return None
    for _ in range(1 + RESIDUAL_NOISE.widenings):
        sd, a = _whittle_fit(power[chosen], turn[chosen], n)
        fitted = sd**2 / np.abs(1 - a * turn) ** 2
        chosen |= (level * MEAN_OVER_MEDIAN <= RESIDUAL_NOISE.agreement * fitted) & ~lines
    # at its bound
    if a > 0.999 * RESIDUAL_NOISE.largest_pole:
        return None
    return sd, np.array([a] if a else []), np.count_nonzero(chosen) / RESIDUAL_NOISE.window_bins


def _whittle_fit(power: np.ndarray, turn: np.ndarray, n: int) -> tuple[float, float]:
    """s and a of S(w) from the `power` of m bins with exp(-i w) = `turn`, both (m,); a = 0 unless BIC prefers another.

    `n` is the number of samples of the record.
    """

    def inverse_shape(a: float) -> np.ndarray:
        return np.abs(1 - a * turn) ** 2

    def deviance(a: float) -> float:
        """-2 ln of Whittle's likelihood at the best s, up to a constant."""
        return float(2 * len(power) * np.log(np.mean(power * inverse_shape(a))) - 2 * np.sum(np.log(inverse_shape(a))))

    most = RESIDUAL_NOISE.largest_pole
    best = minimize_scalar(deviance, bounds=(-most, most), method="bounded").x
    # the window makes bins dependent
    gain = (deviance(0.0) - deviance(best)) / RESIDUAL_NOISE.window_bins
    a = best if gain > np.log(n) else 0.0
    return float(np.sqrt(np.mean(power * inverse_shape(a)))), a

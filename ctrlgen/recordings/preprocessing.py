"""Columns as measured -> columns as judged: low-pass without phase, derivatives that nobody recorded, fewer rows.

What is derived from a position and what it is compared with go through the same filter, so that a linear law between
them stays what it was.
"""

from __future__ import annotations

import numpy as np
import scipy  # its parts take a while to import, and come when they are used

ORDER = 4  # of the Butterworth filter, run forward and backward
WIDEST = 0.9  # of the highest frequency that the kept rows can hold


def low_passed(values: np.ndarray, sample_time: float, cutoff: float) -> np.ndarray:
    """`values` (n,) without what is above `cutoff` [Hz], without phase: 6 dB down there, 48 dB an octave beyond."""
    return scipy.signal.sosfiltfilt(scipy.signal.butter(ORDER, cutoff, fs=1 / sample_time, output="sos"), values)


def shifted(values: np.ndarray, time: np.ndarray, lag: float) -> np.ndarray:
    """`values` (n,) at `time` (n,), taken `lag` [s] before; straight between samples, NaN before the first."""
    return np.interp(time - lag, time, values, left=np.nan, right=np.nan)


def derived(values: np.ndarray, sample_time: float, order: int) -> np.ndarray:
    """The first or second derivative in time of `values` (n,) by central differences; one-sided at the ends."""
    for _ in range(order):
        values = np.gradient(values, sample_time)
    return values


def widest(sample_time: float, keep_every: int) -> float:
    """The highest cut-off [Hz] that leaves room below half the rate of the kept rows."""
    return WIDEST / (2 * sample_time * keep_every)

"""A drive across rows that are missing: held, linear, or as smooth as it is elsewhere; and how well each of them tells it.

Smooth means autoregressive: of the missing samples those that leave the least squares of the prediction errors of an autoregressive
model of the samples around (A. J. E. M. Janssen, R. N. J. Veldhuis, L. B. Vries, IEEE Trans. ASSP 34 (1986) 317). Sums of sines and
whatever is sampled fast beside its own changes are exact but for rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

Way = Literal["held", "linear", "smooth"]

ORDER = 24  # of the autoregressive model: a dozen sines
WINDOW = 150  # rows on either side that the model is taken from
REACH = 400  # rows on either side of a gap in which trials are made
TRIALS = 8  # gaps of the same length that are made there in rows that are known
QUANTILE = 0.9  # of the errors of the trials: a drive may have a few corners


def across(drive: np.ndarray, a: int, b: int, way: Way) -> np.ndarray:
    """One drive (b - a,) in the rows a to b, half open, of `drive` (n,), which is known on both sides of them; in rows between where it is
    known, too, since another drive is missing, it goes by these."""
    return _WAYS[way](drive, a, b)


def error(drive: np.ndarray, a: int, b: int, way: Way) -> float:
    """How far `way` is off in gaps as long as rows a to b [range of the drive], by trials around them where `drive` (n,) is known;
    infinite where it cannot be tried."""
    span, length = float(np.nanmax(drive) - np.nanmin(drive)), b - a
    low, side = max(a - REACH, 0), max(length, 3)
    x = drive[low : b + REACH]
    if 2 * side + length > len(x) or span == 0:
        return np.inf if span else 0.0
    clear = np.convolve(np.isnan(x), np.ones(2 * side + length, int), "valid") < 0.5
    begins = low + np.flatnonzero(clear) + side
    if not len(begins):
        return np.inf
    off = []
    for first in begins[np.linspace(0, len(begins) - 1, min(TRIALS, len(begins))).astype(int)].tolist():
        start, last = max(first - WINDOW, 0), first + length
        tried = drive[start : last + WINDOW].copy()
        tried[first - start : last - start] = np.nan
        values = across(tried, first - start, last - start, way)
        off.append(np.abs(values - drive[first:last]).max())
    return float(np.quantile(off, QUANTILE) / span)


def _held(u: np.ndarray, a: int, b: int) -> np.ndarray:
    rows = np.arange(a - 1, b)
    return u[np.maximum.accumulate(np.where(np.isfinite(u[a - 1 : b]), rows, a - 1))][1:]


def _linear(u: np.ndarray, a: int, b: int) -> np.ndarray:
    known = a - 1 + np.flatnonzero(np.isfinite(u[a - 1 : b + 1]))
    return np.interp(np.arange(a, b), known, u[known])


def _smooth(u: np.ndarray, a: int, b: int) -> np.ndarray:
    low, high = max(a - WINDOW, 0), min(b + WINDOW, len(u))
    x = u[low:high]
    gap = np.zeros(len(x), bool)
    gap[a - low : b - low] = True
    centre = np.nanmean(x)
    x = x - centre
    order = min(ORDER, len(x) // 6)
    if order < 2:
        return _linear(u, a, b)
    windows = np.lib.stride_tricks.sliding_window_view(x, order + 1)
    whole = np.isfinite(windows).all(axis=1)
    if whole.sum() < order:
        return _linear(u, a, b)
    scale = np.nanmax(np.abs(x)) or 1.0
    # what is predicted forward is predicted backward, too; singular for few sines: the smallest coefficients of all
    ways = np.vstack([windows[whole], windows[whole, ::-1]]) / scale
    coefficients = np.linalg.lstsq(ways[:, :-1], ways[:, -1], rcond=1e-10)[0]
    weights = np.concatenate([-coefficients, [1.0]])
    # prediction errors that a sample of the gap takes part in, with what else is missing there
    near = np.flatnonzero(np.lib.stride_tricks.sliding_window_view(gap, order + 1).any(axis=1))
    both = np.zeros((2, len(near), len(x)))
    for k, w in enumerate((weights, weights[::-1])):
        both[k, np.arange(len(near))[:, None], near[:, None] + np.arange(order + 1)] = w
    touched = both.reshape(-1, len(x))
    missing = ~np.isfinite(x) & touched.any(axis=0)
    known = np.where(np.isfinite(x), x, 0.0)
    solved = np.linalg.lstsq(touched[:, missing], -touched @ known, rcond=1e-12)[0]
    filled = known
    filled[missing] = solved
    return filled[gap] + centre


_WAYS: dict[Way, Callable[[np.ndarray, int, int], np.ndarray]] = {"held": _held, "linear": _linear, "smooth": _smooth}

"""Home returns in a set of settled poses: how well home is read again, and how fast its reading drifts. Source: S0 section 3.1.

The reading of the k-th pose, where the drives are those of home, is y_k = a + r k + e_k: r the drift a pose, s the standard deviation of
the e_k, independent of each other, which is the repeatability. Of n returns, r has the interval r +- t s/sqrt(sum (k - mean k)^2) and s
that of chi-square, both with n - 2 degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.stats

HOME = 1e-6
"""Of a drive's largest size, below which it is zero: what a converter of 20 bits cannot tell from it."""
LEAST = 3
"""Returns that a drift and a repeatability take: two numbers and one degree of freedom."""
COVERAGE = 0.95
"""Probability of the intervals."""


@dataclass(frozen=True)
class HomeReturns:
    """`order` (n,) of the returns among the poses, `drift` (channels,) [SI a pose], `repeatability` (channels,) [SI], one standard
    deviation; each with its 95 % `..._interval` (channels, 2)."""

    order: np.ndarray
    drift: np.ndarray
    drift_interval: np.ndarray
    repeatability: np.ndarray
    repeatability_interval: np.ndarray

    @property
    def drifts(self) -> np.ndarray:
        """(channels,) whether the drift's interval leaves zero out."""
        return np.asarray((self.drift_interval[:, 0] > 0) | (self.drift_interval[:, 1] < 0))

    def drifted(self, order: np.ndarray) -> np.ndarray:
        """(n, channels) [SI] what the drift has added at poses of this `order` (n,) since the first return; of channels that `drifts`
        says nothing of, nothing."""
        return np.outer(order - self.order[0], np.where(self.drifts, self.drift, 0.0))


def at_home(drive: np.ndarray) -> np.ndarray:
    """(n,) which poses of `drive` (n, n_u) are returns to home, where no drive acts."""
    return np.asarray(np.all(np.abs(drive) <= HOME * np.abs(drive).max(axis=0, initial=0.0), axis=1))


def home_returns(order: np.ndarray, readings: np.ndarray) -> HomeReturns | None:
    """Drift and repeatability of the `readings` (n, channels) of home at poses of this `order` (n,); None for fewer than three."""
    n = len(order)
    if n < LEAST:
        return None
    k = order - order.mean()
    size = float(k @ k)
    drift = k @ readings / size
    left = readings - readings.mean(axis=0) - np.outer(k, drift)
    free = n - 2
    sd = np.sqrt(np.sum(left**2, axis=0) / free)
    half = scipy.stats.t.ppf(0.5 + COVERAGE / 2, free) * sd / np.sqrt(size)
    low, high = (np.sqrt(free / scipy.stats.chi2.ppf(0.5 + side * COVERAGE / 2, free)) for side in (1, -1))
    return HomeReturns(
        order, drift, np.column_stack([drift - half, drift + half]), sd, np.column_stack([sd * low, sd * high])
    )

"""A steady drift of the readings through successive periods of a closed path."""

from __future__ import annotations

import numpy as np
from scipy.stats import t as student

SURE = 4.0
"""Standard errors from which on a drift, a zero or a delay counts as seen; each is the mean of many numbers. One in 16,000."""
ONE_SIDED = 1e-3
"""Chance with which it may be seen of periods whose means scatter. Few periods: a smaller one would hide a drift of their size."""
FEWEST_SCATTER = 5
"""Periods from which on the scatter of their means tells slow noise: of fewer it is hardly known."""
QUARTERS = 4
"""Parts of a period in which it must be the same. Judgement: enough to tell a line from what settles, few enough that each
is a mean of many."""
EVEN = 0.5
"""Of its mean, by which it may differ from quarter to quarter, beyond noise. Judgement: what settles within a
period falls to less."""


def drift_of(y: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """(n_y,) by how much readings (m, n, n_y) of m successive periods drift in one; zero where that is not seen. `noise` (n_y,), where it
    is stated.

    The slope of the straight line through the means of the periods; of a drift that is steady the change from period to period is the same
    in every quarter.
    """
    m, n, n_y = y.shape
    drift = np.zeros(n_y)
    if m < 2 or n < 2 * QUARTERS:
        return drift
    for i in range(n_y):
        change = np.diff(y[:, :, i], axis=0)
        if not np.isfinite(change).any(axis=1).all():
            continue
        means, k = np.nanmean(y[:, :, i], axis=1), np.arange(m) - (m - 1) / 2
        slope = float(np.sum(k * means) / np.sum(k**2))
        quarters = np.array([np.nanmean(part) for part in np.array_split(change, QUARTERS, axis=1)])
        white = float(np.nanstd(change - np.nanmean(change, axis=1, keepdims=True))) / np.sqrt(2)
        white = max(white, noise[i] if np.isfinite(noise[i]) else 0.0)
        se, within = white / np.sqrt(n * np.sum(k**2)), SURE * white * np.sqrt(2 * QUARTERS / n / (m - 1))
        if m >= FEWEST_SCATTER:  # noise that is slower than a period
            scatter = np.sqrt(np.sum((means - means.mean() - slope * k) ** 2) / (m - 2) / np.sum(k**2))
            se = max(se, float(scatter * student.isf(ONE_SIDED, m - 2)) / SURE)
        even = np.all(np.abs(quarters - slope) <= EVEN * abs(slope) + within)
        if even and abs(slope) > SURE * se:
            drift[i] = slope
    return drift


def without_drift(y: np.ndarray, drift: np.ndarray) -> np.ndarray:
    """Readings (m, n, n_y) with a steady `drift` (n_y,) a period taken out, from the first sample on."""
    m, n, _ = y.shape
    return y - (np.arange(m * n) / n).reshape(m, n, 1) * drift

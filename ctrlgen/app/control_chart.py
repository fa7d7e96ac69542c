"""Control charts of numbers that come one after another, and whether they drift.

Individuals and moving ranges: with the median m of the numbers and the median of |x_k - x_(k-1)|, the limits are

    m +- 3.145 median moving range,

three standard deviations of a normal process (3/0.954), which single outliers do not widen. A drift is a rank correlation with the
order (Kendall's tau) that chance gives less often than once in `CHANCE`; its size is the median slope (Theil and Sen).

Source: D. J. Wheeler, Understanding Statistical Process Control, 3rd ed. (2010), ch. 9; D. C. Montgomery, Introduction to Statistical
Quality Control, 7th ed. (2012), sec. 6.4; P. K. Sen, J. Am. Stat. Assoc. 63 (1968) 1379.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import kendalltau, theilslopes

FACTOR = 3.145  # from the median moving range to three standard deviations
LEAST = 8  # numbers from which limits are drawn: the median of fewer ranges is off by a third and more
CHANCE = 0.0027  # outside three standard deviations, of a normal distribution


@dataclass(frozen=True)
class ControlChart:
    """`values` (n,), NaN where there is none; `centre`, and the limits `low` and `high`, None where there are too few or
    they drift; which are `outside` (their places), of the trend where they drift; `drift`: the change from the first to the last, None
    where there is none."""

    values: np.ndarray
    centre: float
    low: float | None
    high: float | None
    outside: tuple[int, ...]
    drift: float | None


def control_chart(values: np.ndarray, positive: bool = False) -> ControlChart:
    """The chart of `values` (n,) in their order; `positive`: sizes, whose logarithms are judged."""
    values = np.asarray(values, float)
    seen = np.flatnonzero(np.isfinite(values) & ((values > 0) | (not positive)))
    x = np.log(values[seen]) if positive else values[seen]
    back = np.exp if positive else np.asarray
    if not len(x):
        return ControlChart(values, float("nan"), None, None, (), None)
    centre = float(np.median(x))
    if len(x) < LEAST:
        return ControlChart(values, float(back(centre)), None, None, (), None)
    if np.ptp(x) > 0 and kendalltau(seen, x).pvalue < CHANCE:
        slope, level, _, _ = theilslopes(x, seen)
        trend = level + slope * seen
        drift = float(back(trend[-1]) - back(trend[0]))
        return ControlChart(values, float(back(centre)), None, None, _outside(seen, x - trend), drift)
    reach = _reach(x)
    outside = _outside(seen, x - centre)
    return ControlChart(
        values, float(back(centre)), float(back(centre - reach)), float(back(centre + reach)), outside, None
    )


def _reach(deviations: np.ndarray) -> float:
    return FACTOR * float(np.median(np.abs(np.diff(deviations))))


def _outside(places: np.ndarray, deviations: np.ndarray) -> tuple[int, ...]:
    return tuple(int(places[k]) for k in np.flatnonzero(np.abs(deviations) > _reach(deviations)))

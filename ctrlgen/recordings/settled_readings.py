"""From where readings stand still while the drives do: a rest gives their noise."""

from __future__ import annotations

import numpy as np

SETTLED = 2.0  # standard deviations of a rest's end, from which a tenth of the rest that scatters by more about it still settles
NORMAL_MEDIAN = 0.6745  # standard deviations: the median size of normal noise
TREND = 0.5  # of the variance of a rest's end, from which its slope is a motion and no noise
GLITCHES = 0.01  # of the rows of a rest's end, on each side, that may be off by any amount: farther than the others span, none counts so


def settled(readings: np.ndarray, first: int, last: int, shortest: int) -> int | None:
    """The row from which no reading (n, readings) moves any more, of a rest of the drives from row `first` to one before `last`.

    None where at its end they still do, or where fewer than the `shortest` rows are left. A drive that stands still says nothing of a tank
    that fills, or of a mass that swings after its last step. A reading in counts may be half a count nearer than it says.
    """
    tenth, begin = max((last - first) // 10, 1), first
    for y in readings[first:last].T:
        y = np.where(np.isfinite(y), y, np.nanmedian(y)) if np.isfinite(y).any() else np.zeros_like(y)
        end = y[len(y) // 2 :]
        low, high = np.quantile(end, (GLITCHES, 1 - GLITCHES))
        end = np.clip(end, low - (high - low), high + (high - low))
        t = np.linspace(-1.0, 1.0, len(end))
        slope = float(t @ end / (t @ t))
        if slope**2 * np.mean(t**2) > TREND * np.var(end):
            return None
        # of the whole rest: where its end is one value but for a glitch, the glitch is no count
        count = float(np.diff(np.unique(y)).min()) if np.ptp(y) > 0 else 0.0
        away = np.maximum(np.abs(y - np.median(end)) - count / 2, 0.0) / NORMAL_MEDIAN
        parts = np.array([np.median(away[k : k + tenth]) for k in range(0, len(y), tenth)])
        off = np.flatnonzero(parts > SETTLED * np.std(end))
        begin = max(begin, first + (int(off[-1]) + 1) * tenth if len(off) else first)
    return begin if last - begin >= shortest else None

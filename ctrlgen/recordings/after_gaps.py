"""What a bridge that is not quite right does to the readings after it: whether it may be, and which readings then carry no weight.

A drive that is off by e [drive] over m rows acts on the described device as a pulse of the area e m. What such a pulse does to the
readings is simulated once for each drive, in the widest gap, as the difference of two simulations of the record; all other gaps are in
proportion, their errors independent of each other. A memory that is not described yet comes on top: a share g of the static reading
that follows with any time constant is off by at most g e m / (m + k) (k / (m + k))^(k / m), k rows after the gap.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ctrlgen.core.errors import SolverError
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import simulate
from ctrlgen.numerics.quantisation_step import quantisation_step
from ctrlgen.recordings.outliers import MAD
from ctrlgen.recordings.recording import Record

FRACTION = 0.3  # of the noise of a reading: added to it in squares, 4 %
LEAD, HORIZON = (
    100,
    2000,
)  # rows before and after the widest gap that are simulated; what lasts longer is taken to last for ever
UNDESCRIBED = 0.2  # of a static reading: what a stack's hysteresis or creep has, or a joint's
SOON = 5  # lengths of a gap after which what is not described is left to the fit: 7 % of `UNDESCRIBED` at the worst time constant
KNOWN = 1e-6  # of a drive's range: a bridge as right as that does nothing
THIRD = np.sqrt(20.0)  # deviation of third differences of white noise over its own


@dataclass(frozen=True)
class Gap:
    """Rows `a` to `b`, half open, and how far the drive (n_u,) may be off in them [SI]."""

    a: int
    b: int
    off: np.ndarray

    @property
    def area(self) -> np.ndarray:
        """Of the pulse (n_u,) that is wrong [SI times rows]."""
        return self.off * (self.b - self.a)


@dataclass(frozen=True)
class Described:
    """The device as described, its observed `channels`, such as 'reading.axis', and the `noise` stated for some [SI]."""

    model: Model
    channels: Sequence[str]
    noise: Mapping[str, float]

    def after(self, record: Record, gaps: Sequence[Gap]) -> list[np.ndarray]:
        """How far [their noise] each gap of a bridged record leaves the readings (rows, n_y) wrong from its end on, the last row for all
        that follow."""
        readings = zip(self.channels, record.observed.T, strict=True)
        noise = np.array([(self.noise.get(c) or _noise(y)) if np.isfinite(y).any() else np.inf for c, y in readings])
        moved = np.ptp(np.where(np.isfinite(record.observed), record.observed, _first_reading(record.observed)), axis=0)
        wrong = [np.zeros((min(len(record.time) - g.b, HORIZON), len(self.channels))) for g in gaps]
        for i, span in enumerate(np.ptp(record.drive, axis=0)):
            if not any(g.off[i] > KNOWN * span for g in gaps):
                continue
            worst = max(gaps, key=lambda g: g.area[i])
            lasting = self._response(record, worst, i)
            for g, squares in zip(gaps, wrong, strict=True):
                if g.off[i] > KNOWN * span:
                    rows = len(squares)
                    squares += (g.area[i] * _lengthened(lasting, rows)) ** 2
                    squares += (g.off[i] / span * moved * _undescribed(g.b - g.a, rows)[:, None]) ** 2
        with np.errstate(divide="ignore", invalid="ignore"):
            return [np.where(squares > 0, np.sqrt(squares) / noise, 0.0) for squares in wrong]

    def _response(self, record: Record, gap: Gap, i: int) -> np.ndarray:
        """The most (rows, n_y) that the readings are off from k rows after a pulse of drive i on, over its area [SI]."""
        first = max(gap.a - LEAD, 0)
        u = record.drive[first : gap.b + HORIZON]
        pulsed = u.copy()
        inside = slice(gap.a - first, gap.b - first)
        pulsed[inside, i] += gap.off[i] * np.where(
            u[inside, i] > np.mean(record.drive[:, i]), -1, 1
        )  # within its range
        try:
            one, other = (self._readings(v, record.sample_time) for v in (u, pulsed))
        except SolverError:  # the device as described cannot follow: nothing is known
            return np.full((1, len(self.channels)), np.inf)
        later = np.abs(one - other)[inside.stop : len(u)] / gap.area[i]
        return np.maximum.accumulate(later[::-1], axis=0)[::-1]

    def _readings(self, u: np.ndarray, sample_time: float) -> np.ndarray:
        signals = simulate(self.model, u, sample_time).signals
        places = [c.split(".", 1) for c in self.channels]
        columns = [signals[role][:, self.model.signals[role].channels.index(name)] for role, name in places]
        return np.column_stack(columns)


def _lengthened(lasting: np.ndarray, rows: int) -> np.ndarray:
    """The response (m, n_y) over `rows`, the last value for what was not simulated."""
    more = max(rows - len(lasting), 0)
    return np.pad(lasting[:rows], ((0, more), (0, 0)), mode="edge")


def _undescribed(m: int, rows: int) -> np.ndarray:
    """What a memory of the worst time constant makes of a pulse of `m` rows (rows,), over its height."""
    k = np.arange(rows, dtype=float)
    return np.where(k < SOON * m, UNDESCRIBED * m / (m + k) * (k / (m + k)) ** (k / m), 0.0)


def _first_reading(y: np.ndarray) -> np.ndarray:
    """The first reading of each channel of `y` (n, n_y), 0 where there is none."""
    there = np.isfinite(y)
    return np.where(there.any(axis=0), np.nan_to_num(y[there.argmax(axis=0), np.arange(y.shape[1])]), 0.0)


def _noise(y: np.ndarray) -> float:
    """Of a reading (n,) by its third differences, which a motion that is slow beside the samples does not have, no less than rounding
    leaves [SI]."""
    thirds = np.abs(np.diff(y[np.isfinite(y)], 3))
    rounding = quantisation_step(y) / np.sqrt(12)
    return max(float(MAD * np.median(thirds) / THIRD) if len(thirds) else 0.0, rounding)

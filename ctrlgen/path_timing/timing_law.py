"""A law of time: which share of a path is behind at each moment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

DENSE = 20  # places in each interval between nodes at which the law is inverted


@dataclass(frozen=True)
class TimingLaw:
    """`time` (n,) [s] at which the `share` (n,) of the path is behind; `derivatives` (n, order) [1/s^k] of the share there, the speed
    first. Between nodes the share is the polynomial that these determine."""

    time: np.ndarray
    share: np.ndarray
    derivatives: np.ndarray

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return float(self.time[-1] - self.time[0])

    @cached_property
    def _curve(self) -> scipy.interpolate.BPoly:
        return scipy.interpolate.BPoly.from_derivatives(self.time, np.column_stack([self.share, self.derivatives]))

    def at(self, time: np.ndarray, order: int = 0) -> np.ndarray:
        """The share, or its derivative of this order by time."""
        return np.asarray(self._curve(np.clip(time, self.time[0], self.time[-1]), nu=order))

    def when(self, share: np.ndarray) -> np.ndarray:
        """The times at which shares are behind."""
        n = DENSE * (len(self.time) - 1) + 1
        dense = np.interp(np.linspace(0, len(self.time) - 1, n), np.arange(len(self.time)), self.time)
        return np.interp(share, np.maximum.accumulate(self.at(dense)), dense)

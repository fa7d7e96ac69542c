"""When the samples of a path are: each an equilibrium of its own, or one after the other in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.core.units import show


@dataclass(frozen=True)
class Settled:
    """Every sample is an equilibrium of its own; no time passes between them."""

    def times(self, n: int) -> np.ndarray:
        """(n,) [s] of the samples: all zero."""
        return np.zeros(n)

    def moment(self, k: int) -> str:
        """The time of a sample, for a message: none."""
        return ""


@dataclass(frozen=True)
class Sampled:
    """A sample every `sample_time` [s]; a drive is held from one to the next."""

    sample_time: float

    def times(self, n: int) -> np.ndarray:
        """(n,) [s] of the samples."""
        return np.arange(n) * self.sample_time

    def moment(self, k: int) -> str:
        """The time of a sample, for a message: ' at 3 ms'."""
        return f" at {show(k * self.sample_time, 's')}"


Clock = Settled | Sampled


def in_time(clock: Clock) -> Sampled:
    """The clock of samples that follow one another in time. Raises ValueError for equilibria, between which no time passes."""
    if isinstance(clock, Settled):
        raise ValueError("the samples are equilibria: no time passes between them")
    return clock

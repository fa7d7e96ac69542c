"""A commanded motion: samples of a target with as many derivatives by time as the drive follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Motion:
    """`position` (n, channels) [SI] at the samples, and `derivatives` (order, n, channels) [SI, by time], the first one first: of order
    zero for a stage in balance. Of a `closed` motion the first sample follows the last one."""

    position: np.ndarray
    derivatives: np.ndarray
    closed: bool

    @classmethod
    def of_samples(cls, position: np.ndarray, closed: bool = False) -> Motion:
        """A motion of the samples (n, channels) [SI], without derivatives."""
        return cls(position, np.zeros((0, *position.shape)), closed)

    @property
    def order(self) -> int:
        """The number of its derivatives."""
        return len(self.derivatives)

    def __len__(self) -> int:
        return len(self.position)

    def __add__(self, shift: np.ndarray) -> Motion:
        """The motion shifted by a vector (channels,)."""
        return Motion(self.position + shift, self.derivatives, self.closed)

    def scaled(self, share: float) -> Motion:
        """The motion scaled about its middle."""
        position = self.middle + share * (self.position - self.middle)
        return Motion(position, share * self.derivatives, self.closed)

    @property
    def middle(self) -> np.ndarray:
        """(channels,) halfway between the ends of each channel."""
        return (self.position.min(axis=0) + self.position.max(axis=0)) / 2

    @property
    def following(self) -> np.ndarray:
        """(n,) the sample after each: the first one after the last of a closed motion, the last one again of an open one."""
        n = len(self)
        return np.append(np.arange(1, n), 0 if self.closed else n - 1)

    def at(self, chosen: np.ndarray) -> Motion:
        """The motion at the samples `chosen` alone."""
        return Motion(self.position[chosen], self.derivatives[:, chosen], self.closed)

    def stacked(self) -> np.ndarray:
        """(n, channels, order + 1): each channel with its derivatives."""
        return np.moveaxis(np.concatenate([self.position[None], self.derivatives]), 0, -1)

"""A commanded motion: samples of a target with their derivatives by time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Motion:
    """`position` (n, channels) [SI] at the samples, and `derivatives` (order, n, channels) [SI, by time], the first one first."""

    position: np.ndarray
    derivatives: np.ndarray

    def __len__(self) -> int:
        return len(self.position)

    def __add__(self, shift: np.ndarray) -> Motion:
        """The motion shifted by a vector (channels,)."""
        return Motion(self.position + shift, self.derivatives)

    def at(self, chosen: np.ndarray) -> Motion:
        """Some of its samples."""
        return Motion(self.position[chosen], self.derivatives[:, chosen])

    def held(self) -> Motion:
        """With one more sample, at rest where it ends."""
        still = np.zeros((len(self.derivatives), 1, self.position.shape[1]))
        ends = np.vstack([self.position, self.position[-1:]])
        return Motion(ends, np.concatenate([self.derivatives, still], axis=1))

    def stacked(self) -> np.ndarray:
        """(n, channels, order + 1): each channel with its derivatives."""
        return np.moveaxis(np.concatenate([self.position[None], self.derivatives]), 0, -1)


Command = (
    np.ndarray | Motion
)  # what is followed: samples (n, channels) [SI], with derivatives where the device has inertia


def samples_of(command: Command) -> np.ndarray:
    """The samples (n, channels) [SI]."""
    return command.position if isinstance(command, Motion) else command


def scaled(command: Command, share: float, middle: np.ndarray) -> Command:
    """The path scaled about a point (channels,)."""
    position = middle + share * (samples_of(command) - middle)
    return Motion(position, share * command.derivatives) if isinstance(command, Motion) else position

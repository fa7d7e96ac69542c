"""Errors between two sets of poses: norms, statistics per channel, parasitic motion.

Source: S0 section 5.

Poses are rows (theta_x, theta_y, theta_z, delta_x, delta_y, delta_z) [rad, m]; an error is measured minus expected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.core.errors import Fault, InputError

CHANNELS = ("theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z")
BOX = (5.0, 95.0)  # percentiles: the boxes of S0 Figs. 7 and 8 hold 90 % of the data


@dataclass(frozen=True)
class ErrorStatistics:
    """Statistics over poses in SI, per channel, or a single number for a norm. `sd` divides by n - 1."""

    maximum: np.ndarray
    minimum: np.ndarray
    mean: np.ndarray
    sd: np.ndarray


@dataclass(frozen=True)
class PoseErrors:
    """`errors` (n, 6), and the statistics of S0 section 5.2.

    `rotation` and `translation` are norms over the three axes, (n,): S0 Fig. 6. `signed` is of the errors themselves,
    `absolute` of their absolute values, whose standard deviation is the one S0 Table 3 prints.
    """

    errors: np.ndarray

    @property
    def rotation(self) -> np.ndarray:
        """|theta error| of every pose [rad], (n,)."""
        return np.linalg.norm(self.errors[:, :3], axis=1)

    @property
    def translation(self) -> np.ndarray:
        """|delta error| of every pose [m], (n,)."""
        return np.linalg.norm(self.errors[:, 3:], axis=1)

    @property
    def signed(self) -> ErrorStatistics:
        """Statistics of the errors, channel by channel."""
        return error_statistics(self.errors)

    @property
    def absolute(self) -> ErrorStatistics:
        """Statistics of the absolute errors, channel by channel."""
        return error_statistics(np.abs(self.errors))


@dataclass(frozen=True)
class Parasitic:
    """The poses commanded in one channel alone, in order of command: S0 Figs. 9 and 10.

    `command` (n,) and `measured` (n,) of the channel itself, `error` its error, `others` (n, 5) the errors of the five
    other `channels`, which are not commanded to move.
    """

    channel: str
    poses: np.ndarray
    command: np.ndarray
    measured: np.ndarray
    error: np.ndarray
    others: np.ndarray
    channels: tuple[str, ...]


def error_statistics(values: np.ndarray) -> ErrorStatistics:
    """Statistics over the rows (poses) of `values`."""
    return ErrorStatistics(values.max(0), values.min(0), values.mean(0), values.std(0, ddof=1))


def pose_errors(measured: np.ndarray, expected: np.ndarray) -> PoseErrors:
    """Measured minus expected. Source: S0 section 5.1, steps 5 and 6. Raises InputError where the shapes do not fit."""
    measured, expected = _two(measured, expected)
    return PoseErrors(measured - expected)


def parasitic(commanded: np.ndarray, measured: np.ndarray) -> list[Parasitic]:
    """The poses that command one channel alone, per channel; channels never commanded alone are left out."""
    measured, commanded = _two(measured, commanded)
    errors = measured - commanded
    alone = np.count_nonzero(commanded, axis=1) == 1
    motions = []
    for i, channel in enumerate(CHANNELS):
        poses = np.flatnonzero(alone & (commanded[:, i] != 0))
        if not poses.size:
            continue
        poses = poses[np.argsort(commanded[poses, i], kind="stable")]
        rest = [k for k in range(6) if k != i]
        motions.append(
            Parasitic(
                channel,
                poses,
                commanded[poses, i],
                measured[poses, i],
                errors[poses, i],
                errors[poses][:, rest],
                tuple(CHANNELS[k] for k in rest),
            )
        )
    return motions


def _two(measured: np.ndarray, expected: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    measured, expected = np.asarray(measured, dtype=float), np.asarray(expected, dtype=float)
    if measured.ndim != 2 or measured.shape != expected.shape or measured.shape[1] != 6 or not len(measured):
        what = f"shapes {measured.shape} and {expected.shape}; two sets of (n, 6) poses in the same order are needed"
        raise InputError("poses", [Fault("measured, expected", what)])
    return measured, expected

"""Drives of a closed path as a Fourier series.

    u_i(k) = a_{0,i} + sum_h a_{h,i} cos(h theta_k) + b_{h,i} sin(h theta_k),    theta_k = 2 pi k/n

cos and sin of theta_k are one complex product of two short tables (the high and the low half of k's bits), those of
its multiples follow by rotation: every sample starts anew, so that nothing drifts and any index may be asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ctrlgen.firmware.cprint import Real

FEWEST = 16  # samples: below, the step between two samples is too wide for the short series of `_at`


@dataclass(frozen=True)
class Fourier:
    """`coefficients` (1 + 2 harmonics, axes): a_0, then a_h and b_h, for a period of `samples`."""

    samples: int
    coefficients: np.ndarray

    kind = "Fourier"

    @property
    def harmonics(self) -> int:
        """Number of harmonics."""
        return (len(self.coefficients) - 1) // 2

    @property
    def axes(self) -> int:
        """Number of drives."""
        return self.coefficients.shape[1]

    @property
    def low_bits(self) -> int:
        """Bits of the index in the fine table; the rest are those of the coarse one."""
        return ((self.samples - 1).bit_length() + 1) // 2

    @property
    def turns(self) -> tuple[np.ndarray, np.ndarray]:
        """(coarse, 2) and (fine, 2): cos and sin of the halves of an index."""
        fine = np.arange(2**self.low_bits)
        coarse = 2**self.low_bits * np.arange(-(-self.samples // len(fine)))
        angle = 2 * np.pi / self.samples
        c, f = (np.column_stack([np.cos(angle * k), np.sin(angle * k)]) for k in (coarse, fine))
        return c, f

    def bytes(self, real: Real) -> int:
        """Constants of the C."""
        return (self.coefficients.size + sum(turn.size for turn in self.turns)) * real.bytes

    @property
    def operations(self) -> int:
        """Arithmetic operations of one sample: place, six a rotation, four a harmonic and drive."""
        return 2 + 6 * self.harmonics + 4 * self.harmonics * self.axes

    def extremes(self) -> tuple[np.ndarray, np.ndarray]:
        """(axes,) bounds of every value: all amplitudes added up."""
        mean, c = self.coefficients[0], self.coefficients[1:]
        size = np.hypot(c[::2], c[1::2]).sum(axis=0)
        return mean - size, mean + size

    def values(self, real: Real) -> np.ndarray:
        """(samples, axes): the drives, in the operations and the order of the C."""
        return self.between(np.arange(self.samples), np.zeros(self.samples), real)

    def between(self, k: np.ndarray, part: np.ndarray, real: Real) -> np.ndarray:
        """The same at k + part, 0 <= part < 1."""
        number: Any = np.float32 if real is Real.FLOAT else np.float64
        coarse, fine = (turn.astype(number) for turn in self.turns)
        c, s = _turn(coarse[k >> self.low_bits].T, fine[k & (2**self.low_bits - 1)].T)
        x = part.astype(number) * number(2 * np.pi / self.samples)
        q = x * x
        one = number(1)
        small = (
            one - q * (number(1 / 2) - q * (number(1 / 24) - q * number(1 / 720))),
            x * (one - q * (number(1 / 6) - q * (number(1 / 120) - q * number(1 / 5040)))),
        )
        turned = _turn((c, s), small)
        c, s = (np.where(part == 0, a, b) for a, b in zip((c, s), turned, strict=True))
        angles = [(c, s)]
        for _ in range(1, self.harmonics):
            angles.append(_turn(angles[-1], (c, s)))
        rows = self.coefficients.astype(number)
        total = np.zeros((len(k), self.axes), number)
        for h in range(self.harmonics, 0, -1):
            c, s = angles[h - 1]
            total = total + ((c[:, None] * rows[2 * h - 1]) + (s[:, None] * rows[2 * h]))
        return total + rows[0]


def series(drive: np.ndarray, harmonics: int) -> Fourier:
    """The series of `drive` (samples, axes) up to `harmonics`, fewer than half the samples."""
    f = np.fft.rfft(drive, axis=0)[: harmonics + 1] / len(drive)
    rows = np.empty((1 + 2 * harmonics, drive.shape[1]))
    rows[0], rows[1::2], rows[2::2] = f[0].real, 2 * f[1:].real, -2 * f[1:].imag
    return Fourier(len(drive), rows)


def _turn(a: Sequence[np.ndarray] | np.ndarray, b: Sequence[np.ndarray] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """cos and sin of the sum of two angles."""
    return (a[0] * b[0]) - (a[1] * b[1]), (a[1] * b[0]) + (a[0] * b[1])

"""A straight flexure that an axial load pulls or presses: its stiffness in a plane of bending, and where it buckles.

Of a uniform piece of length l, p = N l^2/(E I), N the tension, h = sqrt(p)/2: with the fixed end clamped, the force and moment on the
free end per (displacement/l, rotation) are in units of E I/l^2 and E I/l

    [G, -(G - p)/2; -(G - p)/2, a + (G - p)/4],    G = p/(1 - tanh(h)/h),    a = h coth(h):

12 + 6 p/5 - p^2/700 where the end does not turn, a = 1 + p/12 - p^2/720 of the moment that bends it evenly. To first order in p a bent
blade is thus off by p^2/720, 1 % at p = 2.7, and a guided one by p^2/8400, 1 % of its stiffness without a load at p = 9. Between ends
that do not turn a is infinite at p = -4 pi^2, the load at which the piece buckles.

Source: S. P. Timoshenko, J. M. Gere, Theory of Elastic Stability (1961), chapter 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

SMALL = 0.05  # |p| below which G and a are their series, to 1e-9
G_SERIES = (12.0, 6 / 5, -1 / 700, 1 / 63000, -37 / 194040000)
A_SERIES = (1.0, 1 / 12, -1 / 720, 1 / 30240, -1 / 1209600)
HELD = 4 * np.pi**2  # -p at which a uniform piece buckles between ends that do not turn
STEPS = 50  # halvings of the interval that holds a buckling load


def guided(p: float) -> float:
    """G: force on the end of a beam that does not turn, per displacement/l, in E I/l^2."""
    if abs(p) < SMALL:
        return float(np.polyval(G_SERIES[::-1], p))
    h = np.sqrt(complex(p)) / 2
    return float((p / (1 - np.tanh(h) / h)).real)


def bent(p: float) -> float:
    """a: moment that bends a beam evenly, per angle between its ends, in E I/l."""
    if abs(p) < SMALL:
        return float(np.polyval(A_SERIES[::-1], p))
    h = np.sqrt(complex(p)) / 2
    return float((h / np.tanh(h)).real)


@dataclass(frozen=True)
class Piece:
    """A uniform piece: length [m], bending stiffness EI [N m^2]."""

    length: float
    EI: float

    def buckles(self, N: float) -> bool:
        """Whether the tension N [N] is below that at which it buckles between ends that do not turn."""
        return N * self.length**2 / self.EI <= -HELD

    def stiffness(self, N: float) -> np.ndarray:
        """(4, 4) forces and moments on both ends per (y_1, theta_1, y_2, theta_2)."""
        p = N * self.length**2 / self.EI
        return self._matrix(guided(p), bent(p), p)

    @cached_property
    def per_load(self) -> np.ndarray:
        """(4, 4) its slope by N at N = 0."""
        return self._matrix(G_SERIES[1], A_SERIES[1], 1.0) * self.length**2 / self.EI

    def _matrix(self, G: float, a: float, p: float) -> np.ndarray:
        half, own = (G - p) / 2, a + (G - p) / 4
        other = own - 2 * a
        end = np.array([[G, -half], [-half, own]])
        first = np.array([[G, half], [half, own]])
        mixed = np.array([[-G, half], [-half, other]])
        lengths = np.array([1 / self.length, 1.0, 1 / self.length, 1.0])
        whole = np.block([[first, mixed], [mixed.T, end]])
        return self.EI / self.length * whole * np.outer(lengths, lengths)


@dataclass(frozen=True)
class Column:
    """Pieces in line from a fixed end to a free one, in one plane."""

    pieces: tuple[Piece, ...]

    def _assembled(self, matrices: Sequence[np.ndarray]) -> np.ndarray:
        """(2 m, 2 m) over the far ends of the m pieces."""
        K = np.zeros((2 * len(matrices) + 2,) * 2)
        for k, matrix in enumerate(matrices):
            K[2 * k : 2 * k + 4, 2 * k : 2 * k + 4] += matrix
        return K[2:, 2:]

    def stiffness(self, N: float) -> np.ndarray:
        """(2, 2) force and moment on the free end per (displacement, rotation), under the tension N [N]; buckled it means nothing."""
        return _condensed(self._assembled([piece.stiffness(N) for piece in self.pieces]))[0]

    def rest(self, N: float) -> np.ndarray:
        """(2, 2) what the stiffness under N has beside that to first order in N."""
        K, shape = _condensed(self._assembled([piece.stiffness(0.0) for piece in self.pieces]))
        first = shape.T @ self._assembled([piece.per_load for piece in self.pieces]) @ shape
        return self.stiffness(N) - K - N * first

    @property
    def per_load(self) -> float:
        """p per tension [1/N]: l^2/EI of its piece that this is most of."""
        return max(piece.length**2 / piece.EI for piece in self.pieces)

    def buckles(self, N: float) -> bool:
        """Whether the tension N [N] is below that at which it buckles between ends that do not turn."""
        if any(piece.buckles(N) for piece in self.pieces):
            return True
        inner = self._assembled([piece.stiffness(N) for piece in self.pieces])[:-2, :-2]
        return bool(len(inner)) and bool(np.linalg.eigvalsh(inner).min() <= 0)

    @cached_property
    def buckling_load(self) -> float:
        """The pressing force [N] from which on it buckles between ends that do not turn; 4 pi^2 EI/l^2 of a uniform one."""
        high = min(HELD * piece.EI / piece.length**2 for piece in self.pieces)
        low = 0.0
        for _ in range(STEPS):
            middle = (low + high) / 2
            low, high = (low, middle) if self.buckles(-middle) else (middle, high)
        return high


def _condensed(K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(2, 2) of the last two rows, the others free, and (., 2) how all move with them."""
    inner, coupling = K[:-2, :-2], K[:-2, -2:]
    shape = np.vstack([-np.linalg.solve(inner, coupling), np.eye(2)]) if len(inner) else np.eye(2)
    return shape.T @ K @ shape, shape

"""What held flexures do beyond the fourth order: their axial loads grow less than with the square, bend them, stress them.

An axial load N makes a uniform beam of length l stiffer by p = N l^2/EI in units of EI/l^3, y' [6/5 p A - p^2 B/(1 + p/c)] y, and is itself
softened by what that bends: the energy of a mechanism at d, with its loads of second order counted lambda-fold, is

    V_2 + V_3 + V_4 - (1 - lambda)^2 A - lambda^2 W(lambda),     W = sum of N^2 g/(2 (1 + lambda N l^2/(EI c))),

A what the deformations of second order store, g = l^3/EI y' B y. It is stationary at lambda = 1/(1 + W/A), which is exact where one
load is redundant, and of sixth order where several are. Of a beam between held ends it is within 1 % of the beam-column from no travel to
seven thicknesses.

Sources: V_4 and W from the mixed energy of E. Reissner, J. Math. Phys. 29 (1950) 90, of beam-columns; B = -AWTAR_2, the coefficients of
p^2, S. Awtar, A. H. Slocum, E. Sevincer, J. Mech. Des. 129 (2007) 625; c from the next coefficient of the same expansion.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.devices.mechanism.second_order import SecondOrder, plain
from ctrlgen.devices.mechanism.yielding import Yielding
from ctrlgen.devices.travel import farthest
from ctrlgen.physics.screw import Matrix
from ctrlgen.physics.second_order_flexure import AWTAR_2

AWTAR_1 = ca.DM([[6 / 5, -1 / 10], [-1 / 10, 2 / 15]])  # of (displacement/l, rotation): p in a beam-column
NEXT = 90.0  # c: of the series 12 + 6 p/5 - p^2/700 + p^3/63000 of a guided beam the ratio of the last two
BUCKLED = 0.5  # least 1 + p/c: p = -45 is beyond the buckling of held ends, -4 pi^2, where nothing of this holds
ALIKE = 1e-9  # of the largest: loads and shapes of two flexures that differ by less are the same by symmetry
NOTHING = 1e-12  # of the energy at the largest travels, which keeps the ratio of two vanishing energies finite at home


@dataclass(frozen=True, eq=False)
class Column:
    """A plane of a uniform beam: its axial load of second order (1, m), g (1, m) and l^2/(EI c) [1/N]."""

    axial: Matrix
    bends: Matrix
    per_load: Any


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane of bending of a beam: EI, length, and (displacement/l, rotation) (2, n) of its free end per axis; rows of its displacement
    and rotation in a twist, `sign` of the rotation."""

    EI: Any
    length: Any
    relative: Matrix
    shift: int
    turn: int
    sign: int

    def of(self, relative: Matrix) -> Matrix:
        """(displacement/l, rotation) (2, .) of twists (6, .) of its free end."""
        return ca.vertcat(relative[self.shift, :] / self.length, self.sign * relative[self.turn, :])

    @property
    def y(self) -> Matrix:
        """That of the axes (2, n)."""
        return self.of(self.relative)


class Stretching:
    """Energy and loads of a mechanism whose flexures stretch where they are held (`second`: its second order)."""

    def __init__(self, second: SecondOrder) -> None:
        self.s, self.n = second, second.n

    def energy(self, d: Matrix) -> Matrix:
        """V_4 + ... [N m] of the displacements `d` (n,)."""
        products = self.s.products(d)
        V = ca.mtimes([products.T, self.s.quartic, products])
        if not self.columns:
            return V
        share = self.share(d)
        return V - (1 - share) ** 2 * self._stored(d) - share**2 * self._given_back(d, share)

    def share(self, d: Matrix) -> Matrix:
        """lambda: of what the loads of second order would be with the square of `d` (n,); two steps from W(0)."""
        if not self.columns:
            return ca.SX(1)
        share = ca.SX(0)
        for _ in range(2):
            share = 1 / (1 + self._given_back(d, share) / (self._stored(d) + self._least))
        return share

    def extra_load(self, k: int, back: Any, d: Matrix) -> Matrix:
        """(6,) wrench on element k at `back` [m] from its free end, in its frame, beside the linear one: that of second order, and what
        its axial load does to its shape."""
        e, products, share = self.s.strained[k], self.s.products(d), self.share(d)
        extra = share * ca.mtimes(e.load[:, self.n :], products)
        turned = ca.SX(6, 1)
        if self.columns and self.yields is not None:
            turned = self.yields.relative(k, d) * share * self.yielded(d, share)
            extra += ca.mtimes(self.s.local_stiffness(k), turned)
        axial, arms = ca.mtimes(e.load[0, : self.n], d) + extra[0], {}
        bent = [ca.SX(0) for _ in range(6)]
        for plane in self._planes(k):
            y = ca.mtimes(plane.y, d) + plane.of(turned)
            p = axial * plane.length**2 / plane.EI
            added = ca.mtimes(p * AWTAR_1 + p**2 / _denominator(p / NEXT) * AWTAR_2, y)
            shift = plane.shift - 3
            bent[shift] = added[0] * plane.EI / plane.length**2
            bent[3 + plane.turn] = plane.sign * added[1] * plane.EI / plane.length
            arms[shift] = y[0] * back
        extra = extra + ca.vertcat(*bent)
        y, z = arms.get(1, 0), arms.get(2, 0)
        carried = ca.vertcat(0, z * axial - back * extra[2], back * extra[1] - y * axial)
        return ca.vertcat(extra[:3], extra[3:] + carried)

    @cached_property
    def yields(self) -> Yielding | None:
        """What loads of second order do to bodies that the held axes leave some freedom; None where they do nothing."""
        found = Yielding(self.s)
        return found if found.stiffness.nnz() else None

    def yielded(self, d: Matrix, share: Matrix) -> Matrix:
        """Of the motion of those bodies what is left where the loads also hold them, 1/(1 + lambda R/H), R of tension l y' [A] y."""
        if self.yields is None:
            return ca.SX(1)
        R, products = ca.SX(0), self.s.products(d)
        for k, e in enumerate(self.s.strained):
            relative = self.yields.relative(k, d) if self._planes(k) else None
            for plane in self._planes(k):
                y = plane.of(relative)
                R += ca.mtimes(plain(e.load[0, self.n :]), products) * plane.length * ca.mtimes([y.T, AWTAR_1, y])
        return 1 / _denominator(share * R / (self.yields.work(d) + self._least))

    def _stored(self, d: Matrix) -> Matrix:
        products = self.s.products(d)
        return ca.mtimes([products.T, self.s.stretching, products])

    def _given_back(self, d: Matrix, share: Matrix) -> Matrix:
        products, W = self.s.products(d), ca.SX(0)
        if self.yields is not None:
            W += self.yields.work(d) * self.yielded(d, share) / 2
        for column in self.columns:
            N = ca.mtimes(column.axial, products)
            W += N**2 * ca.mtimes(column.bends, products) / _denominator(share * N * column.per_load) / 2
        return W

    @property
    def _least(self) -> Matrix:
        travel = ca.DM([farthest(a.section.travel) for a in self.s.c.device.placed_actuators])
        return NOTHING * ca.dot(ca.diag(self.s.c.stiffness), travel**2)

    def _planes(self, k: int) -> list[Plane]:
        """Both planes of a uniform beam; none of another element."""
        if len(segments := self.s.parts[k][1]) != 1:
            return []
        s, relative = segments[0], self.s.strained[k].relative
        return [
            Plane(EI, s.length, relative[:, : self.n], shift, turn, sign)
            for EI, shift, turn, sign in ((s.EI_z, 4, 2, 1), (s.EI_y, 5, 1, -1))
        ]

    @cached_property
    def columns(self) -> list[Column]:
        """Of every uniform beam what its axial load of second order bends, those that are alike as one; none where nothing stretches."""
        if self.s.stretching.nnz() == 0:
            return []
        found = []
        for k, e in enumerate(self.s.strained):
            for plane in self._planes(k):
                y = plane.y
                bends = -ca.sum1(y[:, self.s.I] * ca.mtimes(AWTAR_2, y[:, self.s.J])) * plane.length**3 / plane.EI
                found.append(Column(plain(e.load[0, self.n :]), plain(bends), plane.length**2 / (plane.EI * NEXT)))
        return _merged(found)


def _denominator(ratio: Matrix) -> Matrix:
    return ca.fmax(1 + ratio, BUCKLED)


def _merged(columns: list[Column]) -> list[Column]:
    """The columns, those with the same load and section added up, and those without a load left out, where they are numbers."""
    if not columns or not all(isinstance(x, ca.DM) for c in columns for x in (c.axial, c.bends)):
        return columns
    numbers = [(np.array(c.axial).ravel(), np.array(c.bends).ravel(), float(c.per_load)) for c in columns]
    most_load, most_bent = (max(np.abs(row[i]).max() for row in numbers) for i in (0, 1))
    kept: list[tuple[np.ndarray, np.ndarray, float]] = []
    for axial, bends, per_load in numbers:
        if np.abs(axial).max() <= ALIKE * most_load or np.abs(bends).max() <= ALIKE * most_bent:
            continue
        for i, (other, sum_of, per) in enumerate(kept):
            if np.abs(axial - other).max() <= ALIKE * most_load and abs(per - per_load) <= ALIKE * per:
                kept[i] = (other, sum_of + bends, per)
                break
        else:
            kept.append((axial, bends, per_load))
    return [Column(ca.DM(a).T, ca.DM(b).T, per) for a, b, per in kept]

"""How stiff a mechanism is under its constant loads with all that they do to its flexures as columns, and what that says of `loads`.

The model counts loads to first order, K + K_F. Here the tangent stiffness of all bodies as drawn, G what the wrenches W_h on the flexures
and the forces add to it (`loads`, not condensed), has of every flexure between them what its axial load N does beyond the first order
(`physics.beam_column`):

    K_b = K + G + sum of the rests of N,    stiffness of the axes K + K_F + [(B K_b^-1 B')^-1 - K - T_1' G T_1],

B the travels of the actuators and T_1 what the bodies then do; in the brackets is what is of second order and more, bodies among it that
the held axes leave some freedom and that yield. It is the linear theory of buckling: what the loads bend beforehand counts in K_F alone.
Against corotational beams the stiffness of a crossed pivot that is pressed is right to 0.5 % up to its largest, 3.2 times what it was
(`tests/test_loads_in_range.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np
import scipy.linalg

from ctrlgen.devices.mechanism.condensed import KEPT, Condensed
from ctrlgen.devices.mechanism.loads import Loads
from ctrlgen.devices.mechanism.modes import as_displacements
from ctrlgen.devices.mechanism.second_order import Motions, SecondOrder
from ctrlgen.physics.beam_column import Column, Piece
from ctrlgen.physics.rigid_bodies import GROUND, Element, point_motion
from ctrlgen.physics.screw import numbers
from ctrlgen.physics.second_order_flexure import dot, relative_motion

# Unit twists of both bodies of an element, one after the other, and all pairs of them
BOTH = [ca.horzcat(ca.DM.eye(6), ca.DM(6, 6)), ca.horzcat(ca.DM(6, 6), ca.DM.eye(6))]
PAIRS = [u for u in range(12) for _ in range(12)], [v for _ in range(12) for v in range(12)]
PLANES = (
    ("EI_z", 4, 2, 1.0),
    ("EI_y", 5, 1, -1.0),
)  # of a flexure: rows of displacement and rotation in its twist, sign of the latter
STEPS = 20  # halvings of the share of the loads up to which the model holds


@dataclass(frozen=True)
class PressedFlexure:
    """A flexure and its tension [N] under the loads, the axes held; its columns in both planes, and (2, 12) how its free end moves in
    each with its bodies `first` and `second`."""

    name: str
    first: int
    second: int
    tension: float
    columns: tuple[Column, ...]
    moved: tuple[np.ndarray, ...]

    @property
    def buckling_load(self) -> float:
        """The pressing force [N] at which it buckles between ends that do not turn."""
        return min(column.buckling_load for column in self.columns)

    @property
    def buckles(self) -> bool:
        """Whether it is pressed by more than that."""
        return any(column.buckles(self.tension) for column in self.columns)

    @property
    def p(self) -> float:
        """Tension over EI/l^2, in the plane where that is more."""
        return max((self.tension * column.per_load for column in self.columns), key=abs)


@lru_cache(maxsize=KEPT)
def loaded_tangent(c: Condensed) -> LoadedTangent:
    """The tangent of a condensed mechanism of numbers, with its loads."""
    return LoadedTangent(c, Loads(c, SecondOrder(c)))


class LoadedTangent:
    """The tangent stiffness of a condensed mechanism of numbers under a share of its `loads`."""

    def __init__(self, c: Condensed, loads: Loads) -> None:
        self.c, self.loads, self.s = c, loads, loads.s

    @cached_property
    def flexures(self) -> list[PressedFlexure]:
        """Every blade, wire and strut."""
        return [
            PressedFlexure(
                self.c.device.placed_elements[k].name,
                self.c.elements[k].first,
                self.c.elements[k].second,
                float(e.load[0, -1]),
                tuple(
                    Column(tuple(Piece(float(s.length), float(getattr(s, EI))) for s in self.s.parts[k][1]))
                    for EI, *_ in PLANES
                ),
                tuple(np.vstack([relative[shift], sign * relative[turn]]) for _, shift, turn, sign in PLANES),
            )
            for k, e in enumerate(self._motions)
            if self.s.parts[k][1]
            for relative in [numbers(e.relative)[:, self.s.n : self.s.n + 12]]
        ]

    def stiffness(self, share: float = 1.0) -> np.ndarray:
        """(n, n) of the axes [N/m] under a `share` of the loads, with that of the actuators beside their force."""
        B, T = self._travels, self._moved
        column = np.linalg.inv(B @ np.linalg.solve(self._bodies(share), B.T))
        higher = column - numbers(self.c.stiffness) - share * T.T @ self._geometric @ T
        return numbers(self.c.held_stiffness) + share * numbers(self.loads.stiffness) + higher

    def off(self, share: float = 1.0) -> np.ndarray:
        """(n,) of the stiffness of each axis, by how much of it that to first order, K + K_F, is too large."""
        exact = np.diag(self.stiffness(share))
        first = np.diag(numbers(self.c.held_stiffness) + share * numbers(self.loads.stiffness))
        return first / exact - 1

    def holds_to(self, most: float) -> float:
        """The share of the loads up to which no axis is off by more than `most`; 1 where that is all of them."""
        low, high = 0.0, 1.0
        if np.abs(self.off()).max() <= most:
            return 1.0
        for _ in range(STEPS):
            middle = (low + high) / 2
            low, high = (middle, high) if np.abs(self.off(middle)).max() <= most else (low, middle)
        return low

    @property
    def buckles(self) -> bool:
        """Whether some motion of the bodies, the actuators without drives, takes no force."""
        return self._takes_no_force(self._bodies(1.0))

    def _takes_no_force(self, K: np.ndarray) -> bool:
        """Whether of K_b some motion does, with the stiffness of the actuators beside their force."""
        stacks = np.diag(numbers(self.c.held_stiffness) - numbers(self.c.stiffness))
        beside = self._travels.T @ (stacks[:, None] * self._travels) if self.c.pushes else 0.0
        return bool(scipy.linalg.eigvalsh(K + beside, self._linear + beside).min() <= 0)

    def buckles_between(self, other: LoadedTangent, share: float) -> bool:
        """The same at a `share` of the way from these loads to those of the `other` tangent."""
        K = self._linear + (1 - share) * self._geometric + share * other._geometric
        for flexure, far in zip(self.flexures, other.flexures, strict=True):
            tension = (1 - share) * flexure.tension + share * far.tension
            if any(column.buckles(tension) for column in flexure.columns):
                return True
            for column, moved in zip(flexure.columns, flexure.moved, strict=True):
                self._put(K, flexure.first, flexure.second, moved.T @ column.rest(tension) @ moved)
        return self._takes_no_force(K)

    def _bodies(self, share: float) -> np.ndarray:
        """K_b (6 bodies, 6 bodies) per twist, turns counted as displacements."""
        return self._linear + self.of_loads(share)

    def of_loads(self, share: float = 1.0) -> np.ndarray:
        """The part of K_b that a `share` of the loads adds: G, and of every flexure what is beyond its first order."""
        K = share * self._geometric
        for flexure in self.flexures:
            for column, moved in zip(flexure.columns, flexure.moved, strict=True):
                self._put(K, flexure.first, flexure.second, moved.T @ column.rest(share * flexure.tension) @ moved)
        return K

    @cached_property
    def _scale(self) -> np.ndarray:
        return as_displacements(self.c.device)

    def _put(self, K: np.ndarray, first: int, second: int, form: np.ndarray) -> None:
        """Adds a form (12, 12) in the twists of two bodies to K."""
        for i, rows in ((first, slice(6)), (second, slice(6, 12))):
            for j, columns in ((first, slice(6)), (second, slice(6, 12))):
                if GROUND not in (i, j):
                    here = np.ix_(range(6 * i, 6 * i + 6), range(6 * j, 6 * j + 6))
                    K[here] += form[rows, columns] * np.outer(self._scale[:6], self._scale[:6])

    def assembled(self, elements: Sequence[Element]) -> np.ndarray:
        """(6 bodies, 6 bodies) the stiffness of `elements` between the bodies, turns counted as displacements."""
        K, swap = np.zeros((len(self._scale),) * 2), np.r_[3:6, 0:3]
        between = np.hstack([-np.eye(6), np.eye(6)])
        for e in elements:
            self._put(K, e.first, e.second, between.T @ numbers(e.stiffness)[swap] @ between)
        return (K + K.T) / 2

    @cached_property
    def _linear(self) -> np.ndarray:
        return self.assembled(self.c.elements)

    @cached_property
    def _motions(self) -> list[Motions]:
        """Every element in unit twists of its bodies and, last, under the loads."""
        found = []
        for k, e in enumerate(self.c.elements):
            held = [ca.DM(6, 1) if b == GROUND else self.loads.held[b] for b in (e.first, e.second)]
            moved = self.s.motions(k, between=[ca.horzcat(u, h) for u, h in zip(BOTH, held, strict=True)])
            found.append(self._moved_by_stroke(k, moved))
        return found

    def _moved_by_stroke(self, k: int, e: Motions) -> Motions:
        """With the last motion of element k less what prescribes it."""
        if not (stroke := ca.DM(self.loads.prescribed(k))).nnz():
            return e
        own = ca.horzcat(ca.DM(6, e.relative.shape[1] - 1), self.s.local(k, stroke))
        return replace(e, relative=e.relative - own, load=e.load - ca.mtimes(self.s.local_stiffness(k), own))

    @cached_property
    def _geometric(self) -> np.ndarray:
        """G (6 bodies, 6 bodies) of all loads."""
        K, n = np.zeros((len(self._scale),) * 2), self.s.n
        a, b = ([n + u for u in by] for by in PAIRS)
        for placed, e in zip(self.c.elements, self._motions, strict=True):
            own = numbers(dot(e.load[:, [n + 12] * 144], e.deformation(a, b)))
            self._put(K, placed.first, placed.second, 2 * own.reshape(12, 12))
        for body, at, force in self.loads.points():
            if body != GROUND:
                self._put(K, GROUND, body, -2 * _turned(at, force))
        if self.c.pushes:
            for i, actuator in enumerate(self.c.device.placed_actuators):
                pull = float(self.loads.force[i]) * self.c.directions[i]
                self._put(K, actuator.first, actuator.second, 2 * _turned(self.c.point(actuator), pull))
        return (K + K.T) / 2

    @cached_property
    def _moved(self) -> np.ndarray:
        """T_1 (6 bodies, n)."""
        return np.vstack([numbers(T) for T in self.s.first_order]) / self._scale[:, None]

    @cached_property
    def _travels(self) -> np.ndarray:
        """B (n, 6 bodies)."""
        B = np.zeros((len(self.c.directions), len(self._scale)))
        for i, (placed, direction) in enumerate(zip(self.c.device.placed_actuators, self.c.directions, strict=True)):
            row = numbers(point_motion(self.c.point(placed), direction)).ravel() if self.c.pushes else np.zeros(6)
            for body, sign in ((placed.first, -1), (placed.second, 1)):
                if body != GROUND:
                    B[i, 6 * body : 6 * body + 6] += sign * row * self._scale[:6]
        return B


def _turned(point: ca.DM, force: ca.DM) -> np.ndarray:
    """(12, 12) the work of a `force` on what the rotations of two bodies add to the motion of a `point` of the second, seen from the
    first."""
    moved = numbers(relative_motion(ca.DM(ca.evalf(ca.SX(point))), BOTH[0], BOTH[1], PAIRS[0], PAIRS[1]))[3:]
    return (numbers(force).ravel() @ moved).reshape(12, 12)

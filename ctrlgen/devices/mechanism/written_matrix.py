"""A matrix as a finite-element program writes it, and what it is in SI, in the global frame, port by port."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.core.units import to_si
from ctrlgen.devices.place import Direction
from ctrlgen.physics import rigid_bodies
from ctrlgen.physics.screw import TWIST


@dataclass(frozen=True, eq=False)
class Written:
    """`numbers` (6 P, 6 P) of ports at `places` (P, 3) [m] in the global frame: the `order` of the six motions of a port, what the rows
    are `sorted_by` ("port", "motion"), the `units` (length, force, mass), the axes of the program by `along` and `across`."""

    numbers: np.ndarray
    places: np.ndarray
    order: Sequence[str]
    sorted_by: str
    units: Any
    along: Direction
    across: Direction

    def of(self, numbers: np.ndarray) -> Written:
        """Other numbers, written likewise."""
        return replace(self, numbers=numbers)

    @property
    def rows(self) -> np.ndarray:
        """(6 P,) the row of the file of every motion, in the order of `TWIST`, port by port."""
        ports, motions = len(self.places), [self.order.index(name) for name in TWIST]
        per_port, per_motion = (6, 1) if self.sorted_by == "port" else (1, ports)
        return np.array([port * per_port + motion * per_motion for port in range(ports) for motion in motions])

    @property
    def axes(self) -> np.ndarray:
        """(3, 3) from the axes of the program to the global ones."""
        return np.asarray(rigid_bodies.frame(ca.DM(self.along), ca.DM(self.across)).full())

    def in_si(self, what: str) -> np.ndarray:
        """(6 P, 6 P) of the "stiffness" or the "mass": twists (theta; delta) of the ports -> (M; F) or (angular momentum; momentum)."""
        length = to_si(1.0, self.units.length)
        unit = to_si(1.0, self.units.force) / length if what == "stiffness" else to_si(1.0, self.units.mass)
        turns = np.tile([length] * 3 + [1.0] * 3, len(self.places))
        local = self.numbers[np.ix_(self.rows, self.rows)] * np.outer(turns, turns) * unit
        R = np.kron(np.eye(2 * len(self.places)), self.axes)
        return np.asarray(R @ local @ R.T)

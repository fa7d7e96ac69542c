"""Super-elements in the equations of a mechanism: pairs of bodies that they join, and their mass.

With the twists T of its bodies at the global origin a part of many ports puts W_i = sum_j K_ij T_j on body i. Rigid motions meet no load,
sum_j K_ij = 0, so that W_i = sum_j -K_ij (T_i - T_j): it acts as one flexure between every two of its bodies, whose matrices -K_ij need
not be symmetric. Ports on one body move as one.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.copies import Copied
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.physics.rigid_bodies import GROUND, Element
from ctrlgen.physics.screw import Matrix
from ctrlgen.physics.stated_part import NOISE, counted, rigid_motions

ROUNDING = 1e-9  # of the largest coordinate of a port, below which one of the centre of mass is rounding
SWAP = [3, 4, 5, 0, 1, 2]  # (moment; force) <-> (force; moment)


@dataclass(frozen=True, eq=False)
class Ported(Copied):
    """A copy of a super-element and the number of the body at each port, `GROUND` for none."""

    bodies: tuple[int, ...]

    @property
    def places(self) -> np.ndarray:
        """(P, 3) of its ports [m] in the global frame."""
        return np.asarray(self.section.written.places @ ca.DM(self.turn).full().T)

    @property
    def moves(self) -> np.ndarray:
        """(6 P, 6) of the ports as the table has them, not turned, per twist of each one's body at the global origin."""
        R = ca.DM(self.turn).full()
        # of a mirror image a turn goes the other way round
        turned = np.kron(np.eye(len(self.bodies)), np.kron(np.diag([np.linalg.det(R), 1.0]), R))
        return np.asarray(turned.T @ rigid_motions(self.places))

    def of_bodies(self, matrix: np.ndarray) -> dict[tuple[int, int], np.ndarray]:
        """The blocks (6, 6) of a `matrix` (6 P, 6 P) of its ports between its bodies: twists at the global origin -> (M; F) there."""
        moves, blocks = self.moves, dict[tuple[int, int], np.ndarray]()
        for i, first in enumerate(self.bodies):
            for j, second in enumerate(self.bodies):
                rows, columns = slice(6 * i, 6 * i + 6), slice(6 * j, 6 * j + 6)
                block = moves[rows].T @ matrix[rows, columns] @ moves[columns]
                blocks[first, second] = blocks.get((first, second), 0.0) + block
        return blocks


@dataclass(frozen=True, eq=False)
class PortedPart:
    """A super-element with its numbers: the `pairs` of bodies that it joins, all its `bodies` but the ground, and its `mass`
    (6 b, 6 b) of their twists at the global origin, None where it has none."""

    pairs: tuple[Element, ...]
    bodies: tuple[int, ...]
    mass: Matrix | None

    def kinetic(self, twists: list[Matrix]) -> Matrix:
        """(k, k) twice the kinetic energy per motions (6, k) of all bodies, of a part with a mass."""
        T = ca.vertcat(*(twists[b] for b in self.bodies))
        return ca.mtimes([T.T, self.mass, T])


def stored_motions(placed: Ported, size: float) -> tuple[np.ndarray, np.ndarray]:
    """What the part stores energy in: stiffnesses (k,) [N/m], above rounding, and motions (k, 6 P) of its ports that they are of, unit
    rows, turns counted as displacements at `size` [m]."""
    K, _ = placed.section.matrices
    by = counted(size, len(placed.bodies))
    values, motions = np.linalg.eigh(K * np.outer(by, by))
    some = values > NOISE * values[-1]
    return values[some], motions[:, some].T / by


def on_bodies(placed: Ported, rows: np.ndarray, count: int) -> np.ndarray:
    """(k, 6 count): `rows` (k, 6 P) of motions of the ports as those of all bodies, twists at the global origin."""
    moves, found = placed.moves, np.zeros((len(rows), 6 * count))
    for port, body in enumerate(placed.bodies):
        if body != GROUND:
            at = slice(6 * port, 6 * port + 6)
            found[:, 6 * body : 6 * body + 6] += rows[:, at] @ moves[at]
    return found


def part_line(section: Any) -> str:
    """What `ctrlgen check` prints of a super-element: its ports, and what it weighs."""
    what, weighed = f"{section.name}: super-element of {len(section.port)} ports", section.weighed
    if weighed is None:
        return f"{what}, without mass"
    factor = 1.0 if section.mass_factor is None else section.mass_factor.si
    floor = ROUNDING * np.abs(section.written.places).max()
    centre = ", ".join(show(0.0 if abs(x) < floor else float(x), "mm") for x in weighed.centre)
    return f"{what}, weighs {show(factor * weighed.mass, 'g')}, centre of mass ({centre})"


def ported_parts(device: Drawing, p: SimpleNamespace) -> list[PortedPart]:
    """Every copy of every super-element with the values `p`."""
    parts = []
    for placed in device.placed_super_elements:
        numbers = placed.numbers(p)
        K, M = placed.section.matrices
        factor = 1.0 if numbers.stiffness_factor is None else numbers.stiffness_factor
        blocks = placed.of_bodies(K)
        bodies = tuple(sorted({*placed.bodies} - {GROUND}))
        order = sorted({*placed.bodies})
        pairs = tuple(
            Element(first, second, factor * ca.DM(-blocks[second, first][SWAP]), of_many=True)
            for i, first in enumerate(order)
            for second in order[i + 1 :]
        )
        mass = None
        if M is not None:
            moved, share = placed.of_bodies(M), 1.0 if numbers.mass_factor is None else numbers.mass_factor
            mass = share * ca.DM(np.block([[moved[i, j] for j in bodies] for i in bodies]))
        parts.append(PortedPart(pairs, bodies, mass))
    return parts

"""The MEMS hexapod as a spatial frame, by the direct stiffness method. Shares no code with ctrlgen.

Every strut is three 12 x 12 Euler-Bernoulli beam elements (wire, rod, wire) with four nodes; its
ends hang on rigid offsets from the platform and from a stage plate; every plate is tied to ground by
[C^XY]. Nodes carry u before rotation, in mm, so that stiffness entries have similar sizes. Assembly,
residuals and refinement run in long double; only the factorisation is float64.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Real = np.longdouble
MM = Real(1000)  # 1 m
STRUTS_OF_STAGE = ((0, 5), (1, 2), (3, 4))
PLATFORM, STAGE, JOINT = 0, 1, 4  # master nodes: 1 platform, 3 stage plates, 12 wire-rod joints
MASTERS = JOINT + 12


@dataclass(frozen=True)
class Frame:
    """Response of the frame to stage displacements.

    `jacobian` (6, 6): twist (theta; delta) of the platform origin per (1X, 1Y, ... 3Y) [rad/m, 1].
    `tension` (24, 6) [N/m], positive when the wire is stretched; `moment` (24, 6, 3) [N m/m]: moment of the
    upper on the lower part of the cut, in the global frame; `axis` (24, 3): unit vectors base to platform.
    Rows: strut 1 base wire (lower end, upper end), strut 1 platform wire (lower, upper), strut 2 ...
    """

    jacobian: np.ndarray
    tension: np.ndarray
    moment: np.ndarray
    axis: np.ndarray

    @property
    def torque(self) -> np.ndarray:
        """Component of the moment along the wire, (24, 6) [N m/m]."""
        return np.einsum("sac,sc->sa", self.moment, self.axis)


@dataclass(frozen=True)
class Loads:
    """Section loads of the 24 wire ends for one set of displacements: (24,) [N, N m], `bending` (24, 3) global."""

    tension: np.ndarray
    torque: np.ndarray
    bending: np.ndarray


def section_loads(frame: Frame, d: np.ndarray) -> Loads:
    """Tension, torque and bending moment vector at all wire ends for the stage displacements `d` (6,) [m]."""
    torque = frame.torque @ d
    moment = np.einsum("sac,a->sc", frame.moment, d)
    return Loads(frame.tension @ d, torque, moment - torque[:, None] * frame.axis)


def skew(v: np.ndarray) -> np.ndarray:
    """Cross-product matrix of `v`."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]], dtype=Real)


def turn_z(angle: Real) -> np.ndarray:
    """Rotation about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=Real)


def solve(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A x = b for positive definite A: Jacobi-scaled float64 inverse, refined with long double residuals."""
    scale = 1 / np.sqrt(np.diag(A))
    scaled = A * scale[:, None] * scale
    factor = np.linalg.inv(scaled.astype(float)).astype(Real)
    right = b * scale[:, None]
    x = np.zeros_like(right)
    for _ in range(8):
        x = x + factor @ (right - scaled @ x)
    return x * scale[:, None]


def beam(length: Real, diameter: Real, young: Real, poisson: Real) -> np.ndarray:
    """12 x 12 element of a round Euler-Bernoulli beam along local x, (u, rotation) at both ends; J = 2 I."""
    inertia = Real(np.pi) * diameter**4 / 64
    EA = young * Real(np.pi) * diameter**2 / 4
    EI = young * inertia
    GJ = young / (2 * (1 + poisson)) * 2 * inertia
    k = np.zeros((12, 12), dtype=Real)

    def add(dofs: tuple[int, ...], block: list[list[Real]]) -> None:
        k[np.ix_(dofs, dofs)] += np.array(block, dtype=Real)

    a, t = EA / length, GJ / length
    s, c, r, q = 12 * EI / length**3, 6 * EI / length**2, 4 * EI / length, 2 * EI / length
    add((0, 6), [[a, -a], [-a, a]])
    add((3, 9), [[t, -t], [-t, t]])
    add((1, 5, 7, 11), [[s, c, -s, c], [c, r, -c, q], [-s, -c, s, -c], [c, q, -c, r]])
    add((2, 4, 8, 10), [[s, -c, -s, -c], [-c, r, c, q], [-s, c, s, c], [-c, q, c, r]])
    return k


def along(axis: np.ndarray) -> np.ndarray:
    """12 x 12 rotation from an element's frame, x along `axis`, to the global frame."""
    z = np.array([-axis[1], axis[0], 0], dtype=Real)
    z /= np.sqrt(z @ z)
    R = np.column_stack([axis, np.cross(z, axis), z])
    return np.kron(np.eye(4, dtype=Real), R)


def hang(node: int, offset: np.ndarray) -> np.ndarray:
    """6 x 6 MASTERS rows of a slave node on a rigid offset: u = U + rotation x offset."""
    rows = np.zeros((6, 6 * MASTERS), dtype=Real)
    rows[:, 6 * node : 6 * node + 6] = np.eye(6)
    rows[:3, 6 * node + 3 : 6 * node + 6] = -skew(offset)
    return rows


def tie(C_XY: np.ndarray, angle: Real) -> np.ndarray:
    """6 x 6 stiffness of a stage plate to ground, (u, rotation) in mm and global axes, from [C^XY] in SI."""
    C = np.asarray(C_XY, dtype=Real)
    by_work = np.block([[C[3:, :3] * MM, C[3:, 3:]], [C[:3, :3], C[:3, 3:] / MM]])  # (u; rotation) per (F; M)
    R = np.kron(np.eye(2, dtype=Real), turn_z(angle))
    return R @ solve(by_work, np.eye(6, dtype=Real)) @ R.T


def assemble(h: Any, C_XY: np.ndarray) -> Frame:
    """Solve the frame for unit displacements of the six stage axes.

    `h`: namespace with the device file's hexapod numbers in SI; `C_XY` (6, 6): twist (theta; delta) per
    wrench (F; M) of a stage plate about its centre, in the stage's axes.
    """
    young, poisson = Real(h.young) / MM**2, Real(h.poisson)
    wire_length, wire, rod = (Real(x) * MM for x in (h.wire_length, h.wire_diameter, h.rod_diameter))
    t = Real(h.platform_thickness) * MM
    top = [turn_z(Real(a)) @ np.array([Real(h.platform_radius) * MM, 0, -t]) for a in h.platform_angles]
    foot = [turn_z(Real(a)) @ np.array([Real(h.base_radius) * MM, 0, -t - Real(h.height) * MM]) for a in h.base_angles]
    n = 6 * MASTERS
    K, load = np.zeros((n, n), dtype=Real), np.zeros((n, 6), dtype=Real)
    centre, stage_of = [], {}
    for j, pair in enumerate(STRUTS_OF_STAGE):
        centre.append((foot[pair[0]] + foot[pair[1]]) / 2)
        stage_of.update({i: j for i in pair})
        angle = Real(h.stage_angles[j])
        k = tie(C_XY, angle)
        free = np.zeros((6, 2), dtype=Real)
        free[:3] = turn_z(angle)[:, :2] * MM  # mm per m of stage displacement
        at = slice(6 * (STAGE + j), 6 * (STAGE + j) + 6)
        K[at, at] += k
        load[at, 2 * j : 2 * j + 2] = k @ free

    elements: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []  # local stiffness, local dofs, wire axis
    for i in range(6):
        span = top[i] - foot[i]
        length = np.sqrt(span @ span)
        axis = span / length
        R = along(axis)
        j = stage_of[i]
        nodes = [
            hang(STAGE + j, foot[i] - centre[j]),
            hang(JOINT + 2 * i, np.zeros(3, dtype=Real)),
            hang(JOINT + 2 * i + 1, np.zeros(3, dtype=Real)),
            hang(PLATFORM, top[i]),
        ]
        parts = ((wire_length, wire), (length - 2 * wire_length, rod), (wire_length, wire))
        for e, (part, diameter) in enumerate(parts):
            k = beam(part, diameter, young, poisson)
            local = R.T @ np.vstack(nodes[e : e + 2])
            K += local.T @ k @ local
            if e != 1:
                elements.append((k, local, R))

    q = solve(K, load)
    J = np.vstack([q[3:6], q[:3] / MM])
    tension, moment, axes = [], [], []
    for k, local, R in elements:
        end = R @ (k @ (local @ q))  # forces and moments of the surroundings on the element, per m
        for first, sign in ((0, -1), (6, 1)):  # cut at the lower end: the upper part is the element itself
            tension.append(sign * (R[:3, 0] @ end[first : first + 3]))
            moment.append(sign * end[first + 3 : first + 6].T / MM)
            axes.append(R[:3, 0])
    return Frame(*(np.array(x, dtype=float) for x in (J, tension, moment, axes)))

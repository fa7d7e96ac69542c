"""The hexapod on its six struts at finite rotations: wire, rod, wire from each plate to the platform.

Geometry: S1 eq. (13), Table 2, with H as the vertical run of a strut (A_z = -t, B_z = -(H + t)), which gives the
printed L = 5.4 mm. Struts 1 and 6 stand on plate 1, 2 and 3 on plate 2, 4 and 5 on plate 3; plate j's axes are turned by
`stage_angles` (reconstructed). Section of a round wire, S1 eq. (24): EA = pi E d^2/4, EI = pi E d^4/64, GJ = 2 G I.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from plants.frame import Array, Equilibrium, Frame, Link, Node, Pose, about_z

STAGE_OF_STRUT = (0, 1, 1, 2, 2, 0)


@dataclass(frozen=True)
class Refinement:
    """Elements per wire and per rod."""

    wire: int = 3
    rod: int = 2


@dataclass(frozen=True)
class Geometry:
    """Strut ends A (platform) and B (plates), (6, 3) [um], and the home poses of the three plates."""

    A: Array
    B: Array
    plates: list[Pose]


def geometry(h: Any) -> Geometry:
    """Places of struts and plates; a plate's frame stands midway between its two struts. S1 eq. (13), Table 2."""
    A = np.array([about_z(t) @ [h.platform_radius, 0, -h.platform_thickness] for t in h.platform_angles])
    depth = -(h.height + h.platform_thickness)
    B = np.array([about_z(t) @ [h.base_radius, 0, depth] for t in h.base_angles])
    plates = []
    for j, turn in enumerate(h.stage_angles):
        own = [B[i] for i in range(6) if STAGE_OF_STRUT[i] == j]
        plates.append(Pose((own[0] + own[1]) / 2, about_z(turn)))
    return Geometry(A, B, plates)


def _along(n: Array) -> Array:
    """A rotation X(a) Z(c) whose first column is the unit vector `n`: far from the angles' singularity."""
    c, a = np.arccos(np.clip(n[0], -1, 1)), np.arctan2(n[2], n[1])
    ca, sa = np.cos(a), np.sin(a)
    return np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]]) @ about_z(c)


def _round(d: float, E: float, nu: float) -> tuple[float, float, float, float]:
    """(EA, GJ, EI, EI) of a round section. S1 eq. (24)."""
    EI = E * np.pi * d**4 / 64
    return E * np.pi * d**2 / 4, EI / (1 + nu), EI, EI


@dataclass(frozen=True)
class Strut:
    """The wire elements of one strut, base wire then platform wire."""

    base: list[Link]
    top: list[Link]


def add_struts(
    f: Frame, plates: list[Node], numbers: SimpleNamespace, refinement: Refinement
) -> tuple[Node, list[Strut]]:
    """Build platform and struts on three plate nodes; the platform's node is the origin at home."""
    h = numbers.hexapod
    g = geometry(h)
    platform = f.node(Pose(np.zeros(3), np.eye(3)))
    wire, rod = _round(h.wire_diameter, h.young, h.poisson), _round(h.rod_diameter, h.young, h.poisson)
    struts = []
    for i, j in enumerate(STAGE_OF_STRUT):
        span = g.A[i] - g.B[i]
        length = float(np.linalg.norm(span))
        foot = f.attach(plates[j], Pose(g.B[i], _along(span / length)))
        base = f.beam(foot, h.wire_length, wire, refinement.wire)
        middle = f.beam(base[-1].end, length - 2 * h.wire_length, rod, refinement.rod)
        top = f.beam(middle[-1].end, h.wire_length, wire, refinement.wire)
        f.fix(platform, top[-1].end)
        struts.append(Strut(base, top))
    return platform, struts


def wire_stress(f: Frame, struts: list[Strut], state: Equilibrium, diameter: float) -> Array:
    """Largest von Mises stress of each of the 12 wires, (6, 2) [N/um^2]; base wire, platform wire.

    sqrt((|N|/A + M/W)^2 + 3 (T/2W)^2), W = pi d^3/32, M at the ends of the outer elements: the middle's value
    carried on by the shear force over half an element.
    """
    W, area = np.pi * diameter**3 / 32, np.pi * diameter**2 / 4
    worst = np.zeros((6, 2))
    for i, strut in enumerate(struts):
        for k, links in enumerate((strut.base, strut.top)):
            for link, side in ((links[0], -1), (links[-1], 1)):
                N, V_y, V_z, T, M_y, M_z = f.section_loads(link, state)
                half = side * link.length / 2
                M = np.hypot(M_y + V_z * half, M_z - V_y * half)
                worst[i, k] = max(worst[i, k], np.hypot(abs(N) / area + M / W, np.sqrt(3) * T / (2 * W)))
    return worst


class Hexapod:
    """Platform and struts on three plates whose displacements are given, or given through springs.

    `compliance`: (6, 6), order (u, theta), of a stage at its plate, in the stage's axes [um/N, ...]; None: rigid stages.
    """

    def __init__(
        self, numbers: SimpleNamespace, refinement: Refinement | None = None, compliance: Array | None = None
    ) -> None:
        self.numbers = numbers
        self.frame = f = Frame()
        self.homes = geometry(numbers.hexapod).plates
        drives = [f.node(home) for home in self.homes]
        for drive in drives:
            f.hold(drive)
        self.plates = drives
        if compliance is not None:
            K = np.linalg.inv(compliance)
            self.plates = [f.node(home) for home in self.homes]
            for drive, plate in zip(drives, self.plates, strict=True):
                f.spring(drive, plate, (K + K.T) / 2)
        self.platform, self.struts = add_struts(f, self.plates, numbers, refinement or Refinement())
        self._load = f.load(self.platform, self.platform.home)
        f.assemble(1e-8)

    def solve(self, d: Array, force: Array | None = None, start: Equilibrium | None = None) -> Equilibrium:
        """Equilibrium for stage displacements `d` (6,) = (1X, 1Y, 2X, ...) [um], platform `force` (3,) [N]."""
        held = np.zeros((3, 6))
        for j, home in enumerate(self.homes):
            held[j, :3] = home.R[:, :2] @ np.asarray(d)[2 * j : 2 * j + 2]
        loads = np.zeros((1, 3)) if force is None else np.asarray(force, dtype=float)[None]
        return self.frame.solve(loads, held, start)

    def pose(self, state: Equilibrium) -> Array:
        """(theta; delta) of the platform's top centre, (6,) [rad, um]; theta is the rotation vector."""
        u, theta = state.moved(self.platform)
        return np.concatenate([theta, u])

    def stress(self, state: Equilibrium) -> Array:
        """Largest von Mises stress of the wires, (6, 2) [N/um^2]."""
        return wire_stress(self.frame, self.struts, state, self.numbers.hexapod.wire_diameter)

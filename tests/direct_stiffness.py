"""The MEMS hexapod and its stages as spatial frames, by the direct stiffness method. Shares no code with ctrlgen.

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


def beam(length: Real, EA: Real, GJ: Real, EI_y: Real, EI_z: Real) -> np.ndarray:
    """12 x 12 Euler-Bernoulli element along local x, (u, rotation) at both ends."""
    k = np.zeros((12, 12), dtype=Real)

    def add(dofs: tuple[int, ...], block: list[list[Real]]) -> None:
        k[np.ix_(dofs, dofs)] += np.array(block, dtype=Real)

    def bend(EI: Real, sign: int) -> list[list[Real]]:
        s, c, r, q = 12 * EI / length**3, sign * 6 * EI / length**2, 4 * EI / length, 2 * EI / length
        return [[s, c, -s, c], [c, r, -c, q], [-s, -c, s, -c], [c, q, -c, r]]

    x, t = EA / length, GJ / length
    add((0, 6), [[x, -x], [-x, x]])
    add((3, 9), [[t, -t], [-t, t]])
    add((1, 5, 7, 11), bend(EI_z, 1))
    add((2, 4, 8, 10), bend(EI_y, -1))
    return k


def round_beam(length: Real, diameter: Real, young: Real, poisson: Real) -> np.ndarray:
    """Element of a round section; J = 2 I."""
    EI = young * Real(np.pi) * diameter**4 / 64
    return beam(length, young * Real(np.pi) * diameter**2 / 4, EI / (1 + poisson), EI, EI)


def flat_beam(length: Real, in_plane: Real, out_of_plane: Real, young: Real, poisson: Real) -> np.ndarray:
    """Element of a section `in_plane` (along y) x `out_of_plane` (along z); torsion by S1 eq. (23)."""
    t, w = min(in_plane, out_of_plane), max(in_plane, out_of_plane)
    J = w * t**3 * (Real(1) / 3 - Real(0.21) * t / w * (1 - (t / w) ** 4 / 12))
    area = in_plane * out_of_plane
    EI_y, EI_z = young * area * out_of_plane**2 / 12, young * area * in_plane**2 / 12
    return beam(length, young * area, young / (2 * (1 + poisson)) * J, EI_y, EI_z)


def along(axis: np.ndarray) -> np.ndarray:
    """12 x 12 rotation from an element's frame, x along `axis`, to the global frame."""
    z = np.array([-axis[1], axis[0], 0], dtype=Real)
    z /= np.sqrt(z @ z)
    R = np.column_stack([axis, np.cross(z, axis), z])
    return np.kron(np.eye(4, dtype=Real), R)


def hang(node: int, offset: np.ndarray, masters: int = MASTERS) -> np.ndarray:
    """6 x 6 `masters` rows of a slave node on a rigid offset: u = U + rotation x offset."""
    rows = np.zeros((6, 6 * masters), dtype=Real)
    rows[:, 6 * node : 6 * node + 6] = np.eye(6)
    rows[:3, 6 * node + 3 : 6 * node + 6] = -skew(offset)
    return rows


def by_work(M: np.ndarray) -> np.ndarray:
    """[C] (theta; delta) per (F; M) in SI as (u; rotation) per (F; M) in mm."""
    C = np.asarray(M, dtype=Real)
    return np.block([[C[3:, :3] * MM, C[3:, 3:]], [C[:3, :3], C[:3, 3:] / MM]])


def stiffness(C: np.ndarray, R: np.ndarray | None = None) -> np.ndarray:
    """6 x 6 stiffness (u, rotation) in mm, in axes where the spring stands turned by `R`, from [C] in SI."""
    k = solve(by_work(C), np.eye(6, dtype=Real))
    turn = np.eye(6, dtype=Real) if R is None else np.kron(np.eye(2, dtype=Real), R)
    return turn @ k @ turn.T


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
        k = stiffness(C_XY, turn_z(angle))
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
            k = round_beam(part, diameter, young, poisson)
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


def actuator_stiffness(a: Any) -> np.ndarray:
    """[K^t] of S1 eq. (6) as (u; rotation) in mm about the bar's end: 2 n cantilevers on a rigid bar."""
    t, w, length = (Real(x) * MM for x in (a.beam_width, a.thickness, a.beam_length))
    tip = flat_beam(length, t, w, Real(a.young) / MM**2, Real(a.poisson))[6:, 6:]
    K = np.zeros((6, 6), dtype=Real)
    for i in range(1, int(a.beams) + 1):
        x = -(Real(a.beam_gap) + Real(a.bar_width) / 2) * i * MM
        for side in (-1, 1):  # the beam comes from y = side (half height + l) and leans toward -x
            axis = np.array([-np.sin(Real(a.beam_angle)), -side * np.cos(Real(a.beam_angle)), 0], dtype=Real)
            R = np.column_stack([axis, (-axis[1], axis[0], 0), (0, 0, 1)])
            turn = np.kron(np.eye(2, dtype=Real), R)
            rows = hang(0, np.array([x, side * Real(a.bar_half_height) * MM, 0], dtype=Real), 1)
            K += rows.T @ turn @ tip @ turn.T @ rows
    return K


def notch(n: Any) -> np.ndarray:
    """[C^c] of S1 eq. (7) in SI, its doubly printed couplings averaged."""
    C = np.zeros((6, 6))
    C[range(3), range(3, 6)] = n.theta_x_per_M_x, n.theta_y_per_M_y, n.theta_z_per_M_z
    C[range(3, 6), range(3)] = n.delta_x_per_F_x, n.delta_y_per_F_y, n.delta_z_per_F_z
    C[2, 1] = C[4, 5] = (n.theta_z_per_F_y + n.delta_y_per_M_z) / 2
    C[1, 2] = C[5, 4] = (n.theta_y_per_F_z + n.delta_z_per_M_y) / 2
    return C


def axis_stiffness(s: Any, a: Any, push: int) -> np.ndarray:
    """[K^X] as (u; rotation) in mm about the plate: notches, levers, guides and half actuators, all with nodes.

    `push`: +1 if the actuators' beams lie on the -x side of the levers, -1 on the +x side.
    Nodes: the plate, then per arm the root's free side, the beam's far end and, where driven, the bar.
    """
    bodies = 13
    K = np.zeros((6 * bodies, 6 * bodies), dtype=Real)
    e3, e4, r, half_x, half_y = (
        Real(x) * MM for x in (s.lever_short, s.lever_long, s.notch_radius, s.plate_half_length, s.plate_half_width)
    )
    lever = flat_beam(e4 - 2 * r, Real(s.lever_width) * MM, Real(a.thickness) * MM, Real(a.young) / MM**2, a.poisson)
    # Axially an arm, lever and two notches, has half of k_a.
    axial = 1 / (2 * MM / Real(s.half_stage_stiffness) - 2 * MM * Real(s.notch.delta_x_per_F_x))
    for i, k in ((0, 0), (6, 6), (0, 6), (6, 0)):
        lever[i, k] = axial if i == k else -axial
    no_offset = np.zeros(3, dtype=Real)

    def join(first: np.ndarray | float, second: np.ndarray, k: np.ndarray) -> None:
        rows = second - first
        K[:] += rows.T @ k @ rows

    node = 1
    for side in (1, -1):
        R = np.array([[0, side, 0], [-side, 0, 0], [0, 0, 1]], dtype=Real)  # x from the root to the plate
        turn = np.kron(np.eye(2, dtype=Real), R)
        for x in (-half_x, half_x):
            foot, far, bar = node, node + 1, node + 2
            node += 3
            pin = stiffness(notch(s.notch), R)
            # Node positions: free side of the root notch, end of the lever; both notches act at their free ends.
            join(0.0, hang(foot, no_offset, bodies), pin)
            ends = np.vstack([hang(foot, no_offset, bodies), hang(far, no_offset, bodies)])
            K += ends.T @ np.kron(np.eye(2), turn) @ lever @ np.kron(np.eye(2), turn).T @ ends
            at_plate = np.array([x, side * half_y, 0], dtype=Real) + R[:, 0] * r
            join(hang(far, R[:, 0] * 2 * r, bodies), hang(0, at_plate, bodies), pin)
            if x > 0:
                K[6 * bar : 6 * bar + 6, 6 * bar : 6 * bar + 6] += np.eye(6)  # a guide has no bar
                continue
            P = np.diag(np.array([push, push, 1], dtype=Real))  # x along the push
            both = np.kron(np.eye(2, dtype=Real), P)
            join(0.0, hang(bar, no_offset, bodies), both @ actuator_stiffness(a) @ both.T / 2)
            centre = R[:, 0] * (e3 - r)  # of the drive notch, seen from the foot
            free = P[:, 0] * r
            join(hang(bar, free, bodies), hang(foot, centre + free, bodies), stiffness(notch(s.notch), P))
    rest = solve(K[6:, 6:], K[6:, :6])
    return K[:6, :6] - K[:6, 6:] @ rest


def stage_compliance(s: Any, a: Any, push: int) -> np.ndarray:
    """[C^XY] of S1 eq. (8), (theta; delta) per (F; M) in SI: ground, Y stage, X stage in series."""
    X = axis_stiffness(s, a, push)
    quarter = np.kron(np.eye(2, dtype=Real), np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]], dtype=Real))
    offset = np.array([0, Real(s.centre_offset) * MM, 0], dtype=Real)
    K = np.zeros((12, 12), dtype=Real)
    outer = hang(1, offset, 2)
    K += outer.T @ quarter @ X @ quarter.T @ outer
    inner = hang(0, np.zeros(3, dtype=Real), 2) - hang(1, np.zeros(3, dtype=Real), 2)
    K += inner.T @ X @ inner
    C = solve(K, np.eye(12, dtype=Real))[:6, :6]
    return np.block([[C[3:, :3], C[3:, 3:] * MM], [C[:3, :3] / MM, C[:3, 3:]]]).astype(float)


def to_si(K: np.ndarray) -> np.ndarray:
    """Stiffness (u; rotation) in mm as wrench (F; M) per twist (theta; delta) in SI."""
    return np.block([[K[:3, 3:], K[:3, :3] * MM], [K[3:, 3:] / MM, K[3:, :3]]]).astype(float)

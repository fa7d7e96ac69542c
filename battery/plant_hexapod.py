"""An independent MEMS hexapod for settled poses and slow series: S1's equations in numpy, with faults.

Heater power -> temperature (first order) -> bar force, S1 eq. (4) -> stage displacement, eq. (9)-(12), by Newton -> pose, by
assembling plates, struts and platform as one linear structure of 24 coordinates (the paper chains 6 x 6 compliances instead,
eq. (14)-(18)). Units um, N, rad, W, degC; twists are (u, theta), wrenches (F, M). Numbers: `plants.numbers`.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from plants.numbers import read

Array = np.ndarray
AXES = ("1X", "1Y", "2X", "2Y", "3X", "3Y")
COMPONENTS = ("theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z")
STAGE = (0, 1, 1, 2, 2, 0)  # on which stage a strut stands


def cross(a: Array) -> Array:
    """[a x]."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0.0]])


def turn_z(angle: float) -> Array:
    """Rotation about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def carry(to: Any) -> Array:
    """Twist at a point, to the twist of the same body at `to` from there: u + theta x to."""
    T = np.eye(6)
    T[:3, 3:] = -cross(np.asarray(to, dtype=float))
    return T


def moved(C: Array, R: Array, to: Any) -> Array:
    """Compliance C, own axes, own point, as seen in axes turned by R (columns: own axes) at `to` from its point."""
    A = carry(to) @ np.kron(np.eye(2), R)
    return A @ C @ A.T


def beam(l: float, EA: float, EI_y: float, EI_z: float, GJ: float) -> Array:
    """Compliance of a cantilever along x at its tip. S1 eq. (21), common form."""
    C = np.diag([l / EA, l**3 / 3 / EI_z, l**3 / 3 / EI_y, l / GJ, l / EI_y, l / EI_z])
    C[1, 5] = C[5, 1] = l**2 / 2 / EI_z
    C[2, 4] = C[4, 2] = -(l**2) / 2 / EI_y
    return C


def blade(l: float, t: float, w: float, E: float, nu: float) -> Array:
    """Rectangular section, t along y, w along z, t <= w. S1 eq. (21)-(23)."""
    EI_z = E * w * t**3 / 12
    ratio = 12 * (1 / 3 - 0.21 * t / w * (1 - (t / w) ** 4 / 12)) / 2 / (1 + nu)
    return beam(l, E * t * w, E * t * w**3 / 12, EI_z, ratio * EI_z)


def wire(l: float, d: float, E: float, nu: float) -> Array:
    """Round section. S1 eq. (24)."""
    EI = E * np.pi * d**4 / 64
    return beam(l, E * np.pi * d**2 / 4, EI, EI, EI / (1 + nu))


def actuator_stiffness(a: Any) -> Array:
    """All 2 n bent beams about the bar's end. S1 eq. (5), (6)."""
    C = blade(a.beam_length, a.beam_width, a.thickness, a.young, a.poisson)
    K = np.zeros((6, 6))
    for i in range(1, round(a.beams) + 1):
        for angle, side in ((np.pi / 2 + a.beam_angle, -1), (1.5 * np.pi - a.beam_angle, 1)):
            place = np.array([-(a.beam_gap + a.bar_width / 2) * i, side * a.bar_half_height, 0])
            K += np.linalg.inv(moved(C, turn_z(angle), -place))
    return K


def notch(s: Any) -> Array:
    """Circular notch about its free end, the two printed couplings averaged. S1 eq. (7)."""
    n = s.notch
    C = np.diag(
        [
            n.delta_x_per_F_x,
            n.delta_y_per_F_y,
            n.delta_z_per_F_z,
            n.theta_x_per_M_x,
            n.theta_y_per_M_y,
            n.theta_z_per_M_z,
        ]
    )
    C[1, 5] = C[5, 1] = (n.theta_z_per_F_y + n.delta_y_per_M_z) / 2
    C[2, 4] = C[4, 2] = (n.theta_y_per_F_z + n.delta_z_per_M_y) / 2
    return C


def stage_compliance(s: Any, a: Any) -> Array:
    """An X axis carried by a Y axis, at the plate's centre. S1 section 3.4, eq. (8)."""
    r, e_4, I = s.notch_radius, s.lever_long, np.eye(3)
    flexure = blade(e_4 - 2 * r, a.thickness, s.lever_width, a.young, a.poisson)
    lever = moved(flexure, np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]]), np.zeros(3))
    lever[0, 0] = 2 / s.half_stage_stiffness - 2 * s.notch.delta_x_per_F_x
    centred = moved(notch(s), I, [-r, 0, 0])
    half_bar = 2 * np.linalg.inv(actuator_stiffness(a)) + centred
    K = np.zeros((6, 6))
    for side in (1, -1):
        pushed = moved(half_bar, turn_z(side * np.pi / 2), [-s.lever_short, 0, 0])
        driven = np.linalg.inv(np.linalg.inv(centred) + np.linalg.inv(pushed))
        for x, root in ((-s.plate_half_length, driven), (s.plate_half_length, centred)):
            arm = moved(root, I, [e_4, 0, 0]) + moved(lever, I, [r, 0, 0]) + centred_end(s)
            K += np.linalg.inv(moved(arm, turn_z(-side * np.pi / 2), [-x, -side * s.plate_half_width, 0]))
    C_X = np.linalg.inv(K)
    return C_X + moved(C_X, turn_z(np.pi / 2), [0, -s.centre_offset, 0])


def centred_end(s: Any) -> Array:
    """The end notch, about its own centre."""
    return moved(notch(s), np.eye(3), [-s.notch_radius, 0, 0])


def _ends(h: Any) -> tuple[Array, Array, list[Array]]:
    """Strut ends A, B (6, 3), and the plates' rotations; B_z = -(H + t). S1 eq. (13), Table 2."""
    A = np.array([turn_z(t) @ [h.platform_radius, 0, -h.platform_thickness] for t in h.platform_angles])
    B = np.array([turn_z(t) @ [h.base_radius, 0, -h.height - h.platform_thickness] for t in h.base_angles])
    return A, B, [turn_z(t) for t in h.stage_angles]


def jacobian(n: Any) -> Array:
    """Pose (theta; u) per stage displacement (6, 6), from the assembled structure of three plates, struts, platform."""
    h = n.hexapod
    A, B, turns = _ends(h)
    C = stage_compliance(n.stage, n.actuator)
    K, load = np.zeros((24, 24)), np.zeros((24, 6))
    for j in range(3):
        at = slice(6 + 6 * j, 12 + 6 * j)
        K_j = np.linalg.inv(moved(C, turns[j], np.zeros(3)))
        travel = np.zeros((6, 2))
        travel[:3] = turns[j][:, :2]
        K[at, at] += K_j
        load[at, 2 * j : 2 * j + 2] += K_j @ travel
    for i in range(6):
        j = STAGE[i]
        centre = (B[STAGE.index(j)] + B[max(k for k in range(6) if STAGE[k] == j)]) / 2
        G = np.zeros((6, 24))
        G[:, :6] = carry(A[i])
        G[:, 6 + 6 * j : 12 + 6 * j] = -carry(A[i] - centre)
        K += G.T @ _strut(A[i] - B[i], h) @ G
    p = np.linalg.solve(K, load)[:6]
    return p[[3, 4, 5, 0, 1, 2]]


def _strut(span: Array, h: Any) -> Array:
    """Wire, rod, wire, at the platform's end, in global axes."""
    length = float(np.linalg.norm(span))
    x = span / length
    y = np.cross([0, 0, 1.0], x)
    y /= np.linalg.norm(y)
    R = np.column_stack([x, y, np.cross(x, y)])
    end = wire(h.wire_length, h.wire_diameter, h.young, h.poisson)
    rod = wire(length - 2 * h.wire_length, h.rod_diameter, h.young, h.poisson)
    C = moved(end, np.eye(3), [length - h.wire_length, 0, 0]) + moved(rod, np.eye(3), [h.wire_length, 0, 0]) + end
    return np.linalg.inv(moved(C, R, np.zeros(3)))


def ball_jointed(n: Any, d: Array) -> Array:
    """Pose (theta; u) of rigid struts on ball joints at stage displacements `d` (6,), finite rotations, by Newton."""
    A, B, turns = _ends(n.hexapod)
    feet = np.array([B[i] + turns[STAGE[i]][:, :2] @ d[2 * STAGE[i] : 2 * STAGE[i] + 2] for i in range(6)])
    length = np.linalg.norm(A - B, axis=1)
    pose = np.zeros(6)
    for _ in range(8):
        R = _rotation(pose[:3])
        tops = A @ R.T + pose[3:]
        span = tops - feet
        size = np.linalg.norm(span, axis=1)
        unit = span / size[:, None]
        G = np.column_stack([np.cross(tops - pose[3:], unit), unit])
        step = np.linalg.solve(G, length - size)
        pose[3:] += step[3:]
        pose[:3] = _vector(_rotation(step[:3]) @ R)
    return pose


def _rotation(w: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(w).as_matrix()


def _vector(R: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_rotvec()


@dataclass
class Faults:
    """What is wrong; everything zero is S1 as printed. Shares unless said otherwise; six values follow AXES or COMPONENTS.

    `drive` on the drive, `order`: which drive reaches actuator k, `crosstalk`: of every other heater's power,
    `resistance` [1/K] of the heater (voltage drive), `stiffness` and `cubic` [N/um^3] of the stages, `coupling`: of
    the other axis of a stage, `turn` [rad] of the platform frame, `gain`, `offset` [um, rad] and `bow` [1/um, 1/rad]
    of the sensor, `finite`: 1 for finite rotations.
    """

    drive: Array = field(default_factory=lambda: np.zeros(6))
    order: Array = field(default_factory=lambda: np.arange(6))
    crosstalk: float = 0.0
    resistance: float = 0.0
    stiffness: Array = field(default_factory=lambda: np.zeros(6))
    cubic: Array = field(default_factory=lambda: np.zeros(6))
    coupling: Array = field(default_factory=lambda: np.zeros(6))
    turn: float = 0.0
    gain: Array = field(default_factory=lambda: np.zeros(6))
    offset: Array = field(default_factory=lambda: np.zeros(6))
    bow: Array = field(default_factory=lambda: np.zeros(6))
    finite: float = 0.0


def changed(numbers: SimpleNamespace, shares: dict[str, float]) -> SimpleNamespace:
    """A copy of `numbers` with 'hexapod.height' and the like off by a share."""
    out = copy.deepcopy(numbers)
    for path, share in shares.items():
        section, name = path.split(".")
        setattr(getattr(out, section), name, getattr(getattr(out, section), name) * (1 + share))
    return out


class Hexapod:
    """Drives (n, 6) [W, or V with `voltage`] to poses (n, 6) (theta; u) [rad, um]."""

    def __init__(
        self, numbers: SimpleNamespace | None = None, faults: Faults | None = None, voltage: bool = False
    ) -> None:
        self.n, self.faults, self.voltage = numbers or read(), faults or Faults(), voltage
        self.J = jacobian(self.n)
        self._K_bar = actuator_stiffness(self.n.actuator)[0, 0]

    def power(self, drive: Array) -> Array:
        """Steady heater power that arrives [W]; R(T) = R_0 (1 + resistance (T - T_amb)) solved for the steady temperature."""
        f, a = self.faults, self.n.actuator
        u = np.asarray(drive, dtype=float)[:, f.order] * (1 + f.drive)
        P = u**2 / a.heater_resistance if self.voltage else u
        if self.voltage and f.resistance:
            g = f.resistance * a.thermal_resistance  # P (1 + g P) = P_0
            P = (np.sqrt(1 + 4 * g * P) - 1) / 2 / g
        return P + f.crosstalk * (P.sum(axis=1, keepdims=True) - P)

    def temperature(self, drive: Array, dt: float | None = None, linear: bool = False) -> Array:
        """Settled temperatures [degC], or those under drives held for `dt` [s], from ambient: exact first order.

        `linear`: the power that arrives goes straight from sample to sample instead.
        """
        a = self.n.actuator
        steady = a.ambient + a.thermal_resistance * self.power(drive)
        if dt is None:
            return steady
        T, decay = np.full(steady.shape, float(a.ambient)), np.exp(-dt / a.time_constant)
        late = 1 - (1 - decay) * a.time_constant / dt if linear else 0.0  # share of a rise that has arrived at its end
        for k in range(len(T) - 1):
            T[k + 1] = steady[k] + (T[k] - steady[k]) * decay + late * (steady[k + 1] - steady[k])
        return T

    def displacement(self, T: Array) -> Array:
        """Stage displacements [um] where the bar force of eq. (4) meets eq. (12), Newton from the linear law."""
        a, s, f = self.n.actuator, self.n.stage, self.faults
        F = 2 * a.beams * (a.expansion + a.expansion_slope * T) * (T - a.ambient)
        F = F * a.young * a.beam_width * a.thickness * np.sin(a.beam_angle)
        r, e = s.lever_long / s.lever_short, s.lever_long
        k = (self._K_bar / r + r * s.notches / (s.notch.theta_z_per_M_z * e**2)) * (1 + f.stiffness)
        d = F / k / 1.3
        for _ in range(30):
            root = np.sqrt(e**2 - d**2)
            N = 2 * r * s.half_stage_stiffness * d * root / e**2 * (e - root)
            slope = 2 * r * s.half_stage_stiffness / e**2 * ((e - root) * (root - d**2 / root) + d**2)
            d = d - (k * d + N + f.cubic * d**3 - F) / (k + slope + 3 * f.cubic * d**2)
        return d

    def pose(self, d: Array) -> Array:
        """What the sensor reads at stage displacements `d` (n, 6), without noise."""
        f = self.faults
        d = d + f.coupling * d[:, [1, 0, 3, 2, 5, 4]]
        p = d @ self.J.T
        if f.finite:
            rigid = np.column_stack([ball_jointed(self.n, 1e-3 * e) / 1e-3 for e in np.eye(6)])
            p = p + f.finite * (np.array([ball_jointed(self.n, row) for row in d]) - d @ rigid.T)
        R = np.kron(np.eye(2), turn_z(f.turn)) if f.turn else np.eye(6)
        p = p @ R.T
        return p * (1 + f.gain) + f.bow * p**2 + f.offset

    def settled(self, drive: Array) -> Array:
        """Readings (n, 6) of settled poses."""
        return self.pose(self.displacement(self.temperature(drive)))

    def series(self, drive: Array, dt: float, linear: bool = False) -> Array:
        """Readings (n, 6) at k dt under drives held from k to k + 1, or linear between them, from ambient."""
        return self.pose(self.displacement(self.temperature(drive, dt, linear)))

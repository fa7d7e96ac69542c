"""S1 eq. (1) to (24) against one another: what each demands, computed from the functions that state it."""

from __future__ import annotations

from math import cos, pi, radians, sin, sqrt

import casadi as ca
import numpy as np

from ctrlgen.devices.mems_hexapod import MemsHexapod, matrices
from ctrlgen.physics import flexure, hexapod, thermal_actuator, xy_stage
from ctrlgen.physics.screw import adjoint, inverse, move, parallel, rotation_z, series

from .row import PrintedNumber, identity

# Table 2: printed angle, the middle of its pair, and on which side of it
ALPHA = (
    ("alpha_1", "187.3", 180, 1),
    ("alpha_2", "172.7", 180, -1),
    ("alpha_3", "67.3", 60, 1),
    ("alpha_4", "52.7", 60, -1),
    ("alpha_5", "-52.7", -60, 1),
    ("alpha_6", "-67.3", -60, -1),
)
BETA = (
    ("beta_1", "237.3", 240, -1),
    ("beta_2", "122.7", 120, 1),
    ("beta_3", "117.3", 120, -1),
    ("beta_4", "2.7", 0, 1),
    ("beta_5", "-2.7", 0, -1),
    ("beta_6", "-117.3", -120, 1),
)
TURN = 2 * pi / 3  # of the hexapod's threefold symmetry


def rows(device: MemsHexapod) -> list[PrintedNumber]:
    """One row an equation: its left side minus its right, relative to the larger of them."""
    found = [
        ("eq. (1)", _cut_beam(device), 1e-9, "a beam in two pieces in series, against the whole beam"),
        ("eq. (2)", _composed(), 1e-12, "[Ad] of two frames one after the other, against [Ad] of both at once"),
        ("eq. (3)", _threefold(device), 1e-9, "six struts in parallel, against themselves turned by 120 deg"),
        (
            "eq. (4)",
            _thermal_force(device),
            1e-9,
            "F at 550 degC, against 2 n thermal strains on the axial stiffness of eq. (5)",
        ),
        ("eq. (8)", _stage(device), 1e-9, "[C^XY] from [C^X] twice, against loads and twists moved one by one"),
        ("eq. (10)", _parasitic(device), 1e-9, "e_4 - sqrt(e_4^2 - d^2) at 55 um, against e_4 (1 - cos phi)"),
        ("eq. (12)", _total(device), 1e-12, "F at 55 um, against eq. (9) and (11)"),
        (
            "eq. (14) to (18)",
            _jacobian(device),
            1e-8,
            "[J] by the paper's superposition, against one equilibrium of all struts",
        ),
        (
            "eq. (21), (22)",
            _blade(device),
            1e-3,
            "a beam of appendix A, against beam theory integrated along it in 2000 steps",
        ),
        (
            "eq. (23)",
            _torsion(),
            6e-3,
            "beta at w/t = 2, against Saint-Venant's series: the formula itself is known to 0.5 %",
        ),
        ("eq. (24)", _wire(device), 1e-9, "a wire of Table 2, against eq. (21) with the numbers of a circle"),
    ]
    return [identity("S1", where, ours, rounding, what) for where, ours, rounding, what in found]


def _apart(a: np.ndarray | ca.DM, b: np.ndarray | ca.DM) -> float:
    """Largest difference of two matrices, each row and column in units of its own size."""
    x, y = np.atleast_2d(np.array(a, dtype=float)), np.atleast_2d(np.array(b, dtype=float))
    size = np.sqrt(np.outer(np.abs(x).max(1), np.abs(x).max(0)))
    return float((np.abs(x - y) / np.where(size > 0, size, 1.0)).max())


def _cut_beam(device: MemsHexapod) -> float:
    a = device.values().actuator
    whole = flexure.blade_compliance(a.beam_length, a.beam_width, a.thickness, a.young, a.poisson)
    near, far = (
        flexure.blade_compliance(share * a.beam_length, a.beam_width, a.thickness, a.young, a.poisson)
        for share in (0.3, 0.7)
    )
    return _apart(whole, series((move(near, None, (-0.7 * a.beam_length, 0, 0)), far)))


def _composed() -> float:
    first, second = (rotation_z(0.3), ca.DM([1.0, 2.0, 3.0])), (rotation_z(-1.1), ca.DM([-0.5, 0.2, 4.0]))
    both = adjoint(first[0] @ second[0], first[1] + first[0] @ second[1])
    return _apart(adjoint(*first) @ adjoint(*second), both)


def _struts(device: MemsHexapod) -> list[ca.DM]:
    """Stiffness of the six struts in the global frame, assembled here from their ends."""
    h = device.values().hexapod
    g = hexapod.geometry(h)
    found = []
    for A, B in zip(g.platform, g.base, strict=True):
        span = np.array(ca.DM(A - B)).ravel()
        length = float(np.linalg.norm(span))
        x = span / length
        y = np.cross([0.0, 0.0, 1.0], x)
        y /= np.linalg.norm(y)
        R = ca.DM(np.column_stack([x, y, np.cross(x, y)]))
        found.append(ca.DM(move(hexapod.strut_stiffness(length, h), R, A)))
    return found


def _threefold(device: MemsHexapod) -> float:
    K = parallel(_struts(device))
    return _apart(K, move(K, rotation_z(TURN)))


def _thermal_force(device: MemsHexapod) -> float:
    a = device.values().actuator
    T = a.temperature_limit
    axial = float(ca.DM(thermal_actuator.beam_stiffness(a))[0, 3])
    strain = thermal_actuator.expansion(T, a) * (T - a.ambient)
    direct = 2 * a.beams * axial * a.beam_length * strain * sin(a.beam_angle)
    return float(thermal_actuator.force(T, a)) / direct - 1


def _stage(device: MemsHexapod) -> float:
    p, found = device.values(), matrices(device)
    C_X, turn = np.linalg.inv(found["K_X"]), np.array(ca.DM(rotation_z(pi / 2)))
    arm = np.array([0.0, p.stage.centre_offset, 0.0])
    columns = []
    for wrench in np.eye(6):
        force, moment = wrench[:3], wrench[3:]
        there = np.concatenate([turn.T @ force, turn.T @ (moment - np.cross(arm, force))])
        twist = C_X @ there
        theta = turn @ twist[:3]
        columns.append(C_X @ wrench + np.concatenate([theta, turn @ twist[3:] + np.cross(arm, theta)]))
    return _apart(found["C_XY"], np.array(columns).T)


def _parasitic(device: MemsHexapod) -> float:
    s = device.values().stage
    phi = float(xy_stage.rotation(55e-6, s))
    return float(xy_stage.parasitic(55e-6, s)) / (s.lever_long * 2 * sin(phi / 2) ** 2) - 1


def _total(device: MemsHexapod) -> float:
    p = device.values()
    parts = float(xy_stage.linear_force(55e-6, p.stage, p.actuator)) + float(xy_stage.nonlinear_force(55e-6, p.stage))
    return float(xy_stage.force(55e-6, p.stage, p.actuator)) / parts - 1


def _jacobian(device: MemsHexapod) -> float:
    """Unknown at once: the twists of platform and three stages, each stage's driven twist and its yielding under the struts."""
    p, found = device.values(), matrices(device)
    g, struts = hexapod.geometry(p.hexapod), _struts(device)
    size = np.repeat([1.0, 1e-3], 3)  # mm

    def scaled(K: ca.DM) -> np.ndarray:
        return np.diag(1 / size) @ np.array(K) @ np.diag(size) * 1e-3

    stage = [scaled(ca.DM(inverse(move(ca.DM(found["C_XY"]), g.rotation[j], g.centre[j])))) for j in range(3)]
    pairs = [sum(scaled(struts[i]) for i in range(6) if hexapod.STAGE_OF_STRUT[i] == j) for j in range(3)]
    K = np.zeros((24, 24))
    load = np.zeros((24, 6))
    K[:6, :6] = sum(pairs)
    for j in range(3):
        own = slice(6 + 6 * j, 12 + 6 * j)
        K[own, own] = pairs[j] + stage[j]
        K[:6, own] = K[own, :6] = -pairs[j]
        travel = np.vstack([np.zeros((3, 2)), np.array(ca.DM(g.rotation[j]))[:, :2]])
        load[own, 2 * j : 2 * j + 2] = stage[j] @ (travel / size[:, None])
    twist = size[:, None] * np.linalg.solve(K, load)[:6]
    return _apart(found["J"], twist)


def _blade(device: MemsHexapod) -> float:
    a = device.values().actuator
    length, t, w, E = a.beam_length, a.beam_width, a.thickness, a.young
    C = np.array(ca.DM(flexure.blade_compliance(length, t, w, E, a.poisson)))
    n = 2000
    s = (np.arange(n) + 0.5) * length / n  # distance from the free end
    ds, I_y, I_z = length / n, t * w**3 / 12, w * t**3 / 12
    integrated = np.array(
        [np.sum(s**2) * ds / (E * I_z), np.sum(s) * ds / (E * I_z), np.sum(s**2) * ds / (E * I_y), length / (E * w * t)]
    )
    printed = np.array([C[4, 1], C[2, 1], C[5, 2], C[3, 0]])
    return float(np.abs(integrated / printed - 1).max())


def _torsion() -> float:
    ratio = 2.0
    odd = np.arange(1, 60, 2)
    series_ = 1 / 3 - 64 / pi**5 / ratio * np.sum(np.tanh(odd * pi * ratio / 2) / odd**5)
    return float(flexure.torsion_ratio(1.0, ratio)) / (12 * series_) - 1


def _wire(device: MemsHexapod) -> float:
    h = device.values().hexapod
    length, d, E, nu = h.wire_length, h.wire_diameter, h.young, h.poisson
    I = pi * d**4 / 64
    chi = 1 / (2 * (1 + nu))
    printed = np.zeros((6, 6))
    printed[0, 3] = 1 / (2 * chi)
    printed[1, 2], printed[1, 4], printed[2, 1], printed[2, 5] = -length / 2, 1.0, length / 2, 1.0
    printed[3, 0] = d**2 / 16
    printed[4, 1] = printed[5, 2] = length**2 / 3
    printed[4, 5], printed[5, 4] = length / 2, -length / 2
    return _apart(flexure.wire_compliance(length, d, E, nu), printed * length / (E * I))


def geometry(device: MemsHexapod) -> list[PrintedNumber]:
    """Table 2 and eq. (13): struts, radii and angles from one another."""
    h = device.values().hexapod
    g = hexapod.geometry(h)
    A, B = ([np.array(ca.DM(point)).ravel() for point in points] for points in (g.platform, g.base))
    flat = float(np.linalg.norm((A[0] - B[0])[:2]))
    as_printed = 1e3 * sqrt(flat**2 + (h.height - h.platform_thickness) ** 2)
    reason = "eq. (13) ends a strut H below the platform's top; with H from strut end to strut end L is as printed"
    found = [
        PrintedNumber(
            "S1",
            "Table 2, L by eq. (13)",
            "5.4",
            "mm",
            1e3 * float(hexapod.strut_length(h)),
            reason,
            taken_literally=as_printed,
        ),
    ]
    fall = sqrt((5.4e-3) ** 2 - flat**2)
    slack = 1e3 * 5.4e-3 / fall * 0.05e-3  # L is printed to a tenth
    found.append(
        PrintedNumber(
            "S1",
            "Table 2, H from L",
            "4.127",
            "mm",
            1e3 * fall,
            "L is printed to a tenth of a millimetre",
            0.5e-3 + slack,
        )
    )
    for radius, text, first, second, angle_names in (
        ("r_a", "1.572", 0.4, 2.5, ALPHA),
        ("r_b", "4.277", 0.4, 7.2, BETA),
    ):
        R = sqrt((first**2 + first * second + second**2) / 3)  # circle through a hexagon of these alternate sides
        slack = ((2 * first + second) + (first + 2 * second)) * 0.05 / (6 * R)
        names = "c_3 and c_4" if radius == "r_a" else "c_1 and c_2"
        rounded = "spacings are printed to a tenth of a millimetre"
        found.append(PrintedNumber("S1", f"Table 2, {radius} from {names}", text, "mm", R, rounded, 0.5e-3 + slack))
        half = np.degrees(np.arcsin(first / (2 * R)))
        turn = np.degrees(0.05 / (2 * R * cos(radians(half))) + first * slack / (2 * R**2))
        found += [
            PrintedNumber(
                "S1", f"Table 2, {name} from {names}", printed, "deg", centre + side * half, rounded, 0.05 + turn
            )
            for name, printed, centre, side in angle_names
        ]
    return found

"""S0 section 4: Jacobians of platform and cube, eq. (10) to (16), and the 54 kinematic poses of Table 4."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.devices.meso_hexapod import MesoHexapod
from ctrlgen.physics import meso_hexapod_kinematics as meso_hexapod
from ctrlgen.recordings.pose_errors import CHANNELS

from .rounding import half_units, propagated_rounding
from .row import PrintedNumber
from .s0_data import PaperRecordings
from .s0_tables import COMMANDS_2, DIGITS, HALF_J_CUBE, SCALE, TABLE_2, UNITS, s0_row

ROUNDED = "computed from Table 4, which is rounded to three digits"
PER_MM = np.repeat([1e-3, 1.0], 3)[:, None]  # rad/m to rad/mm


def _unit_motions(data: PaperRecordings) -> Callable[[np.ndarray], np.ndarray]:
    """Kinematic poses of Table 4 (54, 6) [deg, um] -> K = [J^k] [J^c]^-1, which they are times the commands; (6, 6) in SI.

    Each number counts as much as its print resolves: 3.70E-04 is a thousand times sharper than 1.03E-01. Only
    the positive motions in one channel count: opposite and coupled ones repeat their numbers, rounded alike.
    """
    once = (np.count_nonzero(data.commanded, axis=1) == 1) & (data.commanded.sum(axis=1) > 0)
    sharp = 1 / half_units(data.kinematic[once] / SCALE, DIGITS)
    solution = np.array([np.linalg.pinv(weight[:, None] * data.commanded[once]) * weight for weight in sharp.T])

    def found(kinematic: np.ndarray) -> np.ndarray:
        return np.einsum("ijk,ki->ij", solution, kinematic[once] * SCALE)

    return found


def table_2(device: MesoHexapod, data: PaperRecordings) -> list[PrintedNumber]:
    """The cube's motion from Table 4: its kinematic lines are [J^k] [J^c]^-1 T, the inverse of what Table 2 measured."""
    back = ca.DM(meso_hexapod.cube_to_platform(-device.cube.depth.si)).full()

    unit_motions = _unit_motions(data)

    def cube(kinematic: np.ndarray) -> np.ndarray:
        K = unit_motions(kinematic.reshape(-1, 6))
        motion = back @ np.linalg.solve(K, np.diag(np.array(COMMANDS_2) * SCALE))
        return (motion.T / SCALE).ravel()

    printed = data.kinematic / SCALE
    ours = cube(printed.ravel())
    extra = propagated_rounding(cube, printed.ravel(), half_units(printed, DIGITS).ravel())
    return [
        s0_row(
            f"Table 2, i = {k // 6 + 1}, {CHANNELS[k % 6]}", text, UNITS[k % 6], ours[k], extra=extra[k], reason=ROUNDED
        )
        for k, text in enumerate(TABLE_2.split())
    ]


def equation_10(device: MesoHexapod, data: PaperRecordings) -> list[PrintedNumber]:
    """[J^k], whose print the scan has lost, beside what Table 4 and eq. (14) say of it: K [Ad] [J_cube]."""
    J_k = _kinematic(device)
    Ad = ca.DM(meso_hexapod.cube_to_platform(device.cube.depth.si)).full()

    unit_motions = _unit_motions(data)

    def implied(numbers: np.ndarray) -> np.ndarray:
        K = unit_motions(numbers[:324].reshape(-1, 6))
        return (PER_MM * (K @ Ad @ numbers[324:].reshape(6, 6))).ravel()

    return _lost("Eq. (10), J^k", PER_MM * J_k, implied, data, "Table 4 and eq. (14)")


def equation_15(device: MesoHexapod, data: PaperRecordings) -> list[PrintedNumber]:
    """[J^c] = [Ad] [J_cube], whose print the scan has lost, beside what Table 4 says of it: K^-1 [J^k]."""
    J_k = _kinematic(device)

    unit_motions = _unit_motions(data)

    def implied(numbers: np.ndarray) -> np.ndarray:
        return (PER_MM * np.linalg.solve(unit_motions(numbers[:324].reshape(-1, 6)), J_k)).ravel()

    # five decimals of [J_cube], its rotations on the arm h in the two rows that [Ad] changes
    arm = from_si(device.cube.depth.si, "mm")
    own = 5e-6 * np.repeat([1.0, 1.0 + arm, 1.0], [18, 12, 6])
    return _lost("Eq. (15), J^c", PER_MM * data.J_c, implied, data, "Table 4 and the kinematic model", own)


def _lost(
    where: str,
    ours: np.ndarray,
    implied: Callable[[np.ndarray], np.ndarray],
    data: PaperRecordings,
    source: str,
    own: np.ndarray | float = 0.0,
) -> list[PrintedNumber]:
    """Rows of a matrix that the scan has lost, each within what rounding leaves of the `implied` one.

    `implied` takes the 324 numbers of Table 4 and the 36 of eq. (14); `own` is how well `ours` are known (36,).
    """
    printed = data.kinematic / SCALE
    numbers = np.concatenate([printed.ravel(), data.J_cube.ravel()])
    half = np.concatenate([half_units(printed, DIGITS).ravel(), HALF_J_CUBE])
    expected, extra = implied(numbers), propagated_rounding(implied, numbers, half)
    allowed = extra + own
    return [
        PrintedNumber(
            "S0",
            f"{where} {_entry(k)}",
            "lost",
            _entry_unit(k),
            float(value),
            f"lost in the scan; {source} say {expected[k]:.5f} within {allowed[k]:.5f}",
            float(allowed[k]),
            implied=float(expected[k]),
        )
        for k, value in enumerate(ours.ravel())
    ]


def _kinematic(device: MesoHexapod) -> np.ndarray:
    p = device.values()
    return ca.DM(meso_hexapod.kinematic_jacobian(p.hexapod, p.directions.jacobian)).full()


def equation_14(device: MesoHexapod, data: PaperRecordings) -> list[PrintedNumber]:
    """[J_cube] by eq. (11) and (13): the motions of Table 2 over the inputs the device's own Jacobian asks for."""
    inputs = meso_hexapod.commands(ca.DM(_kinematic(device)), ca.DM(np.diag(np.array(COMMANDS_2) * SCALE))).full()

    def jacobian(table: np.ndarray) -> np.ndarray:
        motion = table.reshape(6, 6).T * SCALE[:, None]
        return (PER_MM * np.linalg.solve(inputs.T, motion.T).T).ravel()

    table = np.array(TABLE_2.split(), dtype=float)
    ours, extra = jacobian(table), propagated_rounding(jacobian, table, half_units(table, DIGITS))
    reason = "computed from Table 2, which is rounded to three digits"
    return [
        s0_row(f"Eq. (14), J_cube {_entry(k)}", f"{value:.5f}", _entry_unit(k), ours[k], extra=extra[k], reason=reason)
        for k, value in enumerate((PER_MM * data.J_cube).ravel())
    ]


def equation_16(data: PaperRecordings) -> list[PrintedNumber]:
    """h: the depth that carries the cube's translations of Table 2 over to the platform's of Table 4."""
    table = np.array(TABLE_2.split(), dtype=float).reshape(6, 6)

    unit_motions = _unit_motions(data)

    def depth(numbers: np.ndarray) -> np.ndarray:
        cube = numbers[324:].reshape(6, 6).T * SCALE[:, None]
        K = unit_motions(numbers[:324].reshape(-1, 6))
        platform = np.linalg.solve(K, np.diag(np.array(COMMANDS_2) * SCALE))
        arm = np.concatenate([cube[1], -cube[0]])  # h theta_y and -h theta_x
        return np.array([arm @ np.concatenate(platform[3:5] - cube[3:5]) / (arm @ arm)]) * 1e3

    numbers = np.concatenate([(data.kinematic / SCALE).ravel(), table.ravel()])
    half = np.concatenate([half_units(data.kinematic / SCALE, DIGITS).ravel(), half_units(table, DIGITS).ravel()])
    extra = propagated_rounding(depth, numbers, half)[0]
    reason = "computed from Tables 2 and 4, which are rounded to three digits"
    return [s0_row("Eq. (16), h", "31.57", "mm", depth(numbers)[0], extra=extra, reason=reason)]


def table_4(device: MesoHexapod, data: PaperRecordings) -> list[PrintedNumber]:
    """The kinematic model's 54 poses [J^k] U_j, with U_j = [J^c]^-1 T_j as well known as eq. (14) prints [J_cube]."""
    J_k = _kinematic(device)
    Ad = ca.DM(meso_hexapod.cube_to_platform(device.cube.depth.si)).full()

    def poses(J_cube: np.ndarray) -> np.ndarray:
        inputs = np.linalg.solve(Ad @ J_cube.reshape(6, 6), data.commanded.T)
        return ((J_k @ inputs).T / SCALE).ravel()

    ours = poses(data.J_cube.ravel())
    extra = propagated_rounding(poses, data.J_cube.ravel(), HALF_J_CUBE)
    printed = (data.kinematic / SCALE).ravel()
    reason = "inputs from eq. (14), which is rounded to five decimals"
    found = []
    for k, value in enumerate(printed):
        where, text = f"Table 4, j = {k // 6 + 1}, kinematic {CHANNELS[k % 6]}", f"{value:.{DIGITS - 1}E}"
        found.append(s0_row(where, text, UNITS[k % 6], ours[k], extra=extra[k], reason=reason))
    return found


def _entry(k: int) -> str:
    return f"({k // 6 + 1},{k % 6 + 1})"


def _entry_unit(k: int) -> str:
    return "rad/mm" if k < 18 else "mm/mm"

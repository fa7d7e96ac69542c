"""Every printed number of S0 that can be computed: Tables 1 to 4, eq. (14) and (16), the errors of section 5.

Left out: the numbers of eq. (10) and (15), which the scan has lost; measured and commanded poses, which are data;
accuracies of the instruments. What is computed from Table 4 has the propagated rounding of its three digits as tolerance.
Numbers that follow from the device as printed differ; a device corrected by a diagnosis can be given instead.
"""

from __future__ import annotations

from math import asin, degrees, radians, sin, sqrt
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.core.units import from_si, to_si
from ctrlgen.devices.meso_hexapod import MesoHexapod
from ctrlgen.physics import meso_hexapod_kinematics as meso_hexapod
from ctrlgen.recordings.pose_errors import CHANNELS, parasitic, pose_errors

from .rounding import half_units, propagated_rounding
from .row import PrintedNumber, half_unit
from .s0_data import PaperRecordings, load_s0

UNITS = ("deg",) * 3 + ("um",) * 3
SCALE = np.array([to_si(1.0, unit) for unit in UNITS])
DIGITS = 3  # of Table 4
AS_PRINTED = "r_a, eq. (4) and eq. (9) as printed contradict each other and the recordings"
ROUNDED = "computed from Table 4, which is rounded to three digits"
RADIUS = "r_a = 81.44 mm contradicts c_3, c_4 and L, which need 64.29 mm"

# Table 2: measured motion of the cube for the commands 0.1 deg and 100 um, one axis a line. The scan scatters it;
# which number stands where follows from Table 4.
TABLE_2 = """
     9.72E-02  2.21E-04 -4.38E-04  2.31E+00  4.58E+01  2.83E+00
    -1.43E-03  9.50E-02 -1.94E-03 -5.83E+01  5.58E+00 -2.42E+00
     2.20E-03  1.83E-03  9.97E-02 -2.62E+00  9.27E+00 -1.69E+00
    -1.75E-06  1.94E-04  9.51E-04  9.91E+01 -2.21E+00 -6.18E-01
    -6.44E-05  8.25E-05  5.83E-05  3.74E+00  9.88E+01  5.78E-01
     3.56E-04  1.13E-03  1.28E-03  4.92E+00  3.38E-01  9.59E+01
"""
COMMANDS_2 = (0.1, 0.1, 0.1, 100.0, 100.0, 100.0)

TABLE_3 = {
    "max": ("0.00127", "0.00105", "0.00235", "3.34041", "2.27184", "0.11"),
    "min": ("-0.00119", "-0.002", "-0.0009", "-2.1961", "-1.50408", "-1.82"),
    "standard deviation": ("0.000276979", "0.000387935", "0.00046507", "0.686572", "0.570813", "0.410767"),
}

NORMS = (
    ("kinematic model, largest rotation error", "0.0126", "deg"),
    ("kinematic model, mean rotation error", "0.0037", "deg"),
    ("calibrated model, largest rotation error", "0.0030", "deg"),
    ("calibrated model, mean rotation error", "0.0009", "deg"),
    ("kinematic model, largest translation error", "19.91", "um"),
    ("kinematic model, mean translation error", "9.33", "um"),
    ("calibrated model, largest translation error", "3.95", "um"),
    ("calibrated model, mean translation error", "1.60", "um"),
)

EXTREMES = (
    ("section 5.2, largest mean |error| of a rotation axis", "0.001", "deg"),
    ("section 5.2, largest mean |error| of a translation axis", "1", "um"),
    ("section 5.2, largest |error| of a rotation axis", "0.0024", "deg"),
    ("section 5.2, largest |error| of a translation axis", "3.34", "um"),
    ("section 5.2, largest standard deviation of a rotation axis", "0.000465", "deg"),
    ("section 5.2, largest standard deviation of a translation axis", "0.686572", "um"),
    ("abstract, largest |error| of a rotation axis", "0.002", "deg"),
    ("abstract, largest |error| of a translation axis", "3.3", "um"),
    ("conclusion, largest |error| of a rotation axis", "0.0024", "deg"),
    ("conclusion, largest |error| of a translation axis", "3.34", "um"),
)


def rows(device: MesoHexapod | None = None) -> list[PrintedNumber]:
    """The printed numbers in the order of the paper; `device` replaces the one as printed."""
    printed, recordings = load_s0()
    used = device or printed
    return [
        *_table_1(used),
        *_table_2(printed, recordings),
        *_equation_14(used, recordings),
        *_equation_16(recordings),
        *_counts(recordings),
        *_norms(recordings),
        *_table_3(recordings),
        *_table_4(used, recordings),
    ]


def _table_1(device: MesoHexapod) -> list[PrintedNumber]:
    """Lengths and angles of Table 1 from one another: struts, spacings, and radii and angles back from spacings."""
    h = device.values().hexapod
    found = []
    length = float(ca.DM(meso_hexapod.home_lengths(h))[0])
    found.append(_row("Table 1, L from eq. (1)", "240", "mm", from_si(length, "mm"), reason=RADIUS))
    radii = {}
    for end, radius, near, far, first, second, angles, base in (
        ("a", "r_a", "c_3", "c_4", "20", "100", ("189", "171", "69", "51", "-51", "-69"), 180.0),
        ("b", "r_b", "c_1", "c_2", "20", "230", ("236", "124", "116", "4", "-4", "-116"), -120.0),
    ):
        r = h.platform_radius if end == "a" else h.base_radius
        at = h.platform_angles if end == "a" else h.base_angles
        gaps = (at[2] - at[3], at[1] - at[2]) if end == "a" else (at[1] - at[2], at[2] - at[3])
        for name, text, gap in ((near, first, min(gaps)), (far, second, max(gaps))):
            chord, slack = 2 * r * sin(gap / 2), r * sin(radians(1.0))  # two angles known to half a degree
            reason = RADIUS if end == "a" else "angles are printed to the degree"
            found.append(
                _row(
                    f"Table 1, {name} from {radius} and its angles",
                    text,
                    "mm",
                    from_si(chord, "mm"),
                    extra=from_si(slack, "mm"),
                    reason=reason,
                )
            )
        a, b = float(first), float(second)
        R = sqrt((a * a + a * b + b * b) / 3)  # circle through a hexagon of alternate sides a and b
        slack = ((2 * a + b) + (a + 2 * b)) * 0.5 / (6 * R)
        radii[end] = R
        text = "81.44" if end == "a" else "138.92"
        reason = RADIUS if end == "a" else "spacings are printed to the millimetre"
        found.append(_row(f"Table 1, {radius} from {near} and {far}", text, "mm", R, extra=slack, reason=reason))
        half = degrees(asin(a / (2 * R)))
        symbol = "phi" if end == "a" else "psi"
        around = (base + half, base - half, 60 + half, 60 - half, -60 + half, -60 - half)
        if end == "b":
            around = (240 - half, 120 + half, 120 - half, half, -half, -120 + half)
        for i, (text, angle) in enumerate(zip(angles, around, strict=True)):
            found.append(_row(f"Table 1, {symbol}_{i + 1} from {near} and {far}", text, "deg", angle))
    corrected = _with(h, platform_radius=to_si(radii["a"], "mm"))
    length = float(ca.DM(meso_hexapod.home_lengths(corrected))[0])
    found.append(_row("Table 1, L with r_a from c_3 and c_4", "240", "mm", from_si(length, "mm")))
    return found


def _with(values: Any, **changes: Any) -> Any:
    return type(values)(**{**vars(values), **changes})


def _unit_motions(data: PaperRecordings, kinematic: np.ndarray) -> np.ndarray:
    """K = [J^k] [J^c]^-1 from Table 4: its kinematic poses are K times the commands; (6, 6) in SI.

    Each number counts as much as its print resolves: 3.70E-04 is a thousand times sharper than 1.03E-01. Only
    the positive motions in one channel count: opposite and coupled ones repeat their numbers, rounded alike.
    """
    once = (np.count_nonzero(data.commanded, axis=1) == 1) & (data.commanded.sum(axis=1) > 0)
    sharp = 1 / half_units(data.kinematic[once] / SCALE, DIGITS)
    found = [
        np.linalg.lstsq(weight[:, None] * data.commanded[once], weight * pose, rcond=None)[0]
        for weight, pose in zip(sharp.T, (kinematic[once] * SCALE).T, strict=True)
    ]
    return np.array(found)


def _table_2(device: MesoHexapod, data: PaperRecordings) -> list[PrintedNumber]:
    """The cube's motion from Table 4: its kinematic lines are [J^k] [J^c]^-1 T, the inverse of what Table 2 measured."""
    back = ca.DM(meso_hexapod.cube_to_platform(-device.cube.depth.si)).full()

    def cube(kinematic: np.ndarray) -> np.ndarray:
        K = _unit_motions(data, kinematic.reshape(-1, 6))
        motion = back @ np.linalg.solve(K, np.diag(np.array(COMMANDS_2) * SCALE))
        return (motion.T / SCALE).ravel()

    printed = data.kinematic / SCALE
    ours = cube(printed.ravel())
    extra = propagated_rounding(cube, printed.ravel(), half_units(printed, DIGITS).ravel())
    return [
        _row(
            f"Table 2, i = {k // 6 + 1}, {CHANNELS[k % 6]}", text, UNITS[k % 6], ours[k], extra=extra[k], reason=ROUNDED
        )
        for k, text in enumerate(TABLE_2.split())
    ]


def _equation_14(device: MesoHexapod, data: PaperRecordings) -> list[PrintedNumber]:
    """[J_cube] by eq. (11) and (13): the motions of Table 2 over the inputs the device's own Jacobian asks for."""
    p = device.values()
    J_k = ca.DM(meso_hexapod.kinematic_jacobian(p.hexapod, p.directions.jacobian))
    inputs = meso_hexapod.commands(J_k, ca.DM(np.diag(np.array(COMMANDS_2) * SCALE))).full()
    factor = np.repeat([1e-3, 1.0], 3)[:, None]  # rad/m to rad/mm

    def jacobian(table: np.ndarray) -> np.ndarray:
        motion = table.reshape(6, 6).T * SCALE[:, None]
        return (factor * np.linalg.solve(inputs.T, motion.T).T).ravel()

    table = np.array(TABLE_2.split(), dtype=float)
    ours, extra = jacobian(table), propagated_rounding(jacobian, table, half_units(table, DIGITS))
    found = []
    for k, value in enumerate((factor * data.J_cube).ravel()):
        text, unit = f"{value:.5f}", "rad/mm" if k < 18 else "mm/mm"
        close = abs(ours[k] - value) <= half_unit(text) + extra[k]
        reason = "computed from Table 2, which is rounded to three digits" if close else AS_PRINTED
        found.append(
            _row(f"Eq. (14), J_cube ({k // 6 + 1},{k % 6 + 1})", text, unit, ours[k], extra=extra[k], reason=reason)
        )
    return found


def _equation_16(data: PaperRecordings) -> list[PrintedNumber]:
    """h: the depth that carries the cube's translations of Table 2 over to the platform's of Table 4."""
    table = np.array(TABLE_2.split(), dtype=float).reshape(6, 6)

    def depth(numbers: np.ndarray) -> np.ndarray:
        cube = numbers[324:].reshape(6, 6).T * SCALE[:, None]
        K = _unit_motions(data, numbers[:324].reshape(-1, 6))
        platform = np.linalg.solve(K, np.diag(np.array(COMMANDS_2) * SCALE))
        arm = np.concatenate([cube[1], -cube[0]])  # h theta_y and -h theta_x
        return np.array([arm @ np.concatenate(platform[3:5] - cube[3:5]) / (arm @ arm)]) * 1e3

    numbers = np.concatenate([(data.kinematic / SCALE).ravel(), table.ravel()])
    half = np.concatenate([half_units(data.kinematic / SCALE, DIGITS).ravel(), half_units(table, DIGITS).ravel()])
    extra = propagated_rounding(depth, numbers, half)[0]
    reason = "computed from Tables 2 and 4, which are rounded to three digits"
    return [_row("Eq. (16), h", "31.57", "mm", depth(numbers)[0], extra=extra, reason=reason)]


def _counts(data: PaperRecordings) -> list[PrintedNumber]:
    single = sum(len(part.poses) for part in parasitic(data.commanded, data.measured))
    n = len(data.commanded)
    named = (("poses", "54", n), ("poses in one degree of freedom", "24", single), ("coupled poses", "30", n - single))
    return [_row(f"Section 5.1, {name}", text, "1", float(count)) for name, text, count in named]


def _statistics(data: PaperRecordings, numbers: np.ndarray) -> np.ndarray:
    """The 8 NORMS, the 10 EXTREMES and the 18 entries of Table 3, in deg and um, from printed numbers."""
    measured, kinematic = numbers.reshape(2, -1, 6)
    commanded = data.commanded / SCALE
    # The calibrated model predicts the command itself: U_j = [J^c]^-1 T_j.
    model, calibrated = pose_errors(measured, kinematic), pose_errors(measured, commanded)
    norms = [
        f(getattr(e, part))
        for part in ("rotation", "translation")
        for e in (model, calibrated)
        for f in (np.max, np.mean)
    ]
    largest, mean = np.abs(calibrated.errors).max(0), calibrated.absolute.mean
    sd = calibrated.absolute.sd
    halves = [f(v[s]) for v in (mean, largest, sd) for f, s in ((np.max, slice(0, 3)), (np.max, slice(3, 6)))]
    extremes = halves + 2 * halves[2:4]
    return np.concatenate([norms, extremes, calibrated.signed.maximum, calibrated.signed.minimum, sd])


def _section_5(data: PaperRecordings) -> tuple[np.ndarray, np.ndarray]:
    printed = np.concatenate([data.measured / SCALE, data.kinematic / SCALE]).ravel()
    half = half_units(printed, DIGITS)
    return _statistics(data, printed), propagated_rounding(lambda numbers: _statistics(data, numbers), printed, half)


def _norms(data: PaperRecordings) -> list[PrintedNumber]:
    ours, extra = _section_5(data)
    named = [(f"section 5.2, {name}", text, unit) for name, text, unit in NORMS] + list(EXTREMES)
    return [
        _row(where[0].upper() + where[1:], text, unit, ours[k], extra=extra[k], reason=ROUNDED)
        for k, (where, text, unit) in enumerate(named)
    ]


def _table_3(data: PaperRecordings) -> list[PrintedNumber]:
    ours, extra = _section_5(data)
    start = len(NORMS) + len(EXTREMES)
    found = []
    for k, (name, i) in enumerate((name, i) for name in TABLE_3 for i in range(6)):
        reason = ROUNDED + ("; it is that of the absolute errors" if name == "standard deviation" else "")
        found.append(
            _row(
                f"Table 3, {name}, {CHANNELS[i]}",
                TABLE_3[name][i],
                UNITS[i],
                ours[start + k],
                extra=extra[start + k],
                reason=reason,
            )
        )
    return found


def _table_4(device: MesoHexapod, data: PaperRecordings) -> list[PrintedNumber]:
    """The kinematic model's 54 poses [J^k] U_j, with U_j = [J^c]^-1 T_j as well known as eq. (14) prints [J_cube]."""
    p = device.values()
    J_k = ca.DM(meso_hexapod.kinematic_jacobian(p.hexapod, p.directions.jacobian)).full()
    Ad = ca.DM(meso_hexapod.cube_to_platform(p.cube.depth)).full()

    def poses(J_cube: np.ndarray) -> np.ndarray:
        inputs = np.linalg.solve(Ad @ J_cube.reshape(6, 6), data.commanded.T)
        return ((J_k @ inputs).T / SCALE).ravel()

    ours = poses(data.J_cube.ravel())
    # rad/m and 1, of five decimals in mm
    extra = propagated_rounding(poses, data.J_cube.ravel(), np.repeat([0.5e-2, 0.5e-5], 18))
    printed = (data.kinematic / SCALE).ravel()
    found = []
    for k, value in enumerate(printed):
        where, text = f"Table 4, j = {k // 6 + 1}, kinematic {CHANNELS[k % 6]}", f"{value:.{DIGITS - 1}E}"
        close = abs(ours[k] - value) <= half_unit(text) + extra[k]
        reason = "inputs from eq. (14), which is rounded to five decimals" if close else AS_PRINTED
        found.append(_row(where, text, UNITS[k % 6], ours[k], extra=extra[k], reason=reason))
    return found


def _row(where: str, printed: str, unit: str, ours: float, *, extra: float = 0.0, reason: str = "") -> PrintedNumber:
    """A printed number; `extra` is what rounded data add to half a unit of the print. A reason is kept where it is needed."""
    tolerance = half_unit(printed) + extra if extra else None
    row = PrintedNumber("S0", where, printed, unit, float(ours), reason, tolerance)
    needed = extra or abs(row.difference or 0.0) > row.allowed * (1 + 1e-9)
    return row if needed else PrintedNumber("S0", where, printed, unit, float(ours))

"""Printed numbers of S1: actuator and notch stiffness, force laws, geometry, case studies."""

from __future__ import annotations

from typing import cast

import numpy as np

from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.core.shipped_files import shipped
from ctrlgen.devices import load_device
from ctrlgen.devices.mems_hexapod import MemsHexapod, matrices
from ctrlgen.model.assembly import build_model
from ctrlgen.model.model import Model
from ctrlgen.physics import hexapod, xy_stage
from ctrlgen.trajectory.workspace import Workspace

from .row import PrintedNumber, half_unit

DEVICE = shipped("scenarios") / "devices" / "mems_hexapod.toml"

# Printed in N and um; (row, column) counted from 1.
K_TB = {
    (1, 4): "8.70e-2",
    (2, 3): "-2.16e-2",
    (2, 5): "4.32e-5",
    (3, 2): "3.91e-2",
    (3, 6): "7.83e-5",
    (4, 1): "3.06",
    (5, 2): "26.1",
    (5, 6): "3.91e-2",
    (6, 3): "14.4",
    (6, 5): "-0.22",
}
K_T = {
    (1, 4): "1.33e-2",
    (2, 3): "-498.0",
    (2, 5): "2.60",
    (3, 2): "0.368",
    (3, 6): "2.35e-3",
    (4, 1): "827.0",
    (5, 2): "174.0",
    (6, 3): "1.23e5",
    (6, 5): "-498",
}
# Table 3: what was commanded and what the paper's finite elements gave, and the printed error in percent [um, rad].
TABLE_3 = (
    ("delta_z", "3.0e1", "3.07e1", "2.39"),
    ("delta_x", "-1.0e1", "-1.04e1", "4.12"),
    ("delta_y", "-1.0e1", "-1.04e1", "4.25"),
    ("theta_x", "-4.0e-3", "-4.10e-3", "2.34"),
    ("theta_y", "-4.0e-3", "-4.20e-3", "4.69"),
    ("theta_z", "-4.00e-3", "-4.19e-3", "4.56"),
)
SIGNS_19 = ("-1", "-1", "-1", "1", "1", "1")  # F <= 0 or F >= 0, in the order of the actuators
NO_PLANT = "compares with the paper's own finite elements; an independent plant answers this: python -m plants"


def rows() -> list[PrintedNumber]:
    """Every printed number of S1 beside ours."""
    device = cast(MemsHexapod, load_device(DEVICE))
    return [*_matrices(device), *_geometry(device), *_force(device), *_signs(device), *_table_3(device), *_circle()]


def _in_micrometres(matrix: np.ndarray, row: int, column: int) -> float:
    """An entry of a stiffness matrix in N and um: columns 4-6 are per um, rows 4-6 moments in N um."""
    return float(matrix[row - 1, column - 1]) * (1e6 if row > 3 else 1.0) * (1e-6 if column > 3 else 1.0)


def _matrices(device: MemsHexapod) -> list[PrintedNumber]:
    found, result = matrices(device), []
    for symbol, equation, table in (("K_tb", "eq. (5)", K_TB), ("K_t", "eq. (6)", K_T)):
        for (row, column), printed in table.items():
            ours = _in_micrometres(found[symbol], row, column)
            reason = ""
            if symbol == "K_tb" and (row, column) == (6, 5):
                reason = "misprint: reciprocity with (2,3) demands -0.0216"
            elif symbol == "K_t" and (row, column) not in ((1, 4), (2, 5), (3, 6)):
                reason = "the moment entries do not follow from the printed beam spacing"
            result.append(PrintedNumber("S1", f"{equation} ({row},{column})", printed, "N, um", ours, reason))
    return result


def _geometry(device: MemsHexapod) -> list[PrintedNumber]:
    p = device.values()
    g = hexapod.geometry(p.hexapod)
    A, B = ([np.array(point.full()).ravel() for point in points] for points in (g.platform, g.base))

    def spacing(points: list[np.ndarray], i: int, j: int) -> float:
        return float(np.linalg.norm(points[i] - points[j])) * 1e3

    lengths = (
        ("Table 2, L", "5.4", float(hexapod.strut_length(p.hexapod)) * 1e3),
        ("Table 2, c_1", "0.4", spacing(B, 1, 2)),
        ("Table 2, c_2", "7.2", spacing(B, 0, 1)),
        ("Table 2, c_3", "0.4", spacing(A, 0, 1)),
        ("Table 2, c_4", "2.5", spacing(A, 1, 2)),
    )
    ratio = p.stage.lever_long / p.stage.lever_short
    result = [PrintedNumber("S1", where, printed, "mm", ours) for where, printed, ours in lengths]
    return [*result, PrintedNumber("S1", "section 3.3, e_4/e_3", "10", "1", ratio)]


def _force(device: MemsHexapod) -> list[PrintedNumber]:
    p = device.values()
    linear = float(xy_stage.linear_force(55e-6, p.stage, p.actuator))
    total = float(xy_stage.force(55e-6, p.stage, p.actuator))
    fitted = "k_a is chosen to meet this number, since Fig. 5 is lost"
    result = [
        PrintedNumber("S1", "section 6.2, linear force at 55 um", "0.104", "N", linear),
        PrintedNumber("S1", "section 6.2, nonlinear force at 55 um", "0.19", "N", total, fitted),
    ]
    errors = (("mean error, nonlinear", "1.93"), ("mean error, linear", "16.19"), ("error at the beginning", "5.33"))
    return result + [
        PrintedNumber("S1", f"section 6.2, {what}", printed, "%", None, NO_PLANT) for what, printed in errors
    ]


def _poses(model: Model) -> list[np.ndarray]:
    """The six poses of Table 3, (6,) [rad, m]."""
    channels, poses = model.signals["pose"].channels, []
    for channel, analytic, *_ in TABLE_3:
        pose = np.zeros(6)
        pose[5] = 30e-6
        pose[channels.index(channel)] = float(analytic) * (1e-6 if channel.startswith("delta") else 1.0)
        poses.append(pose)
    return poses


def _signs(device: MemsHexapod) -> list[PrintedNumber]:
    """The signs of the six forces of eq. (19): those of the forces that hold the poses of Table 3, in the paper's axes."""
    model = build_model(device)
    displacement = ControllerKernels(model, "pose", None).static.displacement
    d = [displacement(model.rest, 0, pose).full().ravel() for pose in _poses(model)]
    p = device.values()
    forces = device.in_paper_axes(np.array([[float(xy_stage.force(x, p.stage, p.actuator)) for x in row] for row in d]))
    signs = (np.sign(forces.min(axis=0)) + np.sign(forces.max(axis=0))) / 2  # 0 where a force changes its sign
    printed = zip(device.axes, SIGNS_19, signs, strict=True)
    return [
        PrintedNumber("S1", f"eq. (19), sign of the force on {axis}", text, "1", float(sign))
        for axis, text, sign in printed
    ]


def _table_3(device: MemsHexapod) -> list[PrintedNumber]:
    """The printed errors computed from the printed values, to their rounding; and whether the poses can be held."""
    workspace = Workspace(build_model(device))
    result = []
    for (channel, analytic, element, percent), pose in zip(TABLE_3, _poses(workspace.model), strict=True):
        ours = 100 * abs((float(analytic) - float(element)) / float(element))
        spread = 100 * abs(float(analytic)) * half_unit(element) / float(element) ** 2
        reason = "from values printed with three digits"
        result.append(
            PrintedNumber("S1", f"Table 3, error of {channel}", percent, "%", ours, reason, half_unit(percent) + spread)
        )
        held = float(workspace.holds(pose))
        result.append(PrintedNumber("S1", f"Table 3, {channel} at delta_z = 30 um can be held", "1", "yes = 1", held))
    return result


def _circle() -> list[PrintedNumber]:
    """Section 6.3: the mean of the three printed means; the other numbers need an independent plant."""
    means = ("3.94", "3.65", "2.55")
    mean = float(np.mean([float(m) for m in means]))
    result = [
        PrintedNumber(
            "S1", "section 6.3, mean of the three mean errors", "3.38", "%", mean, "", 0.5e-2 + half_unit(means[0])
        )
    ]
    for axis, printed in zip("xyz", means, strict=True):
        result.append(
            PrintedNumber("S1", f"section 6.3, mean error of delta_{axis} on the circle", printed, "%", None, NO_PLANT)
        )
    for axis, printed in zip("xyz", ("5.28e-6", "1.395e-5", "4.23e-6"), strict=True):
        result.append(PrintedNumber("S1", f"section 6.3, mean parasitic theta_{axis}", printed, "rad", None, NO_PLANT))
    return result

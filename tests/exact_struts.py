"""Poses of struts that keep their length, to rounding: eq. (2) of S0 solved by Newton's method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.numerics.newton import newton_solver
from ctrlgen.physics.meso_hexapod_kinematics import constraint, home_lengths
from ctrlgen.physics.screw import Matrix

TOLERANCE = 1e-15  # [m] of strut length; rounding of eq. (2) in float64 is 1e-16
MOST_STEPS = 20  # of Newton's method, which needs four within the workspace


def pose_from_actuators(
    U: np.ndarray, h: Any, directions: Sequence[float], lengths: Matrix | None = None
) -> np.ndarray:
    """The poses (n, 6) [rad, m] at which every strut keeps its length: eq. (2) solved for (theta, delta). U: (n, 6) [m].

    `lengths` are those at home unless given. Of the constraint's solutions Newton's method from home finds the nearest.
    Raises ValueError where it finds none.
    """
    pose, u, f = _symbols(h, directions, lengths)
    return _solved(f, pose, u, np.atleast_2d(U), ("pose", "actuator inputs"))


def actuators_from_pose(
    T: np.ndarray, h: Any, directions: Sequence[float], lengths: Matrix | None = None
) -> np.ndarray:
    """The actuator displacements (n, 6) [m] of given poses: eq. (2) solved for U. T: (n, 6) [rad, m].

    The inverse of `pose_from_actuators`. Raises ValueError where Newton's method from home finds no solution.
    """
    pose, u, f = _symbols(h, directions, lengths)
    return _solved(f, u, pose, np.atleast_2d(T), ("actuator inputs", "pose"))


def _symbols(h: Any, directions: Sequence[float], lengths: Matrix | None) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Symbols of pose and input, and the constraint as the excess length of each strut [m], (|A-B|^2 - L^2) / 2L."""
    pose, u = ca.SX.sym("pose", 6), ca.SX.sym("u", 6)
    L = home_lengths(h) if lengths is None else lengths
    return pose, u, constraint(pose, u, h, directions, L) / (2 * L)


def _solved(residual: ca.SX, unknown: ca.SX, known: ca.SX, rows: np.ndarray, names: tuple[str, str]) -> np.ndarray:
    """The `unknown` (n, 6) with residual = 0 for every row of the `known`, by Newton's method from home; `names` of both."""
    solver = newton_solver(
        "struts", residual, unknown, known, residual_below=TOLERANCE, step_below=0.0, most_steps=MOST_STEPS
    )
    found = np.zeros(rows.shape)
    for k, row in enumerate(rows):
        try:
            found[k] = solver(0, row).full().ravel()
        except RuntimeError as error:
            what = f"no {names[0]} within {MOST_STEPS} Newton steps of home for {names[1]} {np.array2string(row)}"
            raise ValueError(what) from error
    return found

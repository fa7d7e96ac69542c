"""Reference vectors: what the controller answers to some targets, for a test that runs on the target."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ctrlgen.controller import Controller, Status
from ctrlgen.firmware.cprint import Real
from ctrlgen.firmware.online import FLOAT_SLACK

VECTORS = 48  # reference vectors along the command; 16 more lie beyond the limits
PLAYED = 17  # samples of the player


def vectors(controller: Controller, command: np.ndarray, real: Real) -> dict[str, Any]:
    """Targets and the drives and status the reference answers, and what rounding may change.

    The tolerance is the change of drive that four roundings of what it follows from cause.
    """
    controller = controller if real is Real.DOUBLE else replace(controller, slack=FLOAT_SLACK)
    rng = np.random.default_rng(0)
    scale = np.array(controller.model.signals[controller.follow].scale)
    beyond = rng.normal(size=(16, command.shape[1])) * 40 * scale
    targets = [*command[:VECTORS], *beyond, np.full(command.shape[1], 1e9)]
    rows, tolerance, state = [], 0.0, controller.rest()
    rounding = 4 * _epsilon(real)
    for k, target in enumerate(targets):
        target = np.array(target, dtype=np.float32).astype(float) if real is Real.FLOAT else target
        settle = k == 0 or k >= len(targets) - len(beyond) - 1 or controller.moving is None
        before, step = state, controller.step(state, target, settle=settle)
        state = step.state
        exact = (
            not step.status & Status.DRIVE
        )  # a bisection may turn the other way in float: only its status is compared
        rows.append(
            {"target": target, "drive": step.drive, "status": int(step.status), "settle": settle, "exact": exact}
        )
        if exact and not step.status & Status.INPUT:
            kernel = (controller.static if settle or controller.moving is None else controller.moving).drive
            reached = (step.displacement, step.actuator_state)
            off = kernel(*before, *(value * (1 + rounding) for value in reached)) - kernel(*before, *reached)
            tolerance = max(tolerance, float(np.max(np.abs(off.full()))))
    tolerance = max(tolerance, 1e-12 * float(np.max(controller.nominal.u_scale)))
    return {"rows": rows, "tolerance": tolerance}


def played_vectors(drives: np.ndarray | None, real: Real) -> dict[str, Any]:
    """Samples of the solved `drives` (samples, axes), the first and the last among them, and four roundings of the largest."""
    if drives is None:
        return {"played": [], "played_tolerance": 0.0}
    indices = np.unique(np.linspace(0, len(drives) - 1, PLAYED).round().astype(int))
    return {
        "played": [{"index": int(k), "drive": drives[k]} for k in indices],
        "played_tolerance": max(4 * _epsilon(real) * float(np.max(np.abs(drives))), float(np.finfo(np.float32).tiny)),
    }


def _epsilon(real: Real) -> float:
    return float(np.finfo(np.float32 if real is Real.FLOAT else np.float64).eps)

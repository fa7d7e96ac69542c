"""Reference vectors: targets and the controller's answers to them, for the self test that runs in the firmware."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ctrlgen.firmware.compression import Compression
from ctrlgen.firmware.online import FLOAT_SLACK
from ctrlgen.firmware.real import Real
from ctrlgen.model.feedforward import Controller, ControllerStatus

VECTORS = 48  # reference vectors along the command; 16 more lie beyond the limits
PLAYED = 17  # samples of the player
UNUSABLE = 3  # NaN, infinity, minus infinity: each in every channel of the target, and as the time of the player


def vectors(controller: Controller, command: np.ndarray, real: Real) -> dict[str, Any]:
    """Targets with the drives and the status that the model answers, and the tolerance of the drives.

    The tolerance is the change of drive that four roundings of displacement and actuator state cause.
    """
    controller = controller if real is Real.DOUBLE else replace(controller, slack=FLOAT_SLACK)
    rng = np.random.default_rng(0)
    scale = np.array(controller.target.scale)
    beyond = rng.normal(size=(16, command.shape[1])) * 40 * scale
    targets = [*command[:VECTORS], *beyond, np.full(command.shape[1], 1e9)]
    rows, tolerance, state = [], 0.0, controller.rest()
    rounding = 4 * real.epsilon
    for k, target in enumerate(targets):
        target = np.array(target, dtype=np.float32).astype(float) if real is Real.FLOAT else target
        settle = k == 0 or k >= len(targets) - len(beyond) - 1 or controller.sample_time is None
        before, step = state, controller.step(state, target, settle=settle)
        state = step.state
        # rounding may make the line search accept another trial in float: only the status is compared there
        exact = not step.status & ControllerStatus.DRIVE
        rows.append(
            {"target": target, "drive": step.drive, "status": int(step.status), "settle": settle, "exact": exact}
        )
        if exact and not step.status & ControllerStatus.INPUT:
            tolerance = max(tolerance, controller.drive_rounding(before, target, step, settle, rounding))
    tolerance = max(tolerance, 1e-12 * float(np.max(controller.nominal.u_scale)))
    return {"rows": rows, "tolerance": tolerance, "unusable": UNUSABLE * command.shape[1]}


def played_vectors(compression: Compression | None, samples: int) -> dict[str, Any]:
    """Samples of the player, the first and the last among them, and their tolerance.

    The tolerance is 16 roundings of the largest drive, since a processor may fuse products and sums.
    """
    if compression is None:
        return {"played": [], "played_tolerance": 0.0, "played_unusable": 0}
    indices = np.unique(np.linspace(0, samples - 1, PLAYED).round().astype(int))
    drives = compression.drives(indices)
    rounding = 16 * compression.real.epsilon * float(np.max(np.abs(drives)))
    return {
        "played": [{"index": int(k), "drive": drive} for k, drive in zip(indices, drives, strict=True)],
        "played_unusable": UNUSABLE,
        "played_tolerance": max(rounding, float(np.finfo(np.float32).tiny)),
    }

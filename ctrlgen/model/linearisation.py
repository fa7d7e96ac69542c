"""The model at a pose as a linear system, for control design."""

from __future__ import annotations

import casadi as ca
import control
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.model.feedforward import Controller, ControllerStatus
from ctrlgen.model.model import Model


def equilibrium(model: Model, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(x, z, u) at rest at `pose` (n_components,), SI. Raises InputError where a limit of the device does not allow it."""
    controller = Controller(model, "pose", None)
    step = controller.step(controller.rest(), pose)
    if step.status:
        broken = ", ".join(flag.name.lower() for flag in ControllerStatus if flag in step.status and flag.name)
        raise InputError(
            "pose",
            [
                Fault(
                    "at",
                    f"is not an equilibrium within the device's limits ({broken}); choose a reachable pose, such as delta_z=20um",
                )
            ],
        )
    return step.state[0], step.displacement, step.drive


def linearise(model: Model, pose: np.ndarray) -> control.StateSpace:
    """The state space dx' = A dx + B du, dpose = C dx + D du about the equilibrium at `pose` (n_components,), all SI.

    The force balance g(x, z, u) = 0 is eliminated: dz = -g_z^-1 (g_x dx + g_u du). Inputs are the drives, states the
    temperatures and the effects' states, outputs the pose components, each by its name. Raises InputError where `pose` is
    no equilibrium within the device's limits.
    """
    x, z, u = equilibrium(model, pose)
    outputs = model.signals["pose"]
    blocks = [
        ca.jacobian(e, s) for e in (model.rates, model.balance, outputs.expr) for s in (model.x, model.z, model.u)
    ]
    function = ca.Function("jacobians", [model.x, model.z, model.u, model.p], blocks)
    f_x, f_z, f_u, g_x, g_z, g_u, y_x, y_z, y_u = (b.full() for b in function(x, z, u, model.p_nominal))
    z_x, z_u = -np.linalg.solve(g_z, g_x), -np.linalg.solve(g_z, g_u)
    drive = model.signals["drive"]
    return control.ss(
        f_x + f_z @ z_x, f_u + f_z @ z_u, y_x + y_z @ z_x, y_u + y_z @ z_u,
        states=list(model.x_names), inputs=[f"{drive.column}{c}" for c in drive.channels], outputs=list(outputs.channels),
        name=model.name,
    )  # fmt: skip

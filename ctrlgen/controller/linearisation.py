"""The model at a pose as a linear system, for control design."""

from __future__ import annotations

import casadi as ca
import control
import numpy as np

from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.feedforward import Controller
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.model.model import Model


def equilibrium(model: Model, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(x, z, u) at rest at `pose` (n_components,), SI. Raises InputError where a limit of the device does not allow it."""
    controller = Controller(ControllerKernels(model, "pose", None))
    step = controller.step(controller.rest(), pose)
    if step.status:
        broken = ", ".join(flag.name.lower() for flag in ControllerStatus if flag in step.status and flag.name)
        raise InputError(
            "pose",
            [
                Fault(
                    "at",
                    f"is not an equilibrium within the device's limits ({broken}); choose a reachable pose, "
                    "such as one that ctrlgen workspace finds",
                )
            ],
        )
    return step.state[0], step.displacement, step.drive


def linearise(model: Model, pose: np.ndarray) -> control.StateSpace:
    """The state space dx' = A dx + B du, dpose = C dx + D du about the equilibrium at `pose` (n_components,), all SI.

    Inputs are the drives, outputs the pose components, each by its name. Without inertia the states are the temperatures and the
    effects' states, and the force balance g(x, z, u) = 0 is eliminated: dz = -g_z^-1 (g_x dx + g_u du). With inertia velocities and
    displacements are states too, x' = f(x, z, u), z' = v; a feedback loop acts without the delay of its samples. Raises InputError
    where `pose` is no equilibrium within the device's limits.
    """
    x, z, u = equilibrium(model, pose)
    outputs, drive = model.signals["pose"], model.signals["drive"]
    names = list(model.x_names)
    if model.inertial:
        state = ca.vertcat(model.x, model.z)
        A, B, C, D = _slopes(
            model, (model.closed(ca.vertcat(model.rates, model.v)), outputs.expr), (state, model.u), x, z, u
        )
        names += [f"displacement_{axis}" for axis in model.axes]
    else:
        f_x, f_z, f_u, g_x, g_z, g_u, y_x, y_z, y_u = _slopes(
            model, (model.rates, model.balance, outputs.expr), (model.x, model.z, model.u), x, z, u
        )
        z_x, z_u = -np.linalg.solve(g_z, g_x), -np.linalg.solve(g_z, g_u)
        A, B, C, D = f_x + f_z @ z_x, f_u + f_z @ z_u, y_x + y_z @ z_x, y_u + y_z @ z_u
    inputs = [f"{drive.column}{c}" for c in drive.channels]
    return control.ss(A, B, C, D, states=names, inputs=inputs, outputs=list(outputs.channels), name=model.name)


def _slopes(
    model: Model,
    expressions: tuple[ca.SX, ...],
    arguments: tuple[ca.SX, ...],
    x: np.ndarray,
    z: np.ndarray,
    u: np.ndarray,
) -> list[np.ndarray]:
    """The derivatives of each expression by each argument at x, z, u, in the order of both."""
    blocks = [ca.jacobian(model.closed(e), s) for e in expressions for s in arguments]
    function = ca.Function("jacobians", [model.x, model.z, model.u, model.p, model.ambient_symbol], blocks)
    return [block.full() for block in function(x, z, u, model.p_nominal, 0)]

"""The model at a pose as a linear system, for control design."""

from __future__ import annotations

import control
import numpy as np

from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.feedforward import Controller
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.model.linear_system import linear_system
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


def linearise(model: Model, pose: np.ndarray, output: str = "pose") -> control.StateSpace:
    """The state space dx' = A dx + B du, dpose = C dx + D du about the equilibrium at `pose` (n_components,), all SI; another `output`
    signal in place of the pose.

    Inputs are the drives, outputs the pose components, each by its name. Without inertia the states are the temperatures and the
    effects' states, and the force balance g(x, z, u) = 0 is eliminated: dz = -g_z^-1 (g_x dx + g_u du). With inertia velocities and
    displacements are states too, x' = f(x, z, u), z' = v; a feedback loop acts without the delay of its samples. Raises InputError
    where `pose` is no equilibrium within the device's limits.
    """
    x, z, u = equilibrium(model, pose)
    outputs, drive = model.signals[output], model.signals["drive"]
    system = linear_system(model, outputs.expr, x, z, u)
    names = [*model.x_names, *(f"displacement_{axis}" for axis in model.axes if model.inertial)]
    inputs = [f"{drive.column}{c}" for c in drive.channels]
    return control.ss(
        system.A,
        system.B,
        system.C,
        system.D,
        states=names,
        inputs=inputs,
        outputs=list(outputs.channels),
        name=model.name,
    )

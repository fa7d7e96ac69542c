"""What modes that a model with inertia leaves out do along a path that was solved without them.

A mechanism's inertia is condensed to its axes: the bodies move as they do at rest. Here the forces of the solved path move the same bodies
with their own modes (`devices.structural_model`), linear as at home, until one period of the slowest mode after the end.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import casadi as ca
import numpy as np

from ctrlgen.core.units import show
from ctrlgen.devices.structural_model import StructuralModel
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import Trace
from ctrlgen.trajectory.scenario import Scenario

NOTICED = 1e-4  # of a channel's reach along the path: less cannot be told from what a drawing does not know of masses and damping
MOST_SAMPLES = 20000  # of the path, as in `unstated_inertia`


@dataclass(frozen=True)
class UnstatedModes:
    """The modes, the channel that they move farthest for its reach, its unit, and how far [SI] along the path and after it."""

    structure: StructuralModel
    channel: str
    unit: str
    along: float
    after: float

    def sentence(self) -> str:
        """What is left out, by how much, and what to do."""
        first, own = (show(float(m.frequencies[0]), "Hz") for m in (self.structure, self.structure.condensed))
        left = (
            f"{show(self.along, self.unit)} of {self.channel} along the path and {show(self.after, self.unit)} after it"
        )
        return (
            f"internal modes are left out: the first mode of the bodies is {first}, of the model condensed to the axes {own}; with theirs "
            f"these drives leave {left}. Move slower, or shape the path for the first mode"
        )


def linear_force(model: Model, trace: Trace) -> np.ndarray:
    """(n, axes) [N] of the actuators along a `trace`, less what the device is pulled home with beside its stiffness at home."""
    d, physics = ca.SX.sym("d", trace.z.shape[1]), model.device.physics(model.device.values())
    linear = ca.jacobian(physics.restoring_force(d), d)
    beside = ca.Function("beside", [d], [physics.restoring_force(d) - ca.mtimes(ca.substitute(linear, d, 0 * d), d)])
    return np.asarray(trace.signals["force"] - beside.map(len(trace.z))(trace.z.T).full().T)


def with_internal_modes(model: Model, trace: Trace) -> np.ndarray | None:
    """(n + 1, channels) the pose of a simulation from rest at home (`model.simulation.simulate`) as it is with the modes of the bodies;
    None where the device has none, or effects act on it."""
    structure = model.device.structural_model() if model.inertial and not model.device.effect else None
    if structure is None or len(structure.mass) == structure.axes:
        return None
    force, step = linear_force(model, trace), float(trace.time[1] - trace.time[0])
    force = np.vstack([0 * force[:1], force])  # at home before the first drive
    whole, own = (m.response(force, step, model.n_states == 0)[1:] for m in (structure, structure.condensed))
    return np.asarray(trace.signals["pose"] + whole - own)


def unstated_modes(
    scenario: Scenario, model: Model, command: np.ndarray, trace: Trace, drive: np.ndarray
) -> UnstatedModes | None:
    """What internal modes do to a solved path; None where the device has none, effects act on it, the path is static or too long, or
    where it is nothing. `command` (n, channels), `trace` of the n samples, `drive` (n, drives), SI."""
    h = scenario.sample_time
    if not model.inertial or model.device.effect or h is None or len(drive) > MOST_SAMPLES:
        return None
    structure = model.device.structural_model()
    if structure is None or len(structure.mass) == structure.axes:
        return None
    force = linear_force(model, trace)
    n, rest = len(command), min(ceil(1 / (structure.frequencies[0] * h)), MOST_SAMPLES)
    force, lags = np.vstack([force, np.tile(force[-1:], (rest, 1))]), model.n_states > 0
    off = np.abs(structure.response(force, h, not lags) - structure.condensed.response(force, h, not lags))
    signal = model.signals["pose"]
    reach = np.maximum(np.ptp(trace.signals["pose"], axis=0), NOTICED * np.array(signal.scale))
    worst = int(np.argmax(off.max(axis=0) / reach))
    if off[:, worst].max() < NOTICED * reach[worst]:
        return None
    along, after = float(off[:n, worst].max()), float(off[n:, worst].max())
    return UnstatedModes(structure, signal.channels[worst], signal.units[worst], along, after)

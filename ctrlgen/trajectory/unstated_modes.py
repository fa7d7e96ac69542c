"""What modes that a model with inertia leaves out do along a path that was solved without them.

A mechanism's inertia is condensed to its axes: the bodies move as they do at rest. Here the forces of the solved path move the same bodies
with their own modes (`devices.structural_model`), linear as at home, until one period of the slowest mode after the end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil

import casadi as ca
import numpy as np

from ctrlgen.core.errors import InputError
from ctrlgen.core.units import show
from ctrlgen.devices.structural_model import StructuralModel
from ctrlgen.model.led_modes import forces_along, lowest_zero, structure_to_lead
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import Trace, first_samples, simulate
from ctrlgen.model.simulation import trace as traced
from ctrlgen.trajectory.inverse.clock import in_time
from ctrlgen.trajectory.scenario import Scenario

NOTICED = 1e-4  # of a channel's reach along the path: less cannot be told from what a drawing does not know of masses and damping
MOST_SAMPLES = 20000  # of the path, as in `unstated_inertia`


@dataclass(frozen=True)
class UnstatedModes:
    """The modes, the channel that they move farthest for its reach, its unit, and how far [SI] along the path and after it; `led` says the
    same of the same path with drives that lead these modes, None where they are led already or cannot be."""

    structure: StructuralModel
    channel: str
    unit: str
    along: float
    after: float
    led: tuple[float, float] | None = None
    leads: bool = False

    def sentence(self) -> str:
        """What is left out, by how much, and what to do."""
        first, own = (show(float(m.frequencies[0]), "Hz") for m in (self.structure, self.structure.condensed))
        left, slower = self._told(self.along, self.after, of=True), "move slower, or shape the path for the first mode"
        if self.leads:
            zero = lowest_zero(self.structure)
            below = "" if zero is None else f" and far below their lowest zero, {show(zero, 'Hz')}"
            return (
                f"internal modes are led to the fourth derivative of the path, which holds for motions slower than they are{below}: {left} "
                f"is beyond it. {slower[0].upper()}{slower[1:]}, {first}"
            )
        remedy = f"{slower[0].upper()}{slower[1:]}"
        if self.led is not None and max(self.led) < max(self.along, self.after):
            remedy = f'Write feedforward = "modes", which leaves {self._told(*self.led)}, {slower}'
        elif self.led is not None:
            remedy = f'{remedy}: it is too fast for feedforward = "modes", which leaves {self._told(*self.led)}'
        return (
            f"internal modes are left out: the first mode of the bodies is {first}, of the model condensed to the axes {own}; with theirs "
            f"these drives leave {left}. {remedy}"
        )

    def _told(self, along: float, after: float, of: bool = False) -> str:
        """'4 nm of delta_x along the path and 1 nm after it'."""
        whose = f" of {self.channel}" if of else ""
        return f"{show(along, self.unit)}{whose} along the path and {show(after, self.unit)} after it"


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


def moved_with_modes(model: Model, trace: Trace, drive: np.ndarray, closed: bool) -> Trace:
    """A `trace` of the model condensed to its axes under drives (n, n_u) that lead modes of the bodies: axes and pose as they move with
    these modes, linear as at home in what they do beside the trace; its velocities stay those of the condensed model."""
    structure = structure_to_lead(model, "pose")
    force, n, step = linear_force(model, trace), structure.axes, float(trace.time[1] - trace.time[0])
    before = structure.condensed.stiffness @ trace.z[0]  # an open path begins at rest
    whole, own = (m.motion(force, step, model.n_states == 0, closed, before) for m in (structure, structure.condensed))
    z = trace.z + whole[:, :n] - own
    moved = traced(model, trace.time, trace.x, z, drive)
    pose = moved.signals["pose"] + whole[:, n:] @ structure.output[:, n:].T
    return replace(moved, signals={**moved.signals, "pose": pose})


def followed_under(scenario: Scenario, model: Model, drives: np.ndarray, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """(n + 1, channels) [SI] of the signal that `scenario` follows, from states `x` and displacements `z` on: the `model` under `drives`
    (n, n_u), each held for a sample; where the scenario leads modes of the bodies, with these, of a closed path in periodic motion."""
    h = in_time(scenario.clock).sample_time
    reached = simulate(model, drives, h, x, z)
    if not scenario.file.leads_modes:
        return np.asarray(reached.signals[scenario.file.follow])
    if not scenario.closed:
        return moved_with_modes(model, reached, np.vstack([drives, drives[-1:]]), closed=False).signals["pose"]
    n = len(drives)
    pose = moved_with_modes(model, first_samples(reached, n), drives, closed=True).signals["pose"]
    return np.vstack([pose, pose[:1]])


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
    off = structure.response(force, h, not lags) - structure.condensed.response(force, h, not lags)
    if scenario.file.leads_modes:  # the trace has them, and the condensed model rests after it
        off[:n] = trace.signals["pose"] - command
        before = structure.condensed.stiffness @ trace.z[0]
        q = structure.motion(force, h, not lags, before=before)
        off[n:] = q[n:] @ structure.output.T - structure.at_rest(force[-1])
    off = np.abs(off)
    signal = model.signals["pose"]
    reach = np.maximum(np.ptp(trace.signals["pose"], axis=0), NOTICED * np.array(signal.scale))
    worst = int(np.argmax(off.max(axis=0) / reach))
    if off[:, worst].max() < NOTICED * reach[worst]:
        return None
    along, after = _largest(off[:, worst], n)
    led = None if scenario.file.leads_modes else _if_led(scenario, model, structure, rest, worst)
    channel, unit = signal.channels[worst], signal.units[worst]
    return UnstatedModes(structure, channel, unit, along, after, led, scenario.file.leads_modes)


def _largest(off: np.ndarray, n: int) -> tuple[float, float]:
    """Of (n + rest,) what is largest along the path and after it."""
    return float(off[:n].max()), float(off[n:].max())


def _if_led(
    scenario: Scenario, model: Model, structure: StructuralModel, rest: int, channel: int
) -> tuple[float, float] | None:
    """What drives that lead the modes leave in a channel [SI] along the same path and after it, linear as at home, of forces without lag;
    None where they cannot be led."""
    file = scenario.file.model_copy(update={"feedforward": "modes"})
    problem = replace(scenario, file=file).bind(model)
    try:
        structure_to_lead(model, problem.follow)
        asked, middle = problem.asked, problem.asked_after(0.5)
    except InputError:
        return None
    own = structure.condensed
    at_end = own.stiffness @ np.linalg.solve(own.output, asked[-1])
    force = np.vstack([forces_along(structure, middle.stacked()), np.tile(at_end, (rest, 1))])
    wanted = np.vstack([asked, np.tile(asked[-1:], (rest, 1))])
    reached = structure.response(force, in_time(scenario.clock).sample_time, held=True)
    return _largest(np.abs(reached - wanted)[:, channel], len(asked))

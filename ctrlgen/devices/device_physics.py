"""The physics of each kind of device, as symbolic maps from drive to pose."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, Literal

import casadi as ca

from ctrlgen.devices.limit import Limit
from ctrlgen.devices.signal import AxisSignal, Signal


@dataclass(frozen=True)
class FeedbackLoop:
    """A position controller that is part of the device: computed at every sample, its output held until the next.

    `control_law` (r, y, v, x) gives the amplifier's drive, shown as `command`; r is the reference, y what the loop
    `measures` (the reading, with all its errors, or the displacement), v the velocity, x the controller's states,
    whose rates are `rates` (x, r - y).
    """

    control_law: Callable[[ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]
    rates: Callable[[ca.SX, ca.SX], ca.SX]
    command: AxisSignal
    measures: Literal["reading", "displacement"] = "reading"


@dataclass(frozen=True)
class SensedPoints:
    """What sensors see beside the pose: names, units of reports and typical sizes [SI] of the readings, and their values `at` the
    displacement d; of a stage with inertia `per_acceleration` (readings, n_axes) more."""

    channels: tuple[str, ...]
    units: tuple[str, ...]
    scale: tuple[float, ...]
    at: Callable[[ca.SX], ca.SX]
    per_acceleration: ca.SX | ca.DM | None = None


@dataclass(frozen=True, kw_only=True)
class DevicePhysics:
    """The physics of one device, as symbolic maps from drive to pose; `ctrlgen.model.assembly` joins them to a model.

    This base holds what every kind of device has. Each map takes and gives SX column vectors in SI; there is one
    displacement d for each of the `axes`, and one pose component for each of the `components`. `state` is the signal
    of the actuators' states x, whose values at `rest` may hold free parameters; None where they have no memory.
    `restoring_force` (d) pulls the axes home; `restoring_force_parts` (d) gives its parts by name for plots.
    `limits` is given the namespace drive, command, state, force, displacement, mechanism_displacement of expressions.
    `displacement_scale` and `force_scale` are typical sizes in SI, in the units `travel_unit` and `force_unit`.
    `documented`: for a map, the functions whose docstrings state its equation and source; the generated C repeats them.
    `bipolar` says whether the drive has both signs. `rate_limits` are on the change of drives by time (`rate_limit`).
    `drive_weights` say how much each drive counts where there are more of them than axes, all the same where it is empty.
    The readings are the pose, and behind it those of the `sensed` points. `second_order_kinematics` (d) is what finite
    rotations add to the pose of a mechanism whose `pose` is of first order, None where nothing states it.
    """

    axes: tuple[str, ...]
    components: tuple[str, ...]
    pose_units: tuple[str, ...]
    pose_scale: tuple[float, ...]
    drive: Signal
    displacement_scale: float
    force_scale: float
    restoring_force: Callable[[ca.SX], ca.SX]
    pose: Callable[[ca.SX], ca.SX]
    limits: Callable[[SimpleNamespace], Sequence[Limit]]
    rate_limits: tuple[Limit, ...] = ()
    drive_weights: tuple[float, ...] = ()
    state: Signal | None = None
    rest: tuple[float | ca.SX, ...] = ()
    restoring_force_parts: Callable[[ca.SX], dict[str, ca.SX]] = lambda d: {}
    travel_unit: str = "um"
    force_unit: str = "N"
    bipolar: bool = True
    documented: Mapping[str, Sequence[Callable[..., Any]]] = field(default_factory=dict)
    sensed: SensedPoints | None = None
    second_order_kinematics: Callable[[ca.SX], ca.SX] | None = None

    @property
    def readings(self) -> tuple[tuple[str, ...], tuple[str, ...], tuple[float, ...]]:
        """Names, units and typical sizes of all readings."""
        pose, more = (self.components, self.pose_units, self.pose_scale), self.sensed
        return pose if more is None else (pose[0] + more.channels, pose[1] + more.units, pose[2] + more.scale)


@dataclass(frozen=True, kw_only=True)
class BalancedPhysics(DevicePhysics):
    """A stage without inertia: the displacement is where the forces balance, force(u, x, d) = restoring_force(d).

    The states follow x' = rates(x, w), w = heating_power(u); `power` shows w where it is a heater's power, and is None
    where the device has no heaters. `force_unit` is that of the balance: a length where the drive commands the
    displacement itself.
    `tangent_compliance` (d) is by how much less the stages yield to the links' load at d than at home.
    """

    force: Callable[[ca.SX, ca.SX, ca.SX], ca.SX]
    rates: Callable[[ca.SX, ca.SX], ca.SX] = lambda x, heat: ca.SX(0, 1)
    heating_power: Callable[[ca.SX], ca.SX] = lambda u: u
    power: AxisSignal | None = None
    tangent_compliance: Callable[[ca.SX], ca.SX] | None = None


@dataclass(frozen=True, kw_only=True)
class InertialPhysics(DevicePhysics):
    """A stage with inertia: mass d'' = F - restoring_force(d) - damping_force(d'), `mass` one number an axis or a matrix (n_axes, n_axes).

    `dynamics` (u, x, d, d') gives F and the rates x' of the actuators' states. With a `feedback` loop u is its
    reference and the states are the loop's; `dynamics` is then given the amplifier's drive and its rates are not read.
    """

    mass: tuple[float | ca.SX, ...] | ca.SX | ca.DM
    dynamics: Callable[[ca.SX, ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]]
    damping_force: Callable[[ca.SX], ca.SX] | None = None
    feedback: FeedbackLoop | None = None


@dataclass(frozen=True, kw_only=True)
class ImposedPhysics(DevicePhysics):
    """A stage whose motion is imposed and the force that takes is read.

    With n axes u (3 n,) holds their displacements, then their velocities, then their accelerations (`imposed_motion`).
    The reading (n,), one for each axis, is force(u, d) + restoring_force(d).
    """

    force: Callable[[ca.SX, ca.SX], ca.SX]


def imposed_motion(axes: tuple[str, ...] | None, unit: str, scale: tuple[float, ...]) -> Signal:
    """The drive of `ImposedPhysics`: the channels 'position', 'velocity' and 'acceleration' of one axis without a name (None),
    or 'q1_position', ... of axes with names; `unit` is that of the displacements, `scale` (3 n,) in SI."""
    kinds = {"position": unit, "velocity": f"{unit}/s", "acceleration": f"{unit}/s^2"}
    names = [kind if axis is None else f"{axis}_{kind}" for kind in kinds for axis in axes or (None,)]
    units = [written for written in kinds.values() for _ in axes or (None,)]
    return Signal("motion", "imposed motion", tuple(names), tuple(units), "", ca.SX.sym("u", len(names)), scale)

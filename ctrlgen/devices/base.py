"""The parts of every device description: signals, limits, the physics of each kind of device, quantities in SI."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import casadi as ca
from pydantic import Field, model_validator

from ctrlgen.core.units import Quantity
from ctrlgen.devices.run_time import RunTime, RunTimeConstant, run_time_constants
from ctrlgen.devices.section import Section
from ctrlgen.devices.sensor import AnySensor
from ctrlgen.effects import Effect, EffectTable


@dataclass(frozen=True)
class Signal:
    """A named vector of the model.

    `label` is its name in reports, `channels` the names of its components, `units` those of reports, `column` the prefix
    of its columns in a CSV file, `expr` (n,) the symbolic value in SI, `scale` a typical size of each channel in SI.
    """

    name: str
    label: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    column: str
    expr: ca.SX
    scale: tuple[float, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """CSV column names with units, such as 'd_1X [um]'."""
        return tuple(f"{self.column}{c} [{u}]" for c, u in zip(self.channels, self.units, strict=True))


@dataclass(frozen=True, eq=False)
class Limit:
    """lower <= expr <= upper for each channel, SI; None where there is no bound.

    A limit on an expression that is not a variable of the model itself must be convex in the displacement, never negative,
    and zero at home: the controller keeps it by scaling the displacement toward home. A device may state a bound in terms of its
    numbers, so that it follows one that is free; a model has the number.

    `reserve` [SI]: by how much the lower and the upper bound of the device have been tightened for what is not known exactly.
    """

    name: str
    label: str
    channels: tuple[str, ...]
    unit: str
    expr: ca.SX
    lower: float | None = None
    upper: float | None = None
    reserve: tuple[float, float] = (0.0, 0.0)

    def tightened(self, below: float, above: float) -> Limit:
        """The same with its bounds moved inward by `below` and `above`, which are added to what has been reserved."""
        lower = None if self.lower is None else self.lower + below
        upper = None if self.upper is None else self.upper - above
        return replace(self, lower=lower, upper=upper, reserve=(self.reserve[0] + below, self.reserve[1] + above))

    def described(self, bound: float) -> float:
        """The device's own bound, of which `bound` is the tightened one."""
        return bound - self.reserve[0] if bound == self.lower else bound + self.reserve[1]


def rate_limit(drive: Signal, i: int, low: float, high: float, unit: str) -> Limit:
    """low <= du/dt <= high [SI] of component i of the drive: `expr` is the drive itself, whose change by time is limited."""
    name = drive.channels[i]
    return Limit(f"rate_{name}", f"rate of {name}", (name,), unit, drive.expr[i], low, high)


@dataclass(frozen=True)
class AxisSignal:
    """How a signal with one channel an axis is shown: label, unit, prefix of its CSV columns, typical size in SI."""

    label: str
    unit: str
    column: str
    scale: float

    def signal(self, name: str, axes: tuple[str, ...], expr: ca.SX) -> Signal:
        """The signal `name` with the value `expr` (n_axes,)."""
        n = len(axes)
        return Signal(name, self.label, axes, (self.unit,) * n, self.column, expr, (self.scale,) * n)


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
    displacement d."""

    channels: tuple[str, ...]
    units: tuple[str, ...]
    scale: tuple[float, ...]
    at: Callable[[ca.SX], ca.SX]


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


class Device(Section):
    """Base of every device: one subclass in one file, chosen by `kind` in the device file."""

    library: ClassVar[dict[str, type[Device]]] = {}

    kind: str
    """Chooses the equations of the device."""
    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    """A C identifier in lower case; recordings and scenarios name the device by it, and generated functions bear it."""
    title: str
    """The device in words, for reports."""
    source: str
    """Where the numbers come from: a paper, a data sheet, a measurement."""
    effect: tuple[EffectTable, ...] = ()
    """`[[effect]]` tables: physical effects that the kind leaves out; each adds one term to the model."""
    sensor: tuple[AnySensor, ...] = ()
    """`[[sensor]]` tables: what reads the channels of the pose. They do not enter the model; `ctrlgen check` gives
    their resolution and range, `ctrlgen.simulate_sensors` their recordings.
    """
    run_time: RunTime | None = None
    """`[run_time]`: which of these numbers the generated controller is given when it starts, because they differ between specimens or
    drift. Without it every number is compiled in.
    """

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        kinds = getattr(cls.model_fields["kind"].annotation, "__args__", ())
        if kinds:  # a device that is not read from a file has no name for its kind
            Device.library[kinds[0]] = cls

    @model_validator(mode="after")
    def _run_time_numbers(self) -> Device:
        run_time_constants(self)
        return self

    @property
    def given_at_start(self) -> tuple[RunTimeConstant, ...]:
        """The numbers that the generated controller is given when it starts."""
        return run_time_constants(self)

    def physics(self, p: SimpleNamespace) -> DevicePhysics:
        """The device's physics with the values `p` (SI numbers, or symbols where they are free)."""
        raise NotImplementedError

    def remarks(self) -> list[str]:
        """Remarks on the description for the reader, such as an equation that is used outside its range."""
        return []

    def quantities(self) -> Iterator[tuple[str, Quantity]]:
        """Every number of the device with its dotted path, such as 'struts.wire_length'."""
        yield from _leaves(self, "")

    def called(self, path: str) -> str:
        """The path of a number, with the name, or the kind, of its table where that stands in a list: 'actuator[0].gain (px)'."""
        node: Any = self
        name = ""
        for key, index in re.findall(r"(\w+)|\[(\d+)\]", path):
            node = getattr(node, key, None) if key else node[int(index)] if isinstance(node, tuple) else None
            if index:
                name = next(
                    (own for own in (getattr(node, key, None) for key in ("name", "kind")) if isinstance(own, str)),
                    name,
                )
        return f"{path} ({name})" if name else path

    def values(self, free: dict[str, ca.SX] | None = None) -> SimpleNamespace:
        """SI numbers as nested namespaces; `free` gives symbols for some paths in place of their numbers."""
        return si_namespace(self, "", free or {})


def _leaves(node: Any, prefix: str) -> Iterator[tuple[str, Quantity]]:
    if isinstance(node, Quantity):
        yield prefix, node
    elif isinstance(node, Section):
        for key in type(node).model_fields:
            yield from _leaves(getattr(node, key), f"{prefix}.{key}" if prefix else key)
    elif isinstance(node, Effect):
        for key, value in node.values.items():
            yield f"{prefix}.{key}", value
    elif isinstance(node, tuple):
        for index, member in enumerate(node):
            yield from _leaves(member, f"{prefix}[{index}]")


def si_namespace(node: Any, prefix: str, free: dict[str, ca.SX]) -> Any:
    """SI numbers of a section as nested namespaces; `free` (path, which begins with `prefix` -> symbol) replaces some of them."""
    if isinstance(node, Quantity):
        return free.get(prefix, node.si)
    if isinstance(node, Section):
        return SimpleNamespace(
            **{
                key: si_namespace(getattr(node, key), f"{prefix}.{key}" if prefix else key, free)
                for key in type(node).model_fields
            }
        )
    if isinstance(node, Effect):
        return SimpleNamespace(**{k: free.get(f"{prefix}.{k}", q.si) for k, q in node.values.items()})
    if isinstance(node, tuple):
        return tuple(si_namespace(member, f"{prefix}[{i}]", free) for i, member in enumerate(node))
    return node

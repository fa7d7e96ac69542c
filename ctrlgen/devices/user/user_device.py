"""`user_device`: a device whose physics is given by its user, as functions of vectors with named components.

    mass q'' = force(u, x, d, v) - restoring_force(d) - damping_force(v)   or   q'' = acceleration(u, x, d, v);   x' = rates(u, x, d, v)
    reading = pose(d)

or, where the motion is imposed and the force read,   reading = needed_force(d, v, a)

u drives, x the user's states, d displacements of the axes, v their velocities, a their accelerations, p parameters; all SI.
"""

# Without postponed annotations: `Required` is read when `UserArguments` is made.
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar, Required, TypedDict, Unpack

import casadi as ca
import numpy as np
from pydantic import create_model

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import validate
from ctrlgen.core.one_or_several import several
from ctrlgen.core.units import In, Quantity, same_dimension, written_unit
from ctrlgen.devices.base import Device
from ctrlgen.devices.device_physics import BalancedPhysics, DevicePhysics, ImposedPhysics, InertialPhysics
from ctrlgen.devices.section import Section
from ctrlgen.devices.user.arguments import PLACEHOLDER, SECTIONS, ArgumentReader
from ctrlgen.devices.user.ports import Law, Ports, suggestion
from ctrlgen.devices.user.user_physics import ARGUMENTS, PhysicsBuilder, UserDescription


class UserNumbers(Section):
    """A table of a user's parameters."""


class UserDevice(Device):
    """A device whose physics is its user's functions; made by `user_device`, never read from a file."""

    kind: str = "user"
    description: ClassVar[UserDescription]

    def physics(self, p: SimpleNamespace) -> DevicePhysics:
        """The user's functions with the values `p`. Raises InputError with every fault of the laws."""
        given = self.description
        given.faults.clear()
        imposed = "needed_force" in given.laws
        nominal, builder = (PhysicsBuilder(given, _numbers(given, values)) for values in (self.values(), p))
        size = given.force.si if given.force else nominal.imposed_size() if imposed else nominal.size()
        physics = builder.imposed(size) if imposed else builder.physics(size)
        if given.faults:
            raise InputError(self.name, given.faults)
        return physics

    def __eq__(self, other: object) -> bool:
        """Two devices are equal where they come from one call of `user_device` and their numbers are equal: what its functions read
        may change between calls."""
        if not isinstance(other, UserDevice):
            return False
        return self._value() == other._value()

    def __hash__(self) -> int:
        return hash(self._value())

    def _value(self) -> tuple[Any, ...]:
        plain = (getattr(self, key) for key in Device.model_fields)
        return self.description.identity, self._told_in, *plain, *self.quantities()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles the user's functions, which must be picklable, and the values; the class is made again from them."""
        sections = {s: dict(getattr(self, s)) for s in SECTIONS.values() if s in type(self).model_fields}
        plain = {key: getattr(self, key) for key in Device.model_fields}
        return _unpickled, (self.description, plain, sections, dict(self._told_in))


def _numbers(description: UserDescription, p: SimpleNamespace) -> Ports:
    """The parameters as one vector with the user's names."""
    values = {name: getattr(getattr(p, SECTIONS[domain]), name) for name, domain in description.domains.items()}
    return Ports("p", tuple(values), ca.vertcat(ca.SX(0, 1), *map(ca.SX, values.values())))


def _device_class(description: UserDescription) -> type[UserDevice]:
    """A class of device with one section of parameters for each domain."""
    fields: dict[str, Any] = {}
    for domain in dict.fromkeys(description.domains.values()):
        numbers: dict[str, Any] = {
            n: (Annotated[Quantity, In(description.units[n])], ...)
            for n, where in description.domains.items()
            if where == domain
        }
        section = create_model(f"{domain.title()}Numbers", __base__=UserNumbers, **numbers)
        section.domain = domain
        fields[SECTIONS[domain]] = (section, ...)
    device_class = create_model("NamedUserDevice", __base__=UserDevice, **fields)
    device_class.description = description
    return device_class


def _unpickled(
    description: UserDescription,
    plain: dict[str, Any],
    sections: dict[str, dict[str, Quantity]],
    told_in: dict[str, str],
) -> Device:
    return _device_class(description).model_validate({**plain, **sections}).told_in(told_in)


Size = str | tuple[str, str]  # the largest size, "24 V", or a range, ("0 V", "150 V")


class UserArguments(TypedDict, total=False):
    """What `user_device` takes beside the name.

    A law takes any of u, x, d, v, p as arguments of these names (see the module) and returns one number for each axis, state or
    reading: a vector, a list, or {name: number}. It may be a `ca.Function` with inputs of these names.
    """

    parameters: Required[Mapping[str, Any]]
    """"0.5 kg", ("0.5 kg", sd) or {value, sd, source, domain} by name: the diagnosis takes a number with an sd as uncertain, one
    without as exact until the data contradict it; its path is 'mechanism.NAME'."""
    axes: Mapping[str, Size]
    """Displacements with their largest size, {"x": "50 um"}, or range: they are kept within. Left out where nothing moves, as in a tank or
    an oven: the states that are read, by `reading`, or all, are then the axes, and no force is given."""
    drive: Mapping[str, Size]
    """Drives with their largest size, {"motor": "24 V"}, or range, {"stack": ("0 V", "150 V")}: they are kept within."""
    drive_rate: Mapping[str, Size]
    """How fast a drive may change, {"stack": "5 V/ms"}, or down and up, ("-2 V/ms", "5 V/ms")."""
    drive_weight: Mapping[str, float]
    """Of more drives than axes those with the least sum of this (1 where it is not given) times the square of the drive as a share
    of its range move the axes."""
    force: Law
    """force(u, x, d, v, p) on each axis."""
    restoring_force: Law
    """restoring_force(d, p), which pulls each axis home."""
    damping_force: Law
    """damping_force(v, p), against the motion of each axis."""
    mass: Law
    """mass(p) of each axis; without it the axes have no inertia."""
    acceleration: Law
    """acceleration(u, x, d, v, p) of each axis, in place of the three forces."""
    state: Mapping[str, Size]
    """The user's states with their typical size, {"current": "1 A"}, or the range that they are kept within."""
    rates: Law
    """rates(u, x, d, v, p) of the states."""
    reading: Mapping[str, str]
    """Readings with their largest size; by default the axes."""
    pose: Law
    """pose(d, p), the readings; by default the displacements."""
    needed_force: Law
    """needed_force(d, v, a, p): the motion of the axes is imposed and the force that it takes is read. There is then no drive and
    no other law."""
    speed: Mapping[str, str]
    """The largest speed of each axis whose motion is imposed."""
    limits: Mapping[str, tuple[Law, str]]
    """Limits of any expression, {"stress": (lambda d, p: p.k * d.x, "300 MPa")}: its magnitude stays below the value."""
    force_size: str
    """The typical force with its unit, by default that of the full drive in N, or N*m."""
    title: str
    """The device in words; by default its name."""
    source: str
    """Where the model comes from."""
    machine: Mapping[str, Any]
    """What it is made of, as the `[machine]` table states it."""
    effect: Mapping[str, Any] | Sequence[Mapping[str, Any]]
    """One effect or several, as `[[effect]]` tables state them."""


def user_device(name: str, **given: Unpack[UserArguments]) -> Device:
    """A device from the user's functions; `UserArguments` says what may be given. Raises InputError with every fault."""
    known, needed = (
        UserArguments.__annotations__,
        UserArguments.__required_keys__ | (set() if "state" in given else {"axes"}),
    )
    if wrong := [key for key in given if key not in known]:
        raise TypeError(f"user_device() has no argument {wrong[0]!r}; {suggestion(wrong[0], tuple(known))}")
    if missing := sorted(needed - given.keys()):
        raise TypeError(f"user_device() needs the arguments {', '.join(missing)}")
    if "axes" not in given:
        given = _of_process(given)
    read = ArgumentReader(name)
    tables, domains, units = read.parameters(given["parameters"])
    imposed = given.get("needed_force") is not None
    vectors = {
        "drive": given.get("drive"),
        "axes": given["axes"],
        "speed": given.get("speed"),
        "state": given.get("state"),
    }
    sizes = {where: read.ports(where, {} if names is None else names) for where, names in vectors.items()}
    reading = given.get("reading")
    sizes["reading"] = sizes["axes"] if reading is None else read.ports("reading", reading)
    for where in ("axes", "speed") if imposed else ("drive", "axes"):
        if not sizes[where]:
            read.faults.append(Fault(where, "is empty; name at least one"))
    sound = {axis: q for axis, q in sizes["axes"].items() if q is not PLACEHOLDER}
    first = next(iter(sound.values()), None)
    for axis, q in sound.items():
        if first and not same_dimension(written_unit(q.text), written_unit(first.text)):
            read.faults.append(
                Fault(f"axes.{axis}", f"{q.text!r} is not of the dimension of {first.text!r}; all axes are")
            )
    stated = {law: given.get(law) for law in ARGUMENTS}
    if imposed:
        beside = ("drive", "drive_rate", "drive_weight", "state", "reading")
        read.imposed(stated, {key: given.get(key) for key in beside}, sizes)
    elif given.get("speed") is not None:
        read.faults.append(
            Fault("speed", "is for an imposed motion, which has needed_force; give that as well, or leave speed out")
        )
    rates_of_drives = read.drive_rates(given.get("drive_rate") or {}, sizes["drive"])
    weights = read.weights(given.get("drive_weight") or {}, sizes)
    expressions = read.limits(given.get("limits") or {})
    laws = read.laws(stated, sizes["state"], reading is None or list(reading) == list(given["axes"]))
    size = given.get("force_size")
    description = UserDescription(
        name,
        drive=sizes["drive"],
        axes=sizes["axes"],
        state=sizes["state"],
        reading=sizes["reading"],
        domains=domains,
        units=units,
        laws=laws,
        force=None if size is None else read.ports("force_size", {"force_size": size})["force_size"],
        ranges=read.ranges,
        limits=expressions,
        speed=sizes["speed"],
        drive_rates=rates_of_drives,
        weights=weights,
    )
    plain = {
        "title": given.get("title") or name,
        "source": given.get("source", "a user's model"),
        "machine": given.get("machine"),
    }
    return _validated(
        description, tables, {"name": name, **plain, "effect": tuple(several(given.get("effect", ())))}, read
    )


@dataclass(frozen=True)
class _StatesAsForce:
    """The states of these names: with `_AxesAsForce` each axis is at its state, d = x."""

    names: tuple[str, ...]

    def __call__(self, x: Any) -> dict[str, Any]:
        return {name: getattr(x, name) for name in self.names}


@dataclass(frozen=True)
class _AxesAsForce:
    """The displacements of these axes."""

    names: tuple[str, ...]

    def __call__(self, d: Any) -> dict[str, Any]:
        return {name: getattr(d, name) for name in self.names}


def _of_process(given: UserArguments) -> UserArguments:
    """The arguments of a device in which nothing moves: its states that are read are its axes, in balance where they are their states.

    Raises TypeError where it has no states, or laws of a motion.
    """
    state, reading = given.get("state"), given.get("reading")
    beside = [law for law in ARGUMENTS if law not in ("rates", "pose") and given.get(law) is not None]
    if not isinstance(state, Mapping) or beside:
        what = (
            f"{beside[0]} is of axes; name them"
            if beside
            else "name them, or the states of a device in which nothing moves"
        )
        raise TypeError(f"user_device() needs the arguments axes: {what}")
    names = tuple(name for name in (reading or state) if name in state)
    if not names:
        raise TypeError(f"user_device() needs axes, or readings that are states: {', '.join(state)}")
    axes = {name: state[name] for name in names}
    largest = axes[names[0]]
    size = largest if isinstance(largest, str) else largest[1]
    return {
        "force_size": size,
        **given,
        "axes": axes,
        "force": _StatesAsForce(names),
        "restoring_force": _AxesAsForce(names),
    }


def _validated(
    description: UserDescription, tables: dict[str, Any], plain: dict[str, Any], read: ArgumentReader
) -> Device:
    """The device; raises InputError with the faults of arguments, laws, numbers and effects together."""
    device_class, device = _device_class(description), None
    sections: dict[str, dict[str, Any]] = {SECTIONS[domain]: {} for domain in description.domains.values()}
    for name, domain in description.domains.items():
        sections[SECTIONS[domain]][name] = tables[name]
    for effects in ((), plain["effect"]):  # the laws are checked even where an effect is wrong
        try:
            device = validate(device_class, {"kind": "user", **plain, "effect": effects, **sections}, description.name)
            complete = description.drive or description.axes.keys() == description.speed.keys()
            if description.axes and complete and not effects:
                _check_at_home(device, read)
        except InputError as error:
            read.faults += [fault for fault in error.faults if fault not in read.faults]
    if read.faults or device is None:
        raise InputError(f"user_device {description.name!r}", read.faults)
    return device


def _check_at_home(device: UserDevice, read: ArgumentReader) -> None:
    """Collects the laws that are not finite at home and at rest, and masses that are not above zero."""
    physics = device.physics(device.values())
    n = len(physics.axes)
    if isinstance(physics, ImposedPhysics):
        at = ca.Function("home", [physics.drive.expr], [physics.force(physics.drive.expr, ca.SX.zeros(n, 1))])(0).full()
        if not np.all(np.isfinite(at)):
            read.faults.append(
                Fault("needed_force", f"is {at.ravel()} at home (all arguments zero); it must be finite there")
            )
        return
    d, v, u = ca.SX.sym("d", n), ca.SX.sym("v", n), physics.drive.expr
    x = ca.SX(0, 1) if physics.state is None else physics.state.expr
    if isinstance(physics, InertialPhysics):
        force, rates = physics.dynamics(u, x, d, v)
    else:
        assert isinstance(physics, BalancedPhysics)
        force, rates = physics.force(u, x, d), physics.rates(x, u)
    laws = {"force": force, "rates": rates, "restoring_force": physics.restoring_force(d), "pose": physics.pose(d)}
    if isinstance(physics, InertialPhysics):
        laws |= {"damping_force": physics.damping_force(v)} if physics.damping_force else {}
        laws["mass"] = ca.vertcat(*physics.mass)
    # Kept online by scaling the displacement toward home
    named = {
        f"limits.{limit.name}": limit.expr
        for limit in physics.limits(SimpleNamespace(drive=u, displacement=d, mechanism_displacement=d))
        if limit.name in device.description.limits
    }
    home = ca.Function("home", [u, x, d, v], [*laws.values(), *named.values()])(0, 0, 0, 0)
    for law, value in zip([*laws, *named], home, strict=True):
        numbers = np.array(value).ravel()
        if not np.all(np.isfinite(numbers)):
            read.faults.append(Fault(law, f"is {numbers} at home (all arguments zero); it must be finite there"))
        elif law in named and np.any(numbers != 0):
            what = f"is {numbers[0]:g} at home, from where the controller keeps it; write it so that it is zero there"
            read.faults.append(Fault(law, what))
        elif law == "mass" and np.any(numbers <= 0):
            read.faults.append(Fault(law, f"is {numbers}; it must be above zero"))

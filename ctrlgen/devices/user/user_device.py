"""`user_device`: a device whose physics is given by its user, as functions of vectors with named components.

    mass q'' = force(u, x, d, v) - restoring_force(d) - damping_force(v)   or   q'' = acceleration(u, x, d, v);   x' = rates(u, x, d, v)
    reading = pose(d)

or, where the motion is imposed and the force read,   reading = needed_force(d, v, a)

u drives, x the user's states, d displacements of the axes, v their velocities, a their accelerations, p parameters; all SI.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar

import casadi as ca
import numpy as np
from pydantic import create_model

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import validate
from ctrlgen.core.units import In, Quantity, same_dimension, written_unit
from ctrlgen.devices.base import BalancedPhysics, Device, DevicePhysics, ImposedPhysics, InertialPhysics
from ctrlgen.devices.section import Section
from ctrlgen.devices.user.arguments import PLACEHOLDER, SECTIONS, ArgumentReader
from ctrlgen.devices.user.ports import Law, Ports
from ctrlgen.devices.user.user_physics import PhysicsBuilder, UserDescription


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
        """Two devices are equal where their functions and their numbers are: each has a class of its own."""
        return isinstance(other, UserDevice) and self._value() == other._value()

    def __hash__(self) -> int:
        return hash(self._value()[1:])

    def _value(self) -> tuple[Any, ...]:
        plain = (getattr(self, key) for key in Device.model_fields)
        return self.description, *plain, *self.quantities()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles the user's functions, which must be picklable, and the values; the class is made again from them."""
        sections = {s: dict(getattr(self, s)) for s in SECTIONS.values() if s in type(self).model_fields}
        plain = {key: getattr(self, key) for key in Device.model_fields}
        return _unpickled, (self.description, plain, sections)


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
    description: UserDescription, plain: dict[str, Any], sections: dict[str, dict[str, Quantity]]
) -> UserDevice:
    return _device_class(description).model_validate({**plain, **sections})


def user_device(
    name: str,
    *,
    parameters: Mapping[str, Any],
    axes: Mapping[str, str | tuple[str, str]],
    drive: Mapping[str, str | tuple[str, str]] | None = None,
    drive_rate: Mapping[str, str | tuple[str, str]] | None = None,
    drive_weight: Mapping[str, float] | None = None,
    force: Law | None = None,
    restoring_force: Law | None = None,
    damping_force: Law | None = None,
    mass: Law | None = None,
    acceleration: Law | None = None,
    state: Mapping[str, str | tuple[str, str]] | None = None,
    rates: Law | None = None,
    reading: Mapping[str, str] | None = None,
    pose: Law | None = None,
    needed_force: Law | None = None,
    speed: Mapping[str, str] | None = None,
    limits: Mapping[str, tuple[Law, str]] | None = None,
    force_size: str | None = None,
    title: str = "",
    source: str = "a user's model",
    effect: Sequence[Mapping[str, Any]] = (),
) -> Device:
    """A device from the user's functions.

    `drive`, `axes`, `state` and `reading` name the components of a vector with their largest size, {"motor": "24 V"};
    the readings are the axes unless `pose` is given. Drives and axes are kept within plus and minus that size, or within a range
    given as a pair, {"stack": ("0 V", "150 V")}; states only within a range. `drive_rate` limits how fast a drive may change,
    {"stack": "5 V/ms"}, or down and up, ("-2 V/ms", "5 V/ms"). Of more drives than axes those with the least sum of `drive_weight`
    (1 where it is not given) times the square of the drive as a share of its range move the axes. `limits` are of any
    expression, {"stress": (lambda d, p: p.k * d.x, "300 MPa")}: its magnitude stays below the value. `parameters` are "0.5 kg",
    ("0.5 kg", sd) or
    {value, sd, source, domain}: the diagnosis takes a number with an sd as uncertain, one without as exact until the data
    contradict it; its path is 'mechanism.NAME'. A law takes any of u, x, d, v, p as arguments of these names (see the
    module) and returns one number for each axis, state or reading: a vector, a list, or {name: number}. It may be a
    `ca.Function` with inputs of these names. Without `mass` the axes have no inertia. With `needed_force` the motion of the axes is
    imposed, up to the `speed` of each, and the force that it takes is read: there is then no drive and no other law.
    `force_size` is the typical force with its unit, by default that of the full drive in N, or N*m. Raises InputError with
    every fault.
    """
    read = ArgumentReader(name)
    tables, domains, units = read.parameters(parameters)
    imposed = needed_force is not None
    ports = {"drive": drive or {}, "axes": axes, "speed": speed or {}, "state": {} if state is None else state}
    sizes = {where: read.ports(where, given) for where, given in ports.items()}
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
    given = {
        "force": force, "restoring_force": restoring_force, "damping_force": damping_force, "mass": mass, "acceleration": acceleration,
        "rates": rates, "pose": pose, "needed_force": needed_force,
    }  # fmt: skip
    if imposed:
        others = {
            "drive": drive,
            "drive_rate": drive_rate,
            "drive_weight": drive_weight,
            "state": state,
            "reading": reading,
        }
        read.imposed(given, others, sizes)
    elif speed is not None:
        read.faults.append(Fault("speed", "is of an imposed motion; give needed_force, or leave it out"))
    rates_of_drives, weights = (
        read.drive_rates(drive_rate or {}, sizes["drive"]),
        read.weights(drive_weight or {}, sizes),
    )
    expressions = read.limits({} if limits is None else limits)
    laws = read.laws(given, sizes["state"], reading is None or list(reading) == list(axes))
    size = None if force_size is None else read.ports("force_size", {"force_size": force_size})["force_size"]
    description = UserDescription(
        name, drive=sizes["drive"], axes=sizes["axes"], state=sizes["state"], reading=sizes["reading"], domains=domains, units=units,
        laws=laws, force=size, ranges=read.ranges, limits=expressions,
        speed=sizes["speed"], drive_rates=rates_of_drives, weights=weights,
    )  # fmt: skip
    return _validated(
        description, tables, {"name": name, "title": title or name, "source": source, "effect": tuple(effect)}, read
    )


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
    named = {  # kept online by scaling the displacement toward home
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


__all__ = ["UserDevice", "user_device"]

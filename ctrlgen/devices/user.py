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
from pydantic import ConfigDict, create_model

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import validate
from ctrlgen.core.units import In, Quantity, read_quantity, same_dimension, to_si, written_unit
from ctrlgen.devices.base import BalancedPhysics, Device, DevicePhysics, ImposedPhysics, InertialPhysics
from ctrlgen.devices.ports import Law, Ports
from ctrlgen.devices.section import Section
from ctrlgen.devices.user_physics import PhysicsBuilder, UserDescription

SECTIONS = {
    "mechanism": "mechanism",
    "stage": "stage",
    "actuator": "actuator",
    "sensor": "sensing",
}  # domain of a parameter -> section of the device
PLACEHOLDER = Quantity(1.0, "1")  # for a quantity that cannot be read, so that the rest is checked too
NEED_MASS = ("damping_force", "acceleration")
NO_SOURCE = ConfigDict(use_attribute_docstrings=False)  # classes made at run time: looking for their text takes 30 ms


class UserNumbers(Section):
    """A table of a user's parameters."""

    model_config = NO_SOURCE


class UserDevice(Device):
    """A device whose physics is its user's functions; made by `user_device`, never read from a file."""

    model_config = NO_SOURCE

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


class _ArgumentReader:
    """Reads the arguments of `user_device` and collects their faults."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.faults: list[Fault] = []
        self.ranges: dict[tuple[str, str], tuple[float, float]] = {}

    def ports(self, where: str, given: Mapping[str, Any]) -> dict[str, Quantity]:
        """Largest sizes by name; one that cannot be read is a fault and counts as 1. A pair of lowest and highest value also goes into
        `ranges`."""
        found: dict[str, Quantity] = {}
        if not isinstance(given, Mapping) or not all(isinstance(n, str) and n.isidentifier() for n in given):
            self.faults.append(Fault(where, 'must be names with their largest size, such as {"motor": "10 V"}'))
            return found
        for name, text in given.items():
            try:
                if isinstance(text, (tuple, list)):
                    found[name] = self._pair(where, name, text)
                    continue
                found[name] = read_quantity(None, text)
                if found[name].si <= 0 or to_si(0.0, written_unit(found[name].text)):
                    raise ValueError(
                        f"{text!r} is not a size; write the largest value, above zero, in a unit that begins at zero"
                    )
            except ValueError as error:
                self.faults.append(Fault(f"{where}.{name}", str(error)))
                found[name] = PLACEHOLDER
        return found

    def _pair(self, where: str, name: str, given: Sequence[Any]) -> Quantity:
        """The larger end of a range, which is kept. Raises ValueError."""
        if len(given) != 2:
            raise ValueError(f'{list(given)!r} must be the lowest and the highest value, such as ("0 V", "150 V")')
        low, high = (read_quantity(None, text) for text in given)
        units = [written_unit(q.text) for q in (low, high)]
        if not same_dimension(*units):
            raise ValueError(f"{low.text!r} and {high.text!r} are not of one dimension")
        if any(to_si(0.0, unit) for unit in units):
            raise ValueError(f"{high.text!r} does not count from zero; write it in a unit that does, such as K")
        if not low.si < high.si:
            raise ValueError(f"{low.text!r} is not below {high.text!r}; write the lowest value first")
        self.ranges[where, name] = (low.si, high.si)
        return high if abs(high.si) >= abs(low.si) else Quantity(-low.si, low.text.lstrip("-"))

    def parameters(self, given: Mapping[str, Any]) -> tuple[dict[str, dict[str, Any]], dict[str, str], dict[str, str]]:
        """(tables of value, sd and source; domains; units) of the parameters by name."""
        tables, domains, units = {}, {}, {}
        for name, stated in given.items():
            where = f"parameters.{name}"
            table = dict(stated) if isinstance(stated, Mapping) else {"value": stated}
            if isinstance(stated, (tuple, list)):
                table = dict(zip(("value", "sd"), stated, strict=False))
                if len(stated) != 2:
                    self.faults.append(Fault(where, f'{stated!r} must be (value, sd), such as ("0.5 kg", "10 g")'))
            domain = table.pop("domain", "mechanism")
            if domain not in SECTIONS:
                self.faults.append(Fault(where, f"domain = {domain!r} must be one of {', '.join(SECTIONS)}"))
                domain = "mechanism"
            if not str(name).isidentifier() or name[0] == "_" or name.startswith("model_") or hasattr(Section, name):
                self.faults.append(Fault(where, "is not a name that a parameter can have; choose another one"))
                continue
            try:
                read_quantity(None, table)
            except ValueError as error:
                self.faults.append(Fault(where, str(error)))
                table = {"value": PLACEHOLDER.text}
            units[name], tables[name], domains[name] = written_unit(str(table["value"])), table, domain
        return tables, domains, units

    def limits(self, given: Mapping[str, Any]) -> dict[str, tuple[Law, Quantity]]:
        """The limits on expressions, each a law with the largest magnitude that it may have."""
        found: dict[str, tuple[Law, Quantity]] = {}
        for name, stated in given.items():
            if not (isinstance(stated, (tuple, list)) and len(stated) == 2 and callable(stated[0])):
                what = 'must be (law, largest value), such as (lambda d, p: p.k * d.x, "300 MPa")'
                self.faults.append(Fault(f"limits.{name}", what))
                continue
            size = self.ports("limits", {name: stated[1]})[name]
            if ("limits", name) in self.ranges:
                self.faults.append(Fault(f"limits.{name}", "has two values; a limit is on the magnitude, write one"))
            found[name] = (stated[0], size)
        return found

    def drive_rates(self, given: Mapping[str, Any], drive: Mapping[str, Quantity]) -> dict[str, Quantity]:
        """The limits on the rates of drives, checked for names, dimensions and signs."""
        found = self.ports("drive_rate", given)
        for name, q in found.items():
            if name not in drive:
                self.faults.append(Fault(f"drive_rate.{name}", f"is no drive; there are {', '.join(drive) or 'none'}"))
            elif q is not PLACEHOLDER and not same_dimension(
                written_unit(q.text), f"({written_unit(drive[name].text)})/s"
            ):
                what = f"{q.text!r} is no rate of a drive in {written_unit(drive[name].text)}"
                self.faults.append(
                    Fault(f"drive_rate.{name}", f"{what}; write for example {written_unit(drive[name].text)}/ms")
                )
            elif not (pair := self.ranges.get(("drive_rate", name), (-1.0, 1.0)))[0] < 0 < pair[1]:
                self.faults.append(
                    Fault(f"drive_rate.{name}", "must be a rate below zero and one above; else it never returns")
                )
        return {name: q for name, q in found.items() if name in drive}

    def weights(self, given: Mapping[str, Any], sizes: Mapping[str, Mapping[str, Quantity]]) -> dict[str, float]:
        """How much drives count, checked for names and sizes."""
        drive, axes = sizes["drive"], sizes["axes"]
        for name, weight in given.items():
            if name not in drive:
                self.faults.append(
                    Fault(f"drive_weight.{name}", f"is no drive; there are {', '.join(drive) or 'none'}")
                )
            elif isinstance(weight, bool) or not isinstance(weight, (int, float)) or not 0 < weight < np.inf:
                self.faults.append(Fault(f"drive_weight.{name}", f"{weight!r} must be a number above zero"))
        if given and len(drive) <= len(axes):
            what = f"is of more drives than axes, and there are {len(drive)} for {len(axes)}; leave it out"
            self.faults.append(Fault("drive_weight", what))
        return {name: float(w) for name, w in given.items() if isinstance(w, (int, float))}

    def imposed(
        self, laws: Mapping[str, Law | None], ports: Mapping[str, Any], sizes: Mapping[str, Mapping[str, Quantity]]
    ) -> None:
        """Collects what does not go with `needed_force`, and speeds that do not fit the axes."""
        beside = [name for name, law in laws.items() if law is not None and name != "needed_force"]
        beside += [name for name, given in ports.items() if given]
        self.faults += [
            Fault(name, "and needed_force are both given; where the motion is imposed, needed_force holds all forces")
            for name in beside
        ]
        axes, speed = sizes["axes"], sizes["speed"]
        if set(axes) != set(speed):
            self.faults.append(Fault("speed", f"must be given of each axis: {', '.join(axes)}"))
        for name in axes.keys() & speed.keys():
            if not same_dimension(written_unit(speed[name].text), f"({written_unit(axes[name].text)})/s"):
                self.faults.append(
                    Fault(f"speed.{name}", f"{speed[name].text!r} is no speed of an axis in {axes[name].text!r}")
                )

    def laws(self, given: dict[str, Law | None], state: Mapping[str, Any], same: bool) -> dict[str, Law]:
        """The laws that are given, checked for what is missing and what excludes what; `same`: the readings are the axes."""
        present = {name: law for name, law in given.items() if law is not None}
        if "needed_force" in present:
            return present
        need = {
            "mass": any(m in present for m in NEED_MASS) and f"is missing: {' and '.join(m for m in NEED_MASS if m in present)} "
            "needs the inertia of each axis, on which the forces of effects act",
            "rates": bool(state) and "is missing: a state needs its rate",
            "pose": not same and "is missing: readings that are not the axes themselves need pose(d, p)",
            "restoring_force": "mass" not in present and "is missing: an axis without mass rests where restoring_force = force",
        }  # fmt: skip
        self.faults += [Fault(name, what) for name, what in need.items() if what and name not in present]
        if "acceleration" in present:
            for other in ("force", "restoring_force", "damping_force"):
                if other in present:
                    self.faults.append(
                        Fault(
                            other, "and acceleration are both given; acceleration holds all forces, give one of the two"
                        )
                    )
        elif "force" not in present:
            self.faults.append(Fault("force", "is missing; give force(u, x, d, v, p) or acceleration(u, x, d, v, p)"))
        if "rates" in present and not state:
            self.faults.append(Fault("state", 'is missing: rates are of states; name them, such as {"current": "1 A"}'))
        return {n: law for n, law in present.items() if n != "rates" or state}


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
    read = _ArgumentReader(name)
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
    description: UserDescription, tables: dict[str, Any], plain: dict[str, Any], read: _ArgumentReader
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


def _check_at_home(device: UserDevice, read: _ArgumentReader) -> None:
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

"""A device whose physics its user writes, as functions of named ports: `user_device`.

    mass q'' = force(u, x, d, v) - restoring_force(d) - damping_force(v)   or   q'' = acceleration(u, x, d, v);   x' = rates(u, x, d, v)
    reading = pose(d)

u drives, x the user's own states, d displacements of the axes, v their velocities, p parameters; all SI.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar

import casadi as ca
import numpy as np
from pydantic import ConfigDict, create_model

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import validate
from ctrlgen.core.units import In, Quantity, read_quantity, same_dimension, to_si, written_unit
from ctrlgen.devices.base import BalancedPhysics, Device, DevicePhysics, InertialPhysics, Limit, Signal
from ctrlgen.devices.ports import Law, Ports, ask
from ctrlgen.devices.section import Section

SECTIONS = {
    "mechanism": "mechanism",
    "stage": "stage",
    "actuator": "actuator",
    "sensor": "sensing",
}  # domain -> section
ASKS = {
    "force": "uxdvp", "restoring_force": "dp", "damping_force": "vp", "mass": "p", "acceleration": "uxdvp", "rates": "uxdvp", "pose": "dp",
}  # fmt: skip
UNREAD = Quantity(1.0, "1")  # stands for what could not be read, so that all else is judged too
NO_SOURCE = ConfigDict(use_attribute_docstrings=False)  # classes made at run time: looking for their text takes 30 ms
MOVING = ("damping_force", "acceleration")  # laws that need a mass


@dataclass(frozen=True, eq=False)
class Recipe:
    """What the user gave: sizes of the ports {name: quantity}, parameters' domains, and the laws by name."""

    name: str
    axes: dict[str, Quantity]
    drive: dict[str, Quantity]
    reading: dict[str, Quantity]
    state: dict[str, Quantity]
    domains: dict[str, str]
    units: dict[str, str]
    laws: dict[str, Law]
    force: Quantity | None = None
    faults: list[Fault] = field(default_factory=list)

    def rows(self, law: str) -> tuple[str, ...]:
        """Names of what a law returns."""
        return tuple({"rates": self.state, "pose": self.reading}.get(law, self.axes))

    def ask(self, law: str, p: Ports, **vectors: ca.SX) -> ca.SX:
        """The law's answer; its faults are noted. Zeros where the law is not given."""
        names = {"u": self.drive, "x": self.state, "d": self.axes, "v": self.axes}
        what = {"u": "the drive", "x": "the state", "d": "the displacement", "v": "the velocity"}
        if law not in self.laws:
            return ca.SX.zeros(len(self.rows(law)), 1)
        allowed = [key for key in ASKS[law] if key == "p" or (key in vectors and vectors[key].numel())]
        offered = {key: p if key == "p" else Ports(what[key], tuple(names[key]), vectors[key]) for key in allowed}
        rows, faults = ask(law, self.laws[law], offered, self.rows(law))
        self.faults.extend(fault for fault in faults if fault not in self.faults)
        return rows


class UserNumbers(Section):
    """A table of a user's parameters."""

    model_config = NO_SOURCE


class UserDevice(Device):
    """A device whose physics is its user's functions; made by `user_device`, never read from a file."""

    model_config = NO_SOURCE

    kind: str = "user"
    recipe: ClassVar[Recipe]

    def physics(self, p: SimpleNamespace) -> DevicePhysics:
        """The user's functions with the values `p`. Raises InputError with every fault of the laws."""
        r = self.recipe
        r.faults.clear()
        size = r.force.si if r.force else _Laws(r, _numbers(r, self.values())).size()
        physics = _Laws(r, _numbers(r, p)).physics(size)
        if r.faults:
            raise InputError(self.name, r.faults)
        return physics

    def __reduce__(self) -> tuple[Any, ...]:
        """Its class is made anew where it is unpickled; its functions must be ones that can be pickled."""
        sections = {s: dict(getattr(self, s)) for s in SECTIONS.values() if s in type(self).model_fields}
        plain = {key: getattr(self, key) for key in Device.model_fields}
        return _rebuilt, (self.recipe, plain, sections)


def _numbers(recipe: Recipe, p: SimpleNamespace) -> Ports:
    """The parameters by the names their user gave them."""
    values = {name: getattr(getattr(p, SECTIONS[domain]), name) for name, domain in recipe.domains.items()}
    return Ports("p", tuple(values), ca.vertcat(ca.SX(0, 1), *map(ca.SX, values.values())))


class _Laws:
    """Puts the laws of a recipe together."""

    def __init__(self, recipe: Recipe, p: Ports) -> None:
        self.r, self.p = recipe, p
        self.inertial = "mass" in recipe.laws
        self.x = ca.SX.sym("x", len(recipe.state))
        self.mass = recipe.ask("mass", p)

    def pushed(self, u: ca.SX, x: ca.SX, d: ca.SX, v: ca.SX) -> ca.SX:
        """Force on the axes beside `restoring_force` and `damping_force`; an acceleration is a force on the mass."""
        if "acceleration" not in self.r.laws:
            return self.r.ask("force", self.p, u=u, x=x, d=d, v=v)
        return self.mass * self.r.ask("acceleration", self.p, u=u, x=x, d=d, v=v) + self.restoring_force(d)

    def restoring_force(self, d: ca.SX) -> ca.SX:
        """What brings the axes home; of an acceleration, its part at standstill without drive."""
        if "acceleration" not in self.r.laws:
            return self.r.ask("restoring_force", self.p, d=d)
        n = len(self.r.axes)
        still = {"u": ca.SX.zeros(len(self.r.drive), 1), "x": ca.SX.zeros(len(self.r.state), 1), "v": ca.SX.zeros(n, 1)}
        here, home = (self.r.ask("acceleration", self.p, d=at, **still) for at in (d, ca.SX.zeros(n, 1)))
        return self.mass * (home - here)

    def size(self) -> float:
        """Typical force: what full drive and state give at home, or what the full travel takes."""
        n, r = len(self.r.axes), self.r
        u, d, still = ca.SX.sym("u", len(r.drive)), ca.SX.sym("d", n), ca.SX.zeros(n if self.inertial else 0, 1)
        laws = [self.pushed(u, self.x, d, still), self.restoring_force(d)]
        if r.faults:
            return 1.0
        law = ca.Function("law", [u, self.x, d], laws)
        pushed = (law(_sizes(r.drive), _sizes(r.state), 0)[0] - law(0, 0, 0)[0]).full()
        held = law(0, 0, _sizes(r.axes))[1].full()
        return float(next((found for f in (pushed, held) if 0 < (found := np.abs(f).max()) < np.inf), 1.0))

    def physics(self, size: float) -> DevicePhysics:
        """The laws as a device's physics, `size` the typical force; faults of the laws are noted in the recipe."""
        r, n, axes = self.r, len(self.r.axes), tuple(self.r.axes)
        u, d, v = ca.SX.sym("u", len(r.drive)), ca.SX.sym("d", n), ca.SX.sym("v", n if self.inertial else 0)
        for law, vectors in {
            "damping_force": {"v": v},
            "rates": {"u": u, "x": self.x, "d": d, "v": v},
            "pose": {"d": d},
        }.items():
            r.ask(law, self.p, **vectors)  # for its faults, so that all are listed
        self.pushed(u, self.x, d, v), self.restoring_force(d)
        travel = max(q.si for q in r.axes.values())
        unit = written_unit(next(iter(r.axes.values())).text)
        common: dict[str, Any] = dict(
            axes=axes, components=tuple(r.reading), pose_units=_units(r.reading), pose_scale=_sizes(r.reading),
            drive=Signal("drive", "drive", tuple(r.drive), _units(r.drive), "u_", u, _sizes(r.drive)),
            state=Signal("state", "state", tuple(r.state), _units(r.state), "x_", self.x, _sizes(r.state)) if r.state else None,
            rest=(0.0,) * len(r.state), displacement_scale=travel, travel_unit=unit, force_scale=size,
            force_unit=written_unit(r.force.text) if r.force else "N*m" if same_dimension(unit, "rad") else "N",
            restoring_force=self.restoring_force, limits=self.limits,
            pose=(lambda d: r.ask("pose", self.p, d=d)) if "pose" in r.laws else (lambda d: d),
        )  # fmt: skip
        if not self.inertial:
            return BalancedPhysics(
                **common, force=lambda u, x, d: self.pushed(u, x, d, d[:0]),
                rates=lambda x, u: r.ask("rates", self.p, u=u, x=x),
            )  # fmt: skip
        return InertialPhysics(
            **common, mass=tuple(ca.vertsplit(self.mass)),
            damping_force=(lambda v: r.ask("damping_force", self.p, v=v)) if "damping_force" in r.laws else None,
            dynamics=lambda u, x, d, v: (self.pushed(u, x, d, v), r.ask("rates", self.p, u=u, x=x, d=d, v=v)),
        )  # fmt: skip

    def limits(self, signal: SimpleNamespace) -> list[Limit]:
        """Drives and displacements stay within their sizes."""
        found = []
        for what, ports, expr in (("drive", self.r.drive, signal.drive), ("travel", self.r.axes, signal.displacement)):
            for i, (name, q) in enumerate(ports.items()):
                label, unit = f"{what} of {name}", written_unit(q.text)
                found.append(Limit(f"{what}_{name}", label, (name,), unit, expr[i], -q.si, q.si))
        return found


def _units(ports: Mapping[str, Quantity]) -> tuple[str, ...]:
    return tuple(written_unit(q.text) for q in ports.values())


def _sizes(ports: Mapping[str, Quantity]) -> tuple[float, ...]:
    return tuple(q.si for q in ports.values())


def _class(recipe: Recipe) -> type[UserDevice]:
    """The device's class: one section of parameters a domain."""
    fields: dict[str, Any] = {}
    for domain in dict.fromkeys(recipe.domains.values()):
        numbers: dict[str, Any] = {
            n: (Annotated[Quantity, In(recipe.units[n])], ...) for n, where in recipe.domains.items() if where == domain
        }
        section = create_model(f"{domain.title()}Numbers", __base__=UserNumbers, **numbers)
        section.domain = domain
        fields[SECTIONS[domain]] = (section, ...)
    made = create_model("NamedUserDevice", __base__=UserDevice, **fields)
    made.recipe = recipe
    return made


def _rebuilt(recipe: Recipe, plain: dict[str, Any], sections: dict[str, dict[str, Quantity]]) -> UserDevice:
    return _class(recipe).model_validate({**plain, **sections})


class _Reader:
    """Reads the words of `user_device` and collects their faults."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.faults: list[Fault] = []

    def ports(self, where: str, given: Mapping[str, str]) -> dict[str, Quantity]:
        """Sizes by name; one that cannot be read is noted and counts as 1."""
        found: dict[str, Quantity] = {}
        if not isinstance(given, Mapping) or not all(isinstance(n, str) and n.isidentifier() for n in given):
            self.faults.append(Fault(where, 'must be names with sizes, such as {"motor": "10 V"}'))
            return found
        for name, text in given.items():
            try:
                found[name] = read_quantity(None, text)
                if found[name].si <= 0 or to_si(0.0, written_unit(found[name].text)):
                    raise ValueError(
                        f"{text!r} is no size; write the largest value, above zero, in a unit that begins at zero"
                    )
            except ValueError as error:
                self.faults.append(Fault(f"{where}.{name}", str(error)))
                found[name] = UNREAD
        return found

    def parameters(self, given: Mapping[str, Any]) -> tuple[dict[str, dict[str, Any]], dict[str, str], dict[str, str]]:
        """Tables of value, sd and source; domains; units."""
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
                self.faults.append(Fault(where, "is a name I cannot use; choose another one"))
                continue
            try:
                read_quantity(None, table)
            except ValueError as error:
                self.faults.append(Fault(where, str(error)))
                table = {"value": UNREAD.text}
            units[name], tables[name], domains[name] = written_unit(str(table["value"])), table, domain
        return tables, domains, units

    def laws(self, given: dict[str, Law | None], state: Mapping[str, Any], same: bool) -> dict[str, Law]:
        """The laws that are there, judged together; `same`: readings are the axes themselves."""
        there = {name: law for name, law in given.items() if law is not None}
        need = {
            "mass": any(m in there for m in MOVING) and f"is missing: {' and '.join(m for m in MOVING if m in there)} "
            "needs the inertia of each axis, on which the forces of effects act",
            "rates": bool(state) and "is missing: a state needs its rate",
            "pose": not same and "is missing: readings that are not the axes themselves need pose(d, p)",
            "restoring_force": "mass" not in there and "is missing: an axis without mass stands where restoring_force = force",
        }  # fmt: skip
        self.faults += [Fault(name, what) for name, what in need.items() if what and name not in there]
        if "acceleration" in there:
            for other in ("force", "restoring_force", "damping_force"):
                if other in there:
                    self.faults.append(Fault(other, "and acceleration are given; acceleration is all of it, give one"))
        elif "force" not in there:
            self.faults.append(Fault("force", "is missing; give force(u, x, d, v, p) or acceleration(u, x, d, v, p)"))
        if "rates" in there and not state:
            self.faults.append(Fault("state", 'is missing: rates are of states; name them, such as {"current": "1 A"}'))
        return {n: law for n, law in there.items() if n != "rates" or state}


def user_device(
    name: str,
    *,
    parameters: Mapping[str, Any],
    drive: Mapping[str, str],
    axes: Mapping[str, str],
    force: Law | None = None,
    restoring_force: Law | None = None,
    damping_force: Law | None = None,
    mass: Law | None = None,
    acceleration: Law | None = None,
    state: Mapping[str, str] | None = None,
    rates: Law | None = None,
    reading: Mapping[str, str] | None = None,
    pose: Law | None = None,
    force_size: str | None = None,
    title: str = "",
    source: str = "a user's model",
    effect: Sequence[Mapping[str, Any]] = (),
) -> Device:
    """A device from functions of named ports; raises InputError with every fault.

    `drive`, `axes`, `state` and `reading` are names with their largest size, {"motor": "24 V"}; readings are the axes
    unless `pose` says otherwise. `parameters` are "0.5 kg", ("0.5 kg", sd) or {value, sd, source, domain}: with an sd
    the diagnosis takes a number as uncertain, without as exact until shown otherwise; its path is 'mechanism.NAME'.
    A law takes any of u, x, d, v, p by name (see the module) and returns one number an axis (state, reading): a vector,
    a list, or {name: number}. It may be a `ca.Function` whose inputs have those names. Without `mass` the axes have no
    inertia. `force_size` is the typical force with its unit, by default that of the full drive in N, or N*m.
    """
    read = _Reader(name)
    tables, domains, units = read.parameters(parameters)
    ports = {"drive": drive, "axes": axes, "state": {} if state is None else state}
    sizes = {where: read.ports(where, given) for where, given in ports.items()}
    sizes["reading"] = sizes["axes"] if reading is None else read.ports("reading", reading)
    for where in ("drive", "axes"):
        if not sizes[where]:
            read.faults.append(Fault(where, "is empty; name at least one"))
    sound = {axis: q for axis, q in sizes["axes"].items() if q is not UNREAD}
    first = next(iter(sound.values()), None)
    for axis, q in sound.items():
        if first and not same_dimension(written_unit(q.text), written_unit(first.text)):
            read.faults.append(
                Fault(f"axes.{axis}", f"{q.text!r} is not of the dimension of {first.text!r}; all axes are")
            )
    given = {
        "force": force, "restoring_force": restoring_force, "damping_force": damping_force, "mass": mass, "acceleration": acceleration,
        "rates": rates, "pose": pose,
    }  # fmt: skip
    laws = read.laws(given, sizes["state"], reading is None or list(reading) == list(axes))
    size = None if force_size is None else read.ports("force_size", {"force_size": force_size})["force_size"]
    recipe = Recipe(
        name, drive=sizes["drive"], axes=sizes["axes"], state=sizes["state"], reading=sizes["reading"], domains=domains, units=units,
        laws=laws, force=size,
    )  # fmt: skip
    return _checked(
        recipe, tables, {"name": name, "title": title or name, "source": source, "effect": tuple(effect)}, read
    )


def _checked(recipe: Recipe, tables: dict[str, Any], plain: dict[str, Any], read: _Reader) -> Device:
    """The device, if words, laws and numbers are in order."""
    made, device = _class(recipe), None
    sections: dict[str, dict[str, Any]] = {SECTIONS[domain]: {} for domain in recipe.domains.values()}
    for name, domain in recipe.domains.items():
        sections[SECTIONS[domain]][name] = tables[name]
    for effects in ((), plain["effect"]):  # the laws are judged even where an effect is wrong
        try:
            device = validate(made, {"kind": "user", **plain, "effect": effects, **sections}, recipe.name)
            if recipe.axes and recipe.drive and not effects:
                _at_home(device, read)
        except InputError as error:
            read.faults += [fault for fault in error.faults if fault not in read.faults]
    if read.faults or device is None:
        raise InputError(f"user_device {recipe.name!r}", read.faults)
    return device


def _at_home(device: Device, read: _Reader) -> None:
    """Notes what is not a number at home and at rest."""
    physics = device.physics(device.values())
    n = len(physics.axes)
    d, v, x, u = ca.SX.sym("d", n), ca.SX.sym("v", n), ca.SX.sym("x", len(physics.rest)), physics.drive.expr
    if isinstance(physics, InertialPhysics):
        force, rates = physics.dynamics(u, x, d, v)
    else:
        assert isinstance(physics, BalancedPhysics)
        force, rates = physics.force(u, x, d), physics.rates(x, u)
    laws = {"force": force, "rates": rates, "restoring_force": physics.restoring_force(d), "pose": physics.pose(d)}
    if isinstance(physics, InertialPhysics):
        laws |= {"damping_force": physics.damping_force(v)} if physics.damping_force else {}
        laws["mass"] = ca.vertcat(*physics.mass)
    home = ca.Function("home", [u, x, d, v], list(laws.values()))(0, 0, 0, 0)
    for law, value in zip(laws, home, strict=True):
        found = np.array(value).ravel()
        if not np.all(np.isfinite(found)):
            read.faults.append(Fault(law, f"is {found} at home (all zeros); it must be a number there"))
        elif law == "mass" and np.any(found <= 0):
            read.faults.append(Fault(law, f"is {found}; it must be above zero"))


__all__ = ["UserDevice", "user_device"]

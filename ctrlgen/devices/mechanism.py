"""A mechanism of rigid bodies and flexures, from a file: bodies, what joins them, what moves them, what is followed.

Actuators either push (a force between two bodies, or on one) or prescribe the motion of one element, as a stage's stroke does.
Motions are small: stiffness, Jacobian and loads are those of the mechanism as drawn.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from types import SimpleNamespace
from typing import Annotated, Any, Literal

import casadi as ca
import numpy as np
from pydantic import Field, field_validator, model_validator

from ctrlgen.core.units import In, Quantity, same_dimension, written_unit
from ctrlgen.devices.base import BalancedPhysics, Device, Section
from ctrlgen.devices.mechanism_elements import (
    TWIST,
    AnyElement,
    CircularHinge,
    Copied,
    Direction,
    Flexible,
    Name,
    Place,
    Placed,
)
from ctrlgen.devices.mechanism_model import Condensed
from ctrlgen.physics import mechanism
from ctrlgen.physics.mechanism import GROUND, Element
from ctrlgen.physics.screw import Matrix, rotation_z

PerDrive = Annotated[Quantity, In(None)]
Inertia = Annotated[Quantity, In("kg*mm^2", positive=True)]
GROUND_NAME = "ground"
MOVED = 1e-6  # of the largest motion, below which a channel is not moved on purpose: symmetry leaves rounding, 1e-9


class Material(Section):
    """`[[material]]`: what flexures are made of."""

    name: Name
    """By which elements name it."""
    young: Annotated[Quantity, In("GPa", positive=True)]
    """Young's modulus."""
    poisson: Annotated[Quantity, In("1", low=0.0, high=0.5)]
    """Poisson's ratio."""
    stress_limit: Annotated[Quantity, In("MPa", positive=True)] | None = None
    """Largest stress in its blades, wires and struts and in the necks of its hinges; a limit where it is given."""


class Pattern(Section):
    """`[[pattern]]`: copies of bodies, elements and actuators that name it, turned about z or mirrored."""

    name: Name
    """By which they name it; copy k of a body NAME is called NAME_k, from 1."""
    times: Annotated[int, Field(ge=2, le=100)] | None = None
    """How many there are, the first as written; left out for a mirror."""
    angles: tuple[Annotated[Quantity, In("deg")], ...] = ()
    """Angle of each copy; left out: evenly spaced over a turn."""
    mirror: Literal["x", "y", "z"] | None = None
    """The second copy is the image of the first in the plane through the origin that is normal to this axis."""

    @model_validator(mode="after")
    def _is_one_or_the_other(self) -> Pattern:
        if self.mirror is not None and (self.times is not None or self.angles):
            raise ValueError("mirror: makes two copies; leave out times and angles")
        if self.mirror is None and self.times is None:
            raise ValueError("times: is missing; say how many copies, or give mirror")
        if self.angles and len(self.angles) != self.times:
            raise ValueError(f"angles: has {len(self.angles)} for {self.times} copies; give one for each, or none")
        return self

    @property
    def turns(self) -> list[Matrix]:
        """The rotation or reflection (3, 3) of each copy."""
        if self.mirror is not None:
            return [ca.DM.eye(3), ca.diag(ca.DM([-1 if axis == self.mirror else 1 for axis in "xyz"]))]
        times = self.times or 0
        angles = [a.si for a in self.angles] or [2 * np.pi * k / times for k in range(times)]
        return [ca.DM(rotation_z(angle)) for angle in angles]


class Body(Section):
    """`[[body]]`: a rigid part."""

    name: Name
    """By which elements, actuators and the output name it."""
    pattern: str = ""
    """The pattern by which it is copied."""
    mass: Annotated[Quantity, In("g", positive=True)] | None = None
    """For the natural frequencies; a body without mass follows the others."""
    centre: Place | None = None
    """Centre of mass in the global frame. Left out: the origin."""
    inertia: tuple[Inertia, Inertia, Inertia] | None = None
    """Moments of inertia about axes through the centre of mass that are parallel to x, y and z as it is drawn."""

    @model_validator(mode="after")
    def _turns_as_it_moves(self) -> Body:
        if (self.mass is None) != (self.inertia is None):
            raise ValueError("mass and inertia belong together; give both or none")
        return self


class Actuator(Section):
    """`[[actuator]]`: what moves the mechanism. One gives one axis, named after it."""

    name: Name
    """Of the axis and its drive."""
    kind: Literal["force", "displacement"]
    """Pushes on a body, or prescribes the motion of an element."""
    on: str
    """The body that is pushed, or the element whose free end is moved."""
    against: str = GROUND_NAME
    """The body that a force pushes against."""
    at: Place | None = None
    """Where a force acts; its travel is that of this point."""
    along: Direction
    """In which direction; of any length."""
    gain: PerDrive
    """Force or displacement per drive, such as "0.2 N/V" or "1 um/V"."""
    low: PerDrive
    """Lowest drive; its unit is that of the drive."""
    high: PerDrive
    """Highest drive."""
    rate: tuple[PerDrive, PerDrive] | None = None
    """Largest change of the drive by time, such as "5 V/ms", or the lowest and the highest, such as ["-2 V/ms", "5 V/ms"]."""
    time_constant: Annotated[Quantity, In("ms", positive=True)] | None = None
    """Time constant with which the force or displacement follows the drive; left out: at once."""
    stiffness: Annotated[Quantity, In("N/um", positive=True)] | None = None
    """Stiffness of a stack beside its blocked force, along its direction."""
    travel: Annotated[Quantity, In("um", positive=True)]
    """Largest travel to both sides; a limit."""
    pattern: str = ""
    """The pattern by which it is copied."""

    @field_validator("rate", mode="before")
    @classmethod
    def _is_to_both_sides(cls, stated: Any) -> Any:
        """One rate is the largest to both sides."""
        return (f"-{stated}", stated) if isinstance(stated, str) else stated

    @model_validator(mode="after")
    def _fits_together(self) -> Actuator:
        faults = []
        drive = written_unit(self.low.text)
        if self.rate is not None:
            slowest, fastest = self.rate
            if any(not same_dimension(written_unit(q.text), f"({drive})/s") for q in self.rate):
                faults.append(f"rate: {fastest.text!r} is no rate of a drive in {drive}; write for example {drive}/ms")
            elif not slowest.si < 0 < fastest.si:
                faults.append("rate: must be above zero, or a rate below zero and one above")
        if not same_dimension(drive, written_unit(self.high.text)):
            faults.append(f"high: {self.high.text!r} is not of the dimension of low = {self.low.text!r}")
        elif not self.low.si < self.high.si:
            faults.append(f"low = {self.low.text!r} is not below high = {self.high.text!r}")
        wanted = "N" if self.kind == "force" else "m"
        if not same_dimension(f"({written_unit(self.gain.text)})*({drive})", wanted):
            faults.append(
                f"gain: {self.gain.text!r} is no {self.kind} per drive in {drive}; write for example {wanted}/{drive}"
            )
        if np.linalg.norm(self.along) == 0:
            faults.append("along: is zero; give a direction")
        if self.kind == "force" and self.at is None:
            faults.append("at: is missing; say where the force acts")
        for key in ("at", "stiffness") if self.kind == "displacement" else ():
            if getattr(self, key) is not None:
                faults.append(
                    f"{key}: belongs to a force; the element says where a displacement acts and how stiff it is"
                )
        if faults:
            raise ValueError("; ".join(faults))
        return self


class Output(Section):
    """`[output]`: the point that is followed and read."""

    body: str
    """On this body (of a pattern: with the number of the copy)."""
    at: Place
    """In the global frame."""
    channels: tuple[Literal["theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z"], ...] = Field(
        min_length=1
    )
    """Components of its motion, as many as actuators: rotations, and displacements of the point."""


class Mechanism(Device):
    """Drive -> force or displacement -> motion of all bodies -> pose of the output point."""

    kind: Literal["mechanism"]
    """Rigid bodies and flexures."""
    material: tuple[Material, ...] = ()
    """`[[material]]` tables."""
    pattern: tuple[Pattern, ...] = ()
    """`[[pattern]]` tables."""
    body: tuple[Body, ...]
    """`[[body]]` tables."""
    element: tuple[AnyElement, ...]
    """`[[element]]` tables."""
    actuator: tuple[Actuator, ...]
    """`[[actuator]]` tables: all push, or all prescribe displacements."""
    output: Output
    """`[output]`: what is followed."""

    @model_validator(mode="after")
    def _refers_to_what_there_is(self) -> Mechanism:
        empty = [key for key in ("body", "element", "actuator") if not getattr(self, key)]
        if empty:
            raise ValueError("; ".join(f"{key}: there is none; add a [[{key}]] table" for key in empty))
        faults: list[str] = []
        for what, names in {
            "material": [m.name for m in self.material], "pattern": [q.name for q in self.pattern], "body": list(self.bodies),
            "element": [e.name for e in self.element], "actuator": [a.name for a in self.actuator],
        }.items():  # fmt: skip
            faults += [f"{what}: {name!r} is named twice" for name in dict.fromkeys(names) if names.count(name) > 1]
        if GROUND_NAME in self.bodies:
            faults.append('body: "ground" is the name of what does not move; choose another one')
        known = {q.name for q in self.pattern} | {""}
        for where, sections in (("body", self.body), ("element", self.element), ("actuator", self.actuator)):
            for k, section in enumerate(sections):
                if section.pattern not in known:
                    faults.append(f"{where}[{k}].pattern: {section.pattern!r} is no pattern")
        if not faults:
            faults += self._unknown_names()
        if len({a.kind for a in self.actuator}) > 1:
            faults.append(
                "actuator: some push and some prescribe a displacement; give one kind, a stack as force with stiffness"
            )
        if len({a.time_constant is None for a in self.actuator}) > 1:
            faults.append("actuator: some have a time_constant and some do not; give one to all or to none")
        if not faults and len(self.output.channels) != len(self.placed_actuators):
            counts = f"{len(self.output.channels)} channels, {len(self.placed_actuators)} actuators"
            faults.append(f"output.channels: {counts}; follow as many channels as there are actuators")
        if not faults and (loose := mechanism.loose_bodies(len(self.bodies), self._joints)):
            faults.append(f"body: nothing joins {', '.join(self.bodies[i] for i in loose)} to the ground")
        if not faults:
            faults += self._unmoved()
        if faults:
            raise ValueError("; ".join(faults))
        _ = self.channel_scale  # that of the file: a copy with other numbers keeps it
        return self

    def _unmoved(self) -> list[str]:
        """Channels that no actuator moves, or that move only together."""
        moved = self._output_motion * np.array([self.size] * 3 + [1.0] * 3)[:, None]  # turns as displacements
        rows, channels = moved[[TWIST.index(c) for c in self.output.channels]], self.output.channels
        still = [c for c, row in zip(channels, rows, strict=True) if np.abs(row).max() <= MOVED * np.abs(moved).max()]
        if still:
            return [
                f"output.channels: no actuator moves {', '.join(still)}; follow others, or push in another direction"
            ]
        if np.linalg.cond(rows / np.abs(rows).max(axis=1, keepdims=True)) > 1 / MOVED:
            return [
                f"output.channels: {', '.join(channels)} move only together; follow others, or place the actuators otherwise"
            ]
        return []

    def _unknown_names(self) -> list[str]:
        faults = []
        materials = {m.name for m in self.material}
        for k, e in enumerate(self.element):
            faults += [
                f"element[{k}].{key}: {name!r} is no body" + (f" with the pattern {e.pattern!r}" if e.pattern else "")
                for key, name in (("from", e.from_), ("to", e.to)) if self._number(name, e.pattern, 1) is None
            ]  # fmt: skip
            if isinstance(e, Flexible) and e.material not in materials:
                faults.append(f"element[{k}].material: {e.material!r} is no material")
        elements = {e.name: e for e in self.element}
        for k, a in enumerate(self.actuator):
            if a.kind == "displacement":
                moved = elements.get(a.on)
                if moved is None or moved.pattern != a.pattern:
                    faults.append(
                        f"actuator[{k}].on: {a.on!r} is no element"
                        + (f" with the pattern {a.pattern!r}" if a.pattern else "")
                    )
                continue
            faults += [
                f"actuator[{k}].{key}: {name!r} is no body"
                for key, name in (("on", a.on), ("against", a.against)) if self._number(name, a.pattern, 1) is None
            ]  # fmt: skip
        if self.output.body not in self.bodies:
            faults.append(f"output.body: {self.output.body!r} is no body; there are {', '.join(self.bodies)}")
        return faults

    @cached_property
    def bodies(self) -> tuple[str, ...]:
        """The names of all bodies, copies with their number."""
        return tuple(b.name for b in self.placed_bodies)

    @cached_property
    def size(self) -> float:
        """The largest distance of an element's end from the origin [m]."""
        return max(float(np.linalg.norm([x.si for x in e.at])) for e in self.element) or 1e-3

    def _number(self, name: str, pattern: str, copy: int) -> int | None:
        """The number of a body as an element of a `pattern` names it, from its copy; None where there is none."""
        if name == GROUND_NAME:
            return GROUND
        for known in (
            (f"{name}_{copy}",)
            if pattern and any(b.name == name and b.pattern == pattern for b in self.body)
            else (name,)
        ):
            if known in self.bodies:
                return self.bodies.index(known)
        return None

    def _copies(self, sections: Iterable[Any]) -> Iterator[Copied]:
        for index, section in enumerate(sections):
            pattern = next((q for q in self.pattern if q.name == section.pattern), None)
            if pattern is None:
                yield Copied(section, index, section.name, 0, ca.DM.eye(3))
                continue
            for k, turn in enumerate(pattern.turns, start=1):
                yield Copied(section, index, f"{section.name}_{k}", k, turn)

    def _between(self, copy: Copied, first: str, second: str) -> Placed:
        numbers = [self._number(name, copy.section.pattern, copy.copy) for name in (first, second)]
        ends = [GROUND if n is None else n for n in numbers]
        return Placed(copy.section, copy.index, copy.name, copy.copy, copy.turn, ends[0], ends[1])

    @cached_property
    def placed_bodies(self) -> tuple[Copied, ...]:
        """Every copy of every body, by its number."""
        return tuple(self._copies(self.body))

    @cached_property
    def placed_elements(self) -> tuple[Placed, ...]:
        """Every copy of every element."""
        return tuple(self._between(c, c.section.from_, c.section.to) for c in self._copies(self.element))

    @cached_property
    def placed_actuators(self) -> tuple[Placed, ...]:
        """Every copy of every actuator; one that prescribes a displacement names an element and no bodies."""
        return tuple(self._between(c, c.section.against, c.section.on) for c in self._copies(self.actuator))

    @cached_property
    def channel_scale(self) -> tuple[float, ...]:
        """A typical size [rad, m] of each channel that is followed: what all actuators at the largest travel make of it, as the
        file describes it."""
        reach = np.abs(self._output_motion).sum(axis=1) * max(a.travel.si for a in self.actuator)
        return tuple(float(reach[TWIST.index(c)]) for c in self.output.channels)

    @property
    def _output_motion(self) -> np.ndarray:
        return ca.DM(ca.evalf(ca.SX(Condensed(self, self.values()).output_motion))).full()

    @property
    def _joints(self) -> list[Element]:
        """Who is joined to whom."""
        return [Element(e.first, e.second, ca.DM.eye(6)) for e in self.placed_elements]

    def remarks(self) -> list[str]:
        """Remarks on hinge equations used outside their t/R range."""
        hinges = [e for e in self.element if isinstance(e, CircularHinge)]
        return [f"{e.name}: {note}" for e in hinges for note in e.hinge.notes()]

    def physics(self, p: SimpleNamespace) -> BalancedPhysics:
        """The condensed mechanism with the values `p`."""
        return Condensed(self, p).physics()

"""A mechanism of rigid bodies and flexures, from a file: bodies, what joins them, what moves them, what is followed.

Actuators either push (a force between two bodies, or on one) or prescribe the motion of one element, as a stage's stroke does.
Small motions: stiffness, Jacobian and loads are those of the mechanism as drawn; springs may stiffen with the cube of their travel.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Annotated, Any, Literal

import casadi as ca
import numpy as np
from pydantic import Field, model_validator

from ctrlgen.core.units import In, Quantity, same_dimension, show, written_unit
from ctrlgen.devices.base import BalancedPhysics, Device, Limit, Section, Signal
from ctrlgen.physics import flexure, mechanism
from ctrlgen.physics.mechanism import GROUND, Element
from ctrlgen.physics.screw import Matrix, inverse, inverse_adjoint, move, rotation_z, series

Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
Length = Annotated[Quantity, In("mm", positive=True)]
Coordinate = Annotated[Quantity, In("mm")]
Place = tuple[Coordinate, Coordinate, Coordinate]
Direction = tuple[float, float, float]
TWIST = ("theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z")
GROUND_NAME = "ground"


class Material(Section):
    """`[[material]]`: what flexures are made of."""

    name: Name
    """By which elements name it."""
    young: Annotated[Quantity, In("GPa", positive=True)]
    """Young's modulus."""
    poisson: Annotated[Quantity, In("1", low=0.0, high=0.5)]
    """Poisson's ratio."""
    stress_limit: Annotated[Quantity, In("MPa", positive=True)] | None = None
    """Largest stress at the ends of its blades and wires; a limit where it is given."""


class Pattern(Section):
    """`[[pattern]]`: copies of bodies, elements and actuators that name it, turned about z."""

    name: Name
    """By which they name it; copy k of a body NAME is called NAME_k, from 1."""
    times: Annotated[int, Field(ge=2, le=100)]
    """How many there are, the first as written."""
    angles: tuple[Annotated[Quantity, In("deg")], ...] = ()
    """Angle of each copy; left out: evenly spaced over a turn."""

    @model_validator(mode="after")
    def _one_angle_each(self) -> Pattern:
        if self.angles and len(self.angles) != self.times:
            raise ValueError(f"angles: has {len(self.angles)} for {self.times} copies; give one for each, or none")
        return self


class Body(Section):
    """`[[body]]`: a rigid part."""

    name: Name
    """By which elements, actuators and the output name it."""
    pattern: str = ""
    """The pattern by which it is copied."""


class Joining(Section):
    """What all elements have: whom they join, and where."""

    name: Name
    """In messages and reports."""
    from_: str = Field(alias="from")
    """The body at its fixed end, or "ground"."""
    to: str
    """The body at its free end."""
    at: Place
    """Its free end in the global frame."""
    along: Direction = (1.0, 0.0, 0.0)
    """Direction from its fixed to its free end, its x axis; of any length."""
    across: Direction = (0.0, 1.0, 0.0)
    """A direction that fixes its y axis, along which a blade is thin; not parallel to `along`."""
    pattern: str = ""
    """The pattern by which it is copied."""

    @model_validator(mode="after")
    def _has_a_frame(self) -> Joining:
        if np.linalg.norm(np.cross(self.along, self.across)) < 1e-6 * np.linalg.norm(self.along) * np.linalg.norm(
            self.across
        ):
            raise ValueError("across: is parallel to along, or one of them is zero; give two directions")
        return self

    @property
    def frame(self) -> Matrix:
        """R (3, 3) from its own frame to the global one."""
        return mechanism.frame(ca.DM(self.along), ca.DM(self.across))


class Flexible(Joining):
    """A flexure made of a material."""

    length: Length
    """Length between its ends."""
    material: str
    """Name of its material."""


class Blade(Flexible):
    """A leaf spring."""

    kind: Literal["blade"]
    """A blade: thin along its y axis."""
    thickness: Length
    """Along y."""
    width: Length
    """Along z, not below the thickness."""

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix:
        """[C] about the free end (6, 6). Source: S1 eq. (21)-(23)."""
        return flexure.blade_compliance(p.length, p.thickness, p.width, m.young, m.poisson)

    def stress(self, load: Matrix, p: SimpleNamespace) -> tuple[Matrix, Matrix, Matrix]:
        """Bending about z and y and tension [Pa] of section loads (6, n) in its frame."""
        area = p.thickness * p.width
        return load[5, :] * 6 / (area * p.thickness), load[4, :] * 6 / (area * p.width), load[0, :] / area


class Wire(Flexible):
    """A round wire or rod."""

    kind: Literal["wire"]
    """A wire or rod of round section."""
    diameter: Length
    """Of the section."""

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix:
        """[C] about the free end (6, 6). Source: S1 eq. (24)."""
        return flexure.wire_compliance(p.length, p.diameter, m.young, m.poisson)

    def stress(self, load: Matrix, p: SimpleNamespace) -> tuple[Matrix, Matrix, Matrix]:
        """Bending about z and y and tension [Pa] of section loads (6, n) in its frame."""
        bending = 32 / (ca.pi * p.diameter**3)
        return load[5, :] * bending, load[4, :] * bending, load[0, :] / (ca.pi * p.diameter**2 / 4)


class Strut(Flexible):
    """Wire, rod and wire in line, as of a hexapod."""

    kind: Literal["strut"]
    """A rod between two equal wires; both wires are part of `length`."""
    wire_length: Length
    """Of each wire."""
    wire_diameter: Length
    """Of each wire."""
    rod_diameter: Length
    """Of the rod between them."""

    @model_validator(mode="after")
    def _wires_fit(self) -> Strut:
        if 2 * self.wire_length.si >= self.length.si:
            raise ValueError("wire_length: two wires must fit in the length of the strut")
        return self

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix:
        """[C] about the free end (6, 6). Source: S1 section 5.2."""
        wire = flexure.wire_compliance(p.wire_length, p.wire_diameter, m.young, m.poisson)
        rod = flexure.wire_compliance(p.length - 2 * p.wire_length, p.rod_diameter, m.young, m.poisson)
        lower = move(wire, None, (p.wire_length - p.length, 0, 0))
        return series((lower, move(rod, None, (-p.wire_length, 0, 0)), wire))

    def stress(self, load: Matrix, p: SimpleNamespace) -> tuple[Matrix, Matrix, Matrix]:
        """Bending about z and y and tension [Pa] of the wires at the strut's ends."""
        bending = 32 / (ca.pi * p.wire_diameter**3)
        return load[5, :] * bending, load[4, :] * bending, load[0, :] / (ca.pi * p.wire_diameter**2 / 4)


Compliant = Annotated[Quantity, In(None)]


class Compliance(Joining):
    """A flexure by its compliance about its free end, such as one from finite elements or a notch by its equations."""

    kind: Literal["compliance"]
    """A compliance matrix of one's own; what is left out is zero, and by reciprocity given once."""
    theta_x_per_M_x: Annotated[Quantity, In("rad/(N*m)", positive=True)]
    """Torsion."""
    theta_y_per_M_y: Annotated[Quantity, In("rad/(N*m)", positive=True)]
    """Rotation about y."""
    theta_z_per_M_z: Annotated[Quantity, In("rad/(N*m)", positive=True)]
    """Rotation about z."""
    delta_x_per_F_x: Annotated[Quantity, In("m/N", positive=True)]
    """Extension."""
    delta_y_per_F_y: Annotated[Quantity, In("m/N", positive=True)]
    """Deflection along y."""
    delta_z_per_F_z: Annotated[Quantity, In("m/N", positive=True)]
    """Deflection along z."""
    theta_z_per_F_y: Annotated[Quantity, In("rad/N")] = Quantity(0.0, "0 rad/N")
    """Rotation about z per force along y, which is delta_y per M_z."""
    theta_y_per_F_z: Annotated[Quantity, In("rad/N")] = Quantity(0.0, "0 rad/N")
    """Rotation about y per force along z, which is delta_z per M_y."""
    theta_x_per_F_z: Annotated[Quantity, In("rad/N")] = Quantity(0.0, "0 rad/N")
    """Torsion per force along z, which is delta_z per M_x."""

    @model_validator(mode="after")
    def _stores_energy(self) -> Compliance:
        p = SimpleNamespace(**{k: v.si for k in type(self).model_fields if isinstance(v := getattr(self, k), Quantity)})
        C = ca.DM(self.compliance(p, SimpleNamespace())).full()[
            [3, 4, 5, 0, 1, 2]
        ]  # deflection per load, now symmetric
        if np.linalg.eigvalsh(C / np.sqrt(np.outer(np.diag(C), np.diag(C)))).min() <= 0:
            raise ValueError(
                "the compliance is not positive definite: a load would gain energy from it; check the couplings"
            )
        return self

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix:
        """[C] about the free end (6, 6), twist per wrench."""
        z, y, x = p.theta_z_per_F_y, p.theta_y_per_F_z, p.theta_x_per_F_z
        rows = [
            [0, 0, x, p.theta_x_per_M_x, 0, 0],
            [0, 0, y, 0, p.theta_y_per_M_y, 0],
            [0, z, 0, 0, 0, p.theta_z_per_M_z],
            [p.delta_x_per_F_x, 0, 0, 0, 0, 0],
            [0, p.delta_y_per_F_y, 0, 0, 0, z],
            [0, 0, p.delta_z_per_F_z, x, y, 0],
        ]
        return ca.vertcat(*(ca.horzcat(*row) for row in rows))


class ComplianceMatrix(Joining):
    """A flexure by its whole compliance matrix about its free end, in its own frame."""

    kind: Literal["matrix"]
    """A compliance matrix of one's own, by all its entries."""
    compliance_si: tuple[tuple[float, float, float, float, float, float], ...] = Field(min_length=6, max_length=6)
    """Twist (theta_x, theta_y, theta_z, delta_x, delta_y, delta_z) per wrench (F_x, F_y, F_z, M_x, M_y, M_z), in rad, m, N, N m."""

    @model_validator(mode="after")
    def _stores_energy(self) -> ComplianceMatrix:
        C = np.array(self.compliance_si)[[3, 4, 5, 0, 1, 2]]  # deflection per load, symmetric by reciprocity
        size = np.sqrt(np.abs(np.outer(np.diag(C), np.diag(C))))
        if (
            np.any(np.diag(C) <= 0)
            or np.abs((C - C.T) / size).max() > 1e-6
            or np.linalg.eigvalsh((C + C.T) / size).min() <= 0
        ):
            raise ValueError("compliance_si: is not symmetric and positive: a load would gain energy from it")
        return self

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix:
        """[C] about the free end (6, 6)."""
        return ca.DM(np.array(self.compliance_si))


AnyElement = Annotated[Blade | Wire | Strut | Compliance | ComplianceMatrix, Field(discriminator="kind")]


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
    gain: Compliant
    """Force or displacement per drive, such as "0.2 N/V" or "1 um/V"."""
    low: Compliant
    """Lowest drive; its unit is that of the drive."""
    high: Compliant
    """Highest drive."""
    time_constant: Annotated[Quantity, In("ms", positive=True)] | None = None
    """Time constant with which the force or displacement follows the drive; left out: at once."""
    stiffness: Annotated[Quantity, In("N/um", positive=True)] | None = None
    """Stiffness of a stack beside its blocked force, along its direction."""
    travel: Annotated[Quantity, In("um", positive=True)]
    """Largest travel to both sides; a limit."""
    pattern: str = ""
    """The pattern by which it is copied."""

    @model_validator(mode="after")
    def _fits_together(self) -> Actuator:
        faults = []
        drive = written_unit(self.low.text)
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


@dataclass(frozen=True)
class Placed:
    """One copy of an element or actuator: its section, its number `p` in it, and by which angle it is turned."""

    section: Any
    index: int  # in the file
    name: str
    first: int
    second: int
    turn: Matrix


class Mechanism(Device):
    """Drive -> force or displacement -> motion of all bodies -> pose of the output point."""

    kind: Literal["mechanism"]
    """Rigid bodies and flexures."""
    material: tuple[Material, ...] = ()
    """`[[material]]` tables."""
    pattern: tuple[Pattern, ...] = ()
    """`[[pattern]]` tables."""
    body: tuple[Body, ...] = Field(min_length=1)
    """`[[body]]` tables."""
    element: tuple[AnyElement, ...] = Field(min_length=1)
    """`[[element]]` tables."""
    actuator: tuple[Actuator, ...] = Field(min_length=1)
    """`[[actuator]]` tables: all push, or all prescribe displacements."""
    output: Output
    """`[output]`: what is followed."""

    @model_validator(mode="after")
    def _refers_to_what_there_is(self) -> Mechanism:
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
        if not faults and len(self.output.channels) != len(self.placed_actuators):
            counts = f"{len(self.output.channels)} channels, {len(self.placed_actuators)} actuators"
            faults.append(f"output.channels: {counts}; follow as many channels as there are actuators")
        if not faults and (loose := mechanism.loose_bodies(len(self.bodies), self._joints)):
            faults.append(f"body: nothing joins {', '.join(self.bodies[i] for i in loose)} to the ground")
        if faults:
            raise ValueError("; ".join(faults))
        return self

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
        names = []
        for b in self.body:
            times = next((q.times for q in self.pattern if q.name == b.pattern), 0)
            names += [f"{b.name}_{k + 1}" for k in range(times)] if times else [b.name]
        return tuple(names)

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

    def _copies(self, sections: Iterable[Any], first: str, second: str) -> tuple[Placed, ...]:
        placed = []
        for index, section in enumerate(sections):
            pattern = next((q for q in self.pattern if q.name == section.pattern), None)
            angles = [0.0] if pattern is None else [a.si for a in pattern.angles]
            if pattern is not None and not angles:
                angles = [2 * np.pi * k / pattern.times for k in range(pattern.times)]
            for k, angle in enumerate(angles, start=1):
                ends = [self._number(getattr(section, key, GROUND_NAME), section.pattern, k) for key in (first, second)]
                name = section.name if pattern is None else f"{section.name}_{k}"
                numbers = [GROUND if n is None else n for n in ends]
                placed.append(Placed(section, index, name, numbers[0], numbers[1], ca.DM(rotation_z(angle))))
        return tuple(placed)

    @cached_property
    def placed_elements(self) -> tuple[Placed, ...]:
        """Every copy of every element."""
        return self._copies(self.element, "from_", "to")

    @cached_property
    def placed_actuators(self) -> tuple[Placed, ...]:
        """Every copy of every actuator."""
        return self._copies(self.actuator, "against", "on")

    @property
    def _joints(self) -> list[Element]:
        """Who is joined to whom."""
        return [Element(e.first, e.second, ca.DM.eye(6)) for e in self.placed_elements]

    def physics(self, p: SimpleNamespace) -> BalancedPhysics:
        """The condensed mechanism with the values `p`."""
        return Condensed(self, p).physics()


class Condensed:
    """The equations of a mechanism with the values `p`: motion of all bodies per displacement of the actuated axes."""

    def __init__(self, device: Mechanism, p: SimpleNamespace) -> None:
        self.device, self.p = device, p
        self.pushes = device.actuator[0].kind == "force"
        materials = {m.name: q for m, q in zip(device.material, p.material, strict=True)}
        self.frames = [ca.mtimes(e.turn, e.section.frame) for e in device.placed_elements]
        self.ends = [ca.mtimes(e.turn, ca.vertcat(*p.element[e.index].at)) for e in device.placed_elements]
        stiffness = []
        for e, R, end in zip(device.placed_elements, self.frames, self.ends, strict=True):
            own = p.element[e.index]
            C = e.section.compliance(own, materials.get(getattr(e.section, "material", ""), SimpleNamespace()))
            stiffness.append(move(inverse(C), R, end))
        self.elements = [Element(e.first, e.second, K) for e, K in zip(device.placed_elements, stiffness, strict=True)]
        self.directions = [ca.mtimes(a.turn, _unit(a.section.along)) for a in device.placed_actuators]
        n = len(self.directions)
        loads: dict[int, Matrix] = {}

        def push(body: int, column: int, wrench: Matrix) -> None:
            if body != GROUND:
                loads.setdefault(body, ca.SX.zeros(6, n))[:, column] += wrench

        self.prescribed: list[Matrix | None] = [None] * len(self.elements)  # m (6, n) of each element
        for i, (a, direction) in enumerate(zip(device.placed_actuators, self.directions, strict=True)):
            if self.pushes:
                wrench = mechanism.point_force(self._point(a), direction)
                push(a.second, i, wrench)
                push(a.first, i, -wrench)
                continue
            k = next(k for k, e in enumerate(device.placed_elements) if e.name == self._moved(a))
            m = self.prescribed[k]
            m = ca.SX.zeros(6, n) if m is None else m
            m[3:, i] = direction
            self.prescribed[k] = m
            wrench = ca.mtimes(self.elements[k].stiffness, ca.vertcat(ca.DM.zeros(3, 1), direction))
            push(self.elements[k].second, i, wrench)
            push(self.elements[k].first, i, -wrench)
        per_input = mechanism.twists(len(device.bodies), self.elements, loads, device.size)
        if self.pushes:
            travel = ca.vertcat(*(self._travel(i, per_input) for i in range(n)))
            self.stiffness = ca.solve(travel * 1e6, ca.DM.eye(n)) * 1e6  # [N/m] force per displacement of the axes
            self.twists = [ca.mtimes(T, self.stiffness) for T in per_input]
        else:
            self.stiffness, self.twists = ca.DM.eye(n), per_input

    def _point(self, a: Placed) -> Matrix:
        return ca.mtimes(a.turn, ca.vertcat(*self.p.actuator[a.index].at))

    def _moved(self, a: Placed) -> str:
        """The name of the element that a displacement actuator moves."""
        return a.section.on if not a.section.pattern else f"{a.section.on}_{a.name.rpartition('_')[2]}"

    def _travel(self, i: int, twists: list[Matrix]) -> Matrix:
        """(1, n) travel of actuator i."""
        a = self.device.placed_actuators[i]
        row = mechanism.point_motion(self._point(a), self.directions[i])
        ends = [ca.mtimes(row, twists[b]) if b != GROUND else 0 for b in (a.second, a.first)]
        return ends[0] - ends[1]

    @property
    def jacobian(self) -> Matrix:
        """(channels, n): motion of the output point per displacement of the actuated axes."""
        output = self.device.output
        T = self.twists[self.device.bodies.index(output.body)]
        moved = ca.mtimes(_at(ca.vertcat(*self.p.output.at)), T)
        return moved[[TWIST.index(c) for c in output.channels], :]

    @property
    def output_compliance(self) -> Matrix:
        """(6, 6) twist of the output point per wrench there, the drives held."""
        device, at = self.device, _at(ca.vertcat(*self.p.output.at))
        k = device.bodies.index(device.output.body)
        T = mechanism.twists(
            len(device.bodies), self._held_elements(), {k: inverse_at(ca.vertcat(*self.p.output.at))}, device.size
        )
        return ca.mtimes(at, T[k])

    def _held_elements(self) -> list[Element]:
        """The elements, and the stiffness of the actuators beside them."""
        added = []
        for i, a in enumerate(self.device.placed_actuators):
            k = getattr(self.p.actuator[a.index], "stiffness", None)
            if k is not None:
                point, n = self._point(a), self.directions[i]
                added.append(
                    Element(
                        a.first,
                        a.second,
                        k * ca.mtimes(mechanism.point_force(point, n), mechanism.point_motion(point, n)),
                    )
                )
        return self.elements + added

    def wrench(self, k: int) -> Matrix:
        """(6, n) load of element k per displacement of the axes, on its free end, in the global frame."""
        e = self.elements[k]
        T = [ca.SX.zeros(6, len(self.directions)) if b == GROUND else self.twists[b] for b in (e.second, e.first)]
        m = self.prescribed[k]
        return ca.mtimes(e.stiffness, T[0] - T[1] - (0 if m is None else m))

    def stresses(self) -> list[tuple[str, Quantity, Matrix, Matrix, Matrix]]:
        """Of every flexure whose material has a limit: its name, the limit, and (2, n) bending about z and y and tension at both ends
        per displacement of the axes [Pa/m]."""
        device, found = self.device, []
        limits = {m.name: m.stress_limit for m in device.material}
        for k, e in enumerate(device.placed_elements):
            limit = limits.get(getattr(e.section, "material", ""))
            if limit is None:
                continue
            own = self.p.element[e.index]
            rows = []
            for back in (0, own.length):
                local = ca.mtimes(
                    inverse_adjoint(self.frames[k], self.ends[k] - back * self.frames[k][:, 0]), self.wrench(k)
                )
                rows.append(e.section.stress(local, own))
            found.append((e.name, limit, *(ca.vertcat(*parts) for parts in zip(*rows, strict=True))))
        return found

    def physics(self) -> BalancedPhysics:
        """As a device's physics."""
        device, actuators, p = self.device, self.device.placed_actuators, self.p
        n, axes = len(actuators), tuple(a.name for a in actuators)
        own = [p.actuator[a.index] for a in actuators]
        sections = [a.section for a in actuators]
        gain = ca.vertcat(*(q.gain for q in own))
        stack = ca.vertcat(*(getattr(q, "stiffness", None) or 0.0 for q in own))
        units = tuple(written_unit(s.low.text) for s in sections)
        sizes = tuple(max(abs(s.low.si), abs(s.high.si)) for s in sections)
        drive = Signal("drive", "drive", axes, units, "u_", ca.SX.sym("u", n), sizes)
        lags = [getattr(q, "time_constant", None) for q in own]
        lagging = [i for i, tau in enumerate(lags) if tau is not None]
        if lagging and len(lagging) < n:
            raise ValueError("all actuators have a time_constant, or none")
        state = Signal("state", "amplifier output", axes, units, "x_", ca.SX.sym("x", n), sizes) if lagging else None
        stresses = self.stresses()
        force_unit = "N" if self.pushes else "um"
        travel = max(s.travel.si for s in sections)
        K, J = self.stiffness, self.jacobian

        def limits(signal: SimpleNamespace) -> list[Limit]:
            found = []
            for i, s in enumerate(sections):
                label = f"drive of {axes[i]}"
                found.append(
                    Limit(f"drive_{axes[i]}", label, (axes[i],), units[i], signal.drive[i], s.low.si, s.high.si)
                )
                if state is not None:
                    label = f"amplifier output of {axes[i]}"
                    found.append(
                        Limit(f"output_{axes[i]}", label, (axes[i],), units[i], signal.state[i], s.low.si, s.high.si)
                    )
                label, reach = f"travel of {axes[i]}", s.travel.si
                found.append(Limit(f"travel_{axes[i]}", label, (axes[i],), "um", signal.displacement[i], -reach, reach))
            for name, limit, about_z, about_y, tension in stresses:
                z, y, t = (ca.mtimes(part, signal.mechanism_displacement) for part in (about_z, about_y, tension))
                floor = (1e-9 * limit.si) ** 2  # so that the derivative exists at home
                stress = ca.sqrt(z**2 + y**2 + floor) + ca.fabs(t)
                found.append(
                    Limit(
                        f"stress_{name}",
                        f"stress of {name}",
                        ("fixed_end", "free_end")[::-1],
                        "MPa",
                        stress,
                        None,
                        limit.si,
                    )
                )
            return found

        channels = device.output.channels
        turn = [c.startswith("theta") for c in channels]
        reach = ca.DM(ca.evalf(ca.fabs(ca.SX(J)))).full().sum(axis=1) * travel if not ca.symvar(ca.SX(J)) else None
        scale = (
            tuple(1e-3 if t else travel for t in turn) if reach is None else tuple(float(r) or travel for r in reach)
        )
        force_scale = float(max(abs(s.gain.si) * size for s, size in zip(sections, sizes, strict=True)))
        return BalancedPhysics(
            axes=axes, components=channels, pose_units=tuple("urad" if t else "um" for t in turn), pose_scale=scale,
            drive=drive, state=state, rest=(0.0,) * (n if lagging else 0), displacement_scale=travel, force_scale=force_scale,
            force_unit=force_unit, bipolar=any(s.low.si < 0 for s in sections),
            rates=(lambda x, u: (u - x) / ca.vertcat(*lags)) if lagging else (lambda x, u: ca.SX(0, 1)),
            force=lambda u, x, d: gain * (x if lagging else u),
            restoring_force=lambda d: ca.mtimes(K, d) + stack * d,
            pose=lambda d: ca.mtimes(J, d), limits=limits,
        )  # fmt: skip


def _unit(direction: Direction) -> Matrix:
    return ca.DM(np.array(direction) / np.linalg.norm(direction))


def _at(point: Matrix) -> Matrix:
    """(6, 6): twist at a point (rotation; displacement of the point) per twist at the origin."""
    return ca.vertcat(ca.horzcat(ca.DM.eye(3), ca.DM.zeros(3, 3)), ca.horzcat(-ca.skew(point), ca.DM.eye(3)))


def inverse_at(point: Matrix) -> Matrix:
    """(6, 6): wrench at the origin per wrench (force; moment) at a point."""
    return ca.vertcat(ca.horzcat(ca.DM.eye(3), ca.DM.zeros(3, 3)), ca.horzcat(ca.skew(point), ca.DM.eye(3)))


def summary(device: Mechanism) -> list[str]:
    """What `ctrlgen check` prints of a mechanism: its parts, and how stiff it is at the output point."""
    c = Condensed(device, device.values())
    C = ca.DM(ca.evalf(ca.SX(c.output_compliance))).full()
    lines = [
        f"{len(device.bodies)} bodies, {len(device.placed_elements)} flexures, {len(device.placed_actuators)} actuators"
    ]
    forces = ", ".join(f"{name} {show(1 / C[3 + i, i], 'N/um')}" for i, name in enumerate("xyz"))
    moments = ", ".join(f"{name} {show(1 / C[i, 3 + i], 'N*m/rad')}" for i, name in enumerate("xyz"))
    lines.append(f"stiffness at the output point: {forces}; about {moments}")
    J = ca.DM(ca.evalf(ca.SX(c.jacobian))).full()
    for channel, row in zip(device.output.channels, J, strict=True):
        unit = "urad/um" if channel.startswith("theta") else "um/um"
        parts = ", ".join(
            f"{show(v, unit)} per {a.name}" for a, v in zip(device.placed_actuators, row, strict=True) if abs(v) > 1e-9
        )
        lines.append(f"{channel}: {parts or 'not moved'}")
    return lines

"""The tables of a mechanism's file beside its elements: materials, patterns, bodies, what moves them, what is followed."""

from __future__ import annotations

from typing import Annotated, Literal

import casadi as ca
import numpy as np
from pydantic import Field, model_validator

from ctrlgen.core.names import Name
from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.driven import Driven, PerDrive
from ctrlgen.devices.load import GROUND_NAME
from ctrlgen.devices.place import Direction, Place
from ctrlgen.devices.section import Section
from ctrlgen.devices.travel import Travel
from ctrlgen.physics.screw import Matrix, TwistComponent, WrenchComponent, rotation_z

Inertia = Annotated[Quantity, In("kg*mm^2", positive=True)]
STIFFEST, SOFTEST = 1300e9, 1e6  # Pa: beyond diamond and below rubber
DENSEST, LIGHTEST = 23e3, 10.0  # kg/m^3: beyond osmium and below foams
SHEAR = (0.1, 1.0)  # of Young's modulus: from layered crystals to cubic ones along their soft axis
STRONGEST = 0.1  # of Young's modulus: what bonds of a perfect crystal bear
FLAT = 0.01  # a flat plate has the sum; its numbers are rounded


class Material(Section):
    """`[[material]]`: what flexures are made of."""

    name: Name
    """By which elements name it."""
    young: Annotated[Quantity, In("GPa", positive=True)]
    """Young's modulus."""
    poisson: Annotated[Quantity, In("1", low=0.0, high=0.5)]
    """Poisson's ratio."""
    shear: Annotated[Quantity, In("GPa", positive=True)] | None = None
    """Shear modulus of a crystal, such as silicon along <100>. Left out: young/(2 (1 + poisson))."""
    density: Annotated[Quantity, In("kg/m^3", positive=True)] | None = None
    """Mass per volume: with it, its blades, wires and struts have mass. Left out: none has."""
    stress_limit: Annotated[Quantity, In("MPa", positive=True)] | None = None
    """Largest stress in its blades, wires and struts and in the necks of its hinges; a limit where it is given."""
    expansion: Annotated[Quantity, In("1/K", positive=True)] | None = None
    """Coefficient of thermal expansion at 0 degC; needed where a thermal actuator heats it."""
    expansion_slope: Annotated[Quantity, In("1/K^2", low=0.0)] | None = None
    """Increase of the coefficient per kelvin, given with `expansion`."""

    @model_validator(mode="after")
    def _expands(self) -> Material:
        if (self.expansion is None) != (self.expansion_slope is None):
            raise ValueError(
                'expansion and expansion_slope belong together; write expansion_slope = "0 1/K^2" where it is constant'
            )
        return self

    def notes(self) -> list[str]:
        """Numbers that no material has, as a wrong unit makes them."""
        young, notes = self.young.si, []
        if not SOFTEST <= young <= STIFFEST:
            notes.append(
                f"young = {self.young.text!r} is {'above diamond' if young > STIFFEST else 'below rubber'}: check the unit"
            )
        if self.shear is not None and not SHEAR[0] * young <= self.shear.si <= SHEAR[1] * young:
            notes.append(f"shear = {self.shear.text!r} is {self.shear.si / young:.2g} times young: check the unit")
        if self.density is not None and not LIGHTEST <= self.density.si <= DENSEST:
            word = "above osmium" if self.density.si > DENSEST else "below foams"
            notes.append(f"density = {self.density.text!r} is {word}: check the unit")
        if self.stress_limit is not None and self.stress_limit.si > STRONGEST * young:
            notes.append(
                f"stress_limit = {self.stress_limit.text!r} is above a tenth of young, which nothing bears: check the unit"
            )
        return notes


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
    """For the natural frequencies, and with a table `[dynamics]` for the model; a body without mass follows the others."""
    centre: Place | None = None
    """Centre of mass in the global frame. Left out: the origin."""
    inertia: tuple[Inertia, Inertia, Inertia] | None = None
    """Moments of inertia about axes through the centre of mass that are parallel to x, y and z as it is drawn."""

    @model_validator(mode="after")
    def _turns_as_it_moves(self) -> Body:
        if (self.mass is None) != (self.inertia is None):
            raise ValueError("mass and inertia belong together; give both or none")
        if self.inertia is not None:
            I = sorted((q.si, axis) for q, axis in zip(self.inertia, "xyz", strict=True))
            if I[2][0] > (I[0][0] + I[1][0]) * (1 + FLAT):
                raise ValueError(
                    f"inertia: that about {I[2][1]} is above the sum of the other two, which no body has; check the order and the units"
                )
        return self


class Actuator(Driven):
    """`[[actuator]]`: what moves the mechanism. One gives one axis, named after it."""

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
    stiffness: Annotated[Quantity, In("N/um", positive=True)] | None = None
    """Stiffness of a stack beside its blocked force, along its direction."""
    travel: Travel
    """Largest travel to both sides, such as "500 um", or its ends, such as ["-10 um", "60 um"]; a limit."""
    pattern: str = ""
    """The pattern by which it is copied."""

    @model_validator(mode="after")
    def _fits_together(self) -> Actuator:
        faults = self.gain_faults(self.gain, "N" if self.kind == "force" else "m", self.kind)
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
    channels: tuple[TwistComponent, ...] = Field(min_length=1)
    """Components of its motion, as many as actuators: rotations, and displacements of the point."""


class Reading(Section):
    """`[[reading]]`: a reading beside those of the output: of the displacement of a point of a body, of its rotation, or of the load in
    an element."""

    name: Name
    """Of the reading, as in the column "reading.NAME" of a recording, or as a `[[sensor]]` table names it."""
    body: str | None = None
    """The body that is looked at."""
    against: str = GROUND_NAME
    """The body on which the sensor stands."""
    at: Place | None = None
    """The point whose displacement is read, in the global frame."""
    along: Direction | None = None
    """Direction of the displacement that is read; of any length."""
    about: Direction | None = None
    """Axis of the rotation that is read, in place of `at` and `along`."""
    of: str | None = None
    """The element whose load is read, in place of `body` and what is read of it; of the same pattern."""
    load: WrenchComponent | None = None
    """Component of the load on its free end, in its own frame, x along it: F_x is the tension. Left out: F_x."""
    pattern: str = ""
    """The pattern by which it is copied."""

    @model_validator(mode="after")
    def _reads_one_thing(self) -> Reading:
        if self.of is not None:
            return self._reads_a_load()
        if self.load is not None:
            raise ValueError("load: belongs to of, the element whose load is read")
        if self.body is None:
            raise ValueError(
                "body: is missing; name the body that is looked at, or with of the element whose load is read"
            )
        if (self.about is None) == (self.along is None):
            raise ValueError("give either along (and at), for a displacement, or about, for a rotation")
        if (self.along is None) != (self.at is None):
            raise ValueError(
                "at and along belong together: say which point's displacement is read; a rotation has no point"
            )
        if np.linalg.norm(self.direction) == 0:
            raise ValueError(f"{'along' if self.about is None else 'about'}: is zero; give a direction")
        return self

    def _reads_a_load(self) -> Reading:
        given = [key for key in ("body", "at", "along", "about") if getattr(self, key) is not None]
        given += ["against"] if self.against != GROUND_NAME else []
        if given:
            raise ValueError(f"of: the load of an element is read by itself; leave out {', '.join(given)}")
        return self

    @property
    def unit(self) -> str:
        """In which it is reported."""
        if self.of is not None:
            return "N*m" if (self.load or "F_x").startswith("M") else "N"
        return "um" if self.about is None else "urad"

    @property
    def direction(self) -> Direction:
        """The direction that is read: `along` or `about`."""
        return self.along or self.about or (0.0, 0.0, 0.0)


class Dynamics(Section):
    """`[dynamics]`: the model has the inertia of the bodies, condensed to the actuators. Left out: it is in balance at every moment."""

    damping_ratio: Annotated[Quantity, In("1", low=0.0, high=1.0)]
    """Of every mode of the condensed mechanism, such as "2 %"."""
    modes_below: Annotated[Quantity, In("Hz", positive=True)] | None = None
    """Up to this frequency the Bode plot and `ctrlgen simulate` have the modes of the bodies, as many as the response needs to be right to
    1 %, and what they leave along a path is told. Left out: up to five times the fastest condensed mode."""

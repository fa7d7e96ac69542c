"""The flexures of a mechanism: what each joins, where, and how compliant it is about its free end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import Field, StrictBool, model_validator

from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.hinge import Hinge
from ctrlgen.devices.section import Section
from ctrlgen.physics import circular_hinge, flexure
from ctrlgen.physics import rigid_bodies as mechanism
from ctrlgen.physics.screw import Matrix, inverse, move, series
from ctrlgen.physics.second_order_flexure import Segment

Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
Length = Annotated[Quantity, In("mm", positive=True)]
Coordinate = Annotated[Quantity, In("mm")]
Place = tuple[Coordinate, Coordinate, Coordinate]
Direction = tuple[float, float, float]
TWIST = ("theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z")
STIFF = 0.01  # of the largest compliance of a mechanism's flexures, below which a direction counts as held


@dataclass(frozen=True, eq=False)
class FlexureSection:
    """A section of a flexure, `back` [m] from its free end: area [m^2], section moduli of bending about y and z and of torsion
    [m^3]."""

    name: str
    back: Any
    area: Any
    about_y: Any
    about_z: Any
    torsion: Any

    def stresses(self, load: Matrix) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """Bending about y and z, tension and torsion [Pa] by the loads (6, n) [N, N m] there, in the flexure's frame."""
        return load[4, :] / self.about_y, load[5, :] / self.about_z, load[0, :] / self.area, load[3, :] / self.torsion


class Joining(Section):
    """What all elements have: whom they join, and where."""

    ideal: ClassVar[tuple[str, ...] | None] = None  # what the ideal flexure holds, where there is one

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
    across: Direction | None = None
    """A direction that fixes its y axis, along which a blade is thin; not parallel to `along`. Left out: y, or z where `along` is y."""
    pattern: str = ""
    """The pattern by which it is copied."""

    @model_validator(mode="after")
    def _has_a_frame(self) -> Joining:
        if np.linalg.norm(np.cross(self.along, self.thin)) < 1e-6 * np.linalg.norm(self.along) * np.linalg.norm(
            self.thin
        ):
            raise ValueError("across: is parallel to along, or one of them is zero; give two directions")
        return self

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix | None:
        """[C] about its free end (6, 6), twist per wrench, with its numbers `p` and its material's `m`; None where it has none."""
        raise NotImplementedError

    def stiffness(self, C: Matrix | None, p: SimpleNamespace) -> Matrix:
        """[K] about its free end (6, 6), wrench per twist, from its compliance `C`."""
        return inverse(C)

    def cubic_terms(self, p: SimpleNamespace) -> dict[int, Any]:
        """Its forces that grow with the cube: place in the twist -> k_3 of the wrench k_3 e^3 [N/m^3, N m/rad^3]."""
        return {}

    def reach(self, p: SimpleNamespace) -> Any:
        """Distance between its ends [m]; None where it says none."""
        return None

    def segments(self, p: SimpleNamespace, m: SimpleNamespace) -> tuple[Segment, ...]:
        """The uniform pieces that it consists of, from its fixed end; none where it yields at one point, its pivot."""
        return ()

    def pivot(self, p: SimpleNamespace) -> Any:
        """Distance from its free end, toward the fixed one, of the point at which it holds its ideal directions [m]."""
        return 0.0

    @property
    def thin(self) -> Direction:
        """`across`, or what stands for it."""
        if self.across is not None:
            return self.across
        return (0.0, 0.0, 1.0) if abs(self.along[1]) > 0.9 * np.linalg.norm(self.along) else (0.0, 1.0, 0.0)

    @property
    def frame(self) -> Matrix:
        """R (3, 3) from its own frame to the global one."""
        return mechanism.frame(ca.DM(self.along), ca.DM(self.thin))

    def constrained(self, C: np.ndarray, largest: float) -> np.ndarray:
        """(m, 6): the directions of relative twist at its free end, in its frame, that count as held: those of the ideal flexure, or
        those in which its compliance C (6, 6), turns counted as displacements, is below a share `STIFF` of the `largest` one in the
        mechanism."""
        if self.ideal is not None:
            return np.eye(6)[[TWIST.index(name) for name in self.ideal]]
        values, directions = np.linalg.eigh((C + C.T) / 2)
        return directions[:, values < STIFF * largest].T


class Flexible(Joining):
    """A flexure made of a material."""

    material: str
    """Name of its material."""

    def sections(self, p: SimpleNamespace) -> tuple[FlexureSection, ...]:
        """The sections at which it may be stressed most."""
        raise NotImplementedError

    @staticmethod
    def largest_stress(about_y: Matrix, about_z: Matrix, tension: Matrix, shear: Matrix, floor: float) -> Matrix:
        """The largest stress of a section [Pa], from the stresses by bending, tension and torsion."""
        raise NotImplementedError


class Beam(Flexible):
    """A flexure of some length, stressed most at its ends."""

    length: Length
    """Length between its ends."""
    geometric_stiffening: StrictBool = False
    """Whether it stretches where its ends are held as it bends, and an axial load makes it stiffer or softer across."""

    def reach(self, p: SimpleNamespace) -> Any:
        """The length between its ends [m]."""
        return p.length

    def section(self, p: SimpleNamespace) -> Sequence[Any]:
        """Area [m^2] and section moduli of bending about y and z and of torsion [m^3] at its ends."""
        raise NotImplementedError

    def sections(self, p: SimpleNamespace) -> tuple[FlexureSection, ...]:
        """The sections at both ends."""
        section = self.section(p)
        return FlexureSection("free_end", 0.0, *section), FlexureSection("fixed_end", p.length, *section)


class Blade(Beam):
    """A leaf spring."""

    ideal = ("delta_x", "delta_z", "theta_y")
    largest_stress = staticmethod(flexure.rectangular_stress)

    kind: Literal["blade"]
    """A blade: thin along its y axis."""
    thickness: Length
    """Along y."""
    width: Length
    """Along z, not below the thickness."""

    @model_validator(mode="after")
    def _is_thin(self) -> Blade:
        if self.thickness.si > self.width.si:
            raise ValueError(
                f"thickness = {self.thickness.text!r} is above width = {self.width.text!r}; turn the blade by across"
            )
        return self

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix:
        """[C] about the free end (6, 6). Source: S1 eq. (21)-(23)."""
        return flexure.blade_compliance(p.length, p.thickness, p.width, m.young, m.poisson)

    def segments(self, p: SimpleNamespace, m: SimpleNamespace) -> tuple[Segment, ...]:
        """One piece of rectangular section."""
        return (Segment(p.length, *flexure.blade_rigidity(p.thickness, p.width, m.young, m.poisson)),)

    def section(self, p: SimpleNamespace) -> Sequence[Any]:
        """Area and section moduli of the rectangle."""
        return flexure.rectangular_section(p.thickness, p.width)


class Wire(Beam):
    """A round wire or rod."""

    ideal = ("delta_x",)
    largest_stress = staticmethod(flexure.round_stress)

    kind: Literal["wire"]
    """A wire or rod of round section."""
    diameter: Length
    """Of the section."""

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix:
        """[C] about the free end (6, 6). Source: S1 eq. (24)."""
        return flexure.wire_compliance(p.length, p.diameter, m.young, m.poisson)

    def segments(self, p: SimpleNamespace, m: SimpleNamespace) -> tuple[Segment, ...]:
        """One piece of round section."""
        return (Segment(p.length, *flexure.wire_rigidity(p.diameter, m.young, m.poisson)),)

    def section(self, p: SimpleNamespace) -> Sequence[Any]:
        """Area and section moduli of the round section."""
        area, bending, torsion = flexure.round_section(p.diameter)
        return area, bending, bending, torsion


class Strut(Beam):
    """Wire, rod and wire in line, as of a hexapod."""

    ideal = ("delta_x",)
    largest_stress = staticmethod(flexure.round_stress)

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

    def segments(self, p: SimpleNamespace, m: SimpleNamespace) -> tuple[Segment, ...]:
        """Three pieces: wire, rod, wire."""
        wire = Segment(p.wire_length, *flexure.wire_rigidity(p.wire_diameter, m.young, m.poisson))
        rod = flexure.wire_rigidity(p.rod_diameter, m.young, m.poisson)
        return wire, Segment(p.length - 2 * p.wire_length, *rod), wire

    def section(self, p: SimpleNamespace) -> Sequence[Any]:
        """Area and section moduli of its wires."""
        area, bending, torsion = flexure.round_section(p.wire_diameter)
        return area, bending, bending, torsion


class CircularHinge(Flexible):
    """A notch hinge: two circular cut-outs, thin along its y axis, so that it turns about z."""

    ideal = ("delta_x", "delta_y", "delta_z", "theta_x", "theta_y")
    largest_stress = staticmethod(flexure.rectangular_stress)

    kind: Literal["hinge"]
    """A right circular hinge by the equations of S2."""
    hinge: Hinge
    """Radius, neck and whose equations, as in `hinge = { kind = "circular", R = "2 mm", t = "0.3 mm", b = "8 mm" }`."""
    rotation_limit: Annotated[Quantity, In("deg", positive=True)] | None = None
    """Largest rotation to both sides; a limit where it is given."""

    @model_validator(mode="after")
    def _is_deep(self) -> CircularHinge:
        if self.hinge.b is None:
            raise ValueError('hinge.b: is missing; add it, such as b = "8 mm"')
        if self.hinge.b.si < self.hinge.t.si:
            raise ValueError("hinge.b: is below the neck t; turn the hinge by across")
        return self

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix:
        """[C] about the free end (6, 6): in the plane by S2's equations, out of it by beam theory.

        Torsion by Saint-Venant's stiffness with the neck's J/I_z, and beside it, of a hinge deeper than its neck is long, by strips
        across the depth that bend with their ends held, b^2/(12 C), C their deflection per force: an estimate, not compared with
        finite elements.
        """
        h = self.hinge.geometry(p.hinge, E=m.young, nu=m.poisson)
        plane = self.hinge.planar(p.hinge, E=m.young, nu=m.poisson)
        turn, across, coupled = circular_hinge.out_of_plane(h.R, h.t, h.b, h.E, h.G)
        held = circular_hinge.locked(h.R, h.t, h.b, h.E, h.G)
        saint_venant = h.G * flexure.torsion_ratio(h.t, h.b) / (h.E * plane[2, 2])
        twist = 1 / (saint_venant + h.b**2 / (12 * held))
        return _of_entries((twist, turn, plane[2, 2]), (plane[0, 0], plane[1, 1], across), plane[2, 1], coupled)

    def reach(self, p: SimpleNamespace) -> Any:
        """The length 2 R [m]."""
        return 2 * p.hinge.R

    def pivot(self, p: SimpleNamespace) -> Any:
        """R: it turns at its neck."""
        return p.hinge.R

    def sections(self, p: SimpleNamespace) -> tuple[FlexureSection, ...]:
        """The neck, where bending about z is K = (1 + t/2R)^(9/20) times that of a straight bar.

        Source: S. T. Smith, D. G. Chetwynd, Foundations of Ultraprecision Mechanism Design (1992), chapter 4.
        """
        R, t = p.hinge.R, p.hinge.t
        area, about_y, about_z, torsion = flexure.rectangular_section(t, p.hinge.b)
        return (FlexureSection("neck", R, area, about_y, about_z / (1 + t / (2 * R)) ** 0.45, torsion),)


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
    theta_z_per_F_y: Annotated[Quantity, In("rad/N")] | None = None
    """Rotation about z per force along y, which is delta_y per M_z. Left out: none."""
    theta_y_per_F_z: Annotated[Quantity, In("rad/N")] | None = None
    """Rotation about y per force along z, which is delta_z per M_y. Left out: none."""
    theta_x_per_F_z: Annotated[Quantity, In("rad/N")] | None = None
    """Torsion per force along z, which is delta_z per M_x. Left out: none."""

    @model_validator(mode="after")
    def _stores_energy(self) -> Compliance:
        given = ((key, getattr(self, key)) for key in type(self).model_fields)
        p = SimpleNamespace(**{key: value.si if isinstance(value, Quantity) else None for key, value in given})
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
        z, y, x = (0.0 if c is None else c for c in (p.theta_z_per_F_y, p.theta_y_per_F_z, p.theta_x_per_F_z))
        turns = (p.theta_x_per_M_x, p.theta_y_per_M_y, p.theta_z_per_M_z)
        return _of_entries(turns, (p.delta_x_per_F_x, p.delta_y_per_F_y, p.delta_z_per_F_z), z, y, x)


def _of_entries(turns: Sequence[Any], shifts: Sequence[Any], z: Any, y: Any, x: Any = 0.0) -> Matrix:
    """[C] (6, 6) of theta per M, delta per F, and theta_z/F_y = delta_y/M_z, theta_y/F_z = delta_z/M_y, theta_x/F_z = delta_z/M_x."""
    rows = [
        [0, 0, x, turns[0], 0, 0],
        [0, 0, y, 0, turns[1], 0],
        [0, z, 0, 0, 0, turns[2]],
        [shifts[0], 0, 0, 0, 0, 0],
        [0, shifts[1], 0, 0, 0, z],
        [0, 0, shifts[2], x, y, 0],
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
        """[C] about the free end (6, 6), as the file states it."""
        return ca.DM(np.array(self.compliance_si))

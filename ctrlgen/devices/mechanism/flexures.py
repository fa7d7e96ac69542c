"""The flexures of a mechanism that are made of a material: how compliant each is about its free end, and where it is stressed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import StrictBool, model_validator

from ctrlgen.core.percent import percent
from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.hinge import Hinge
from ctrlgen.devices.mechanism.joining import Joining, Length
from ctrlgen.devices.mechanism.stated_compliances import compliance_of_entries
from ctrlgen.physics import circular_hinge, flexure, held_flexure
from ctrlgen.physics.flexure import Segment
from ctrlgen.physics.held_flexure import THICKEST, WIDEST
from ctrlgen.physics.screw import Matrix

SLENDEST = 0.1  # of the width over the length: beyond it a slender blade is off by more than 2 % in bending and shear
USUAL = 0.3  # Poisson's ratio, where a note has none
DEEP = 0.03  # of a notch's stiffness: what its equations are right to


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

    def mean_shear(self, load: Matrix) -> tuple[Matrix, Matrix]:
        """Transverse force over area along y and z [Pa]."""
        return load[1, :] / self.area, load[2, :] / self.area


def stated_shear(material: SimpleNamespace) -> Any:
    """The shear modulus of a crystal [Pa]; None of a material that states none."""
    return getattr(material, "shear", None)


class Flexible(Joining):
    """A flexure made of a material."""

    material: str
    """Name of its material."""

    def sections(self, p: SimpleNamespace) -> tuple[FlexureSection, ...]:
        """The sections at which it may be stressed most."""
        raise NotImplementedError

    def room(self) -> tuple[float, float, float]:
        """Its length and its section along y and z [m], no larger than they are; zero where it says none."""
        return 0.0, 0.0, 0.0

    @staticmethod
    def largest_stress(about_y: Matrix, about_z: Matrix, tension: Matrix, shear: Matrix, floor: float) -> Matrix:
        """The largest stress of a section [Pa], from the stresses by bending, tension and torsion."""
        raise NotImplementedError

    @staticmethod
    def sheared_stress(bent: Sequence[Matrix], shear: Matrix, along: Sequence[Matrix]) -> Matrix:
        """The largest stress inside of a section [Pa], where transverse shear counts, which `largest_stress` leaves out."""
        raise NotImplementedError


class Beam(Flexible):
    """A flexure of some length, stressed most at its ends."""

    length: Length
    """Length between its ends."""
    geometric_stiffening: StrictBool = False
    """Whether it stretches where its ends are held as it bends, and an axial load makes it stiffer or softer across."""
    slender: StrictBool = False
    """Whether it is taken as slender, S1 eq. (21)-(24): no shear, and ends that may contract, curve across and warp."""

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix:
        """[C] about the free end (6, 6): that of its segments."""
        return flexure.segments_compliance(self.segments(p, m))

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
    sheared_stress = staticmethod(flexure.sheared_rectangle)

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

    def notes(self, held_length: float | None, poisson: float) -> list[str]:
        """Width and thickness against the length; of a slender blade what its held ends would change, from a tenth of the length on."""
        length = self.length.si if held_length is None else held_length
        wide, thick = self.width.si / length, self.thickness.si / length
        if self.slender:
            changed = "shear and held ends are left out (slender = true), which change its stiffness by more than 2 %"
            return [f"it is {wide:.2g} times as wide as it is long: {changed}"] if wide > SLENDEST else []
        notes = []
        for ratio, most, word in ((wide, WIDEST, "wide"), (thick, THICKEST, "thick")):
            if ratio > most:
                notes.append(
                    f"it is {ratio:.2g} times as {word} as it is long; its equations were compared with finite elements up to {most:g}"
                )
        return notes

    def room(self) -> tuple[float, float, float]:
        """Length, thickness and width."""
        return self.length.si, self.thickness.si, self.width.si

    def segments(self, p: SimpleNamespace, m: SimpleNamespace) -> tuple[Segment, ...]:
        """One piece of rectangular section. Source: `held_flexure`; slender, S1 eq. (21)-(23)."""
        if self.slender:
            return (flexure.blade_segment(p.length, p.thickness, p.width, m.young, m.poisson, stated_shear(m)),)
        whole = getattr(p, "held_length", None)
        if whole is None:
            return (held_flexure.held_blade(p.length, p.thickness, p.width, m.young, m.poisson, stated_shear(m)),)
        blade = held_flexure.held_blade(whole, p.thickness, p.width, m.young, m.poisson, stated_shear(m))
        return (replace(blade, length=p.length, whole=whole),)

    def section(self, p: SimpleNamespace) -> Sequence[Any]:
        """Area and section moduli of the rectangle."""
        return flexure.rectangular_section(p.thickness, p.width)


class Wire(Beam):
    """A round wire or rod."""

    ideal = ("delta_x",)
    largest_stress = staticmethod(flexure.round_stress)
    sheared_stress = staticmethod(flexure.sheared_circle)

    kind: Literal["wire"]
    """A wire or rod of round section."""
    diameter: Length
    """Of the section."""

    def room(self) -> tuple[float, float, float]:
        """Its length, and the square in its section."""
        return self.length.si, *[self.diameter.si / np.sqrt(2)] * 2

    def notes(self, held_length: float | None, poisson: float) -> list[str]:
        """Its diameter against its length, and what that changes."""
        return _thick(self.diameter.si / self.length.si, self.slender, "it is", poisson)

    def segments(self, p: SimpleNamespace, m: SimpleNamespace) -> tuple[Segment, ...]:
        """One piece of round section. Source: S1 eq. (24), with shear where it is not slender."""
        segment = flexure.wire_segment if self.slender else held_flexure.timoshenko_wire
        return (segment(p.length, p.diameter, m.young, m.poisson, stated_shear(m)),)

    def section(self, p: SimpleNamespace) -> Sequence[Any]:
        """Area and section moduli of the round section."""
        area, bending, torsion = flexure.round_section(p.diameter)
        return area, bending, bending, torsion


class Strut(Beam):
    """Wire, rod and wire in line, as of a hexapod."""

    ideal = ("delta_x",)
    largest_stress = staticmethod(flexure.round_stress)
    sheared_stress = staticmethod(flexure.sheared_circle)

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

    def room(self) -> tuple[float, float, float]:
        """Its length, and the square in the section of its thinner part."""
        return self.length.si, *[min(self.wire_diameter.si, self.rod_diameter.si) / np.sqrt(2)] * 2

    def notes(self, held_length: float | None, poisson: float) -> list[str]:
        """The diameter of its wires against their length, and what that changes."""
        return _thick(self.wire_diameter.si / self.wire_length.si, self.slender, "its wires are", poisson)

    def segments(self, p: SimpleNamespace, m: SimpleNamespace) -> tuple[Segment, ...]:
        """Three pieces, wire, rod, wire. Source: S1 section 5.2, with shear where it is not slender."""
        segment = flexure.wire_segment if self.slender else held_flexure.timoshenko_wire
        wire = segment(p.wire_length, p.wire_diameter, m.young, m.poisson, stated_shear(m))
        return wire, segment(p.length - 2 * p.wire_length, p.rod_diameter, m.young, m.poisson, stated_shear(m)), wire

    def section(self, p: SimpleNamespace) -> Sequence[Any]:
        """Area and section moduli of its wires."""
        area, bending, torsion = flexure.round_section(p.wire_diameter)
        return area, bending, bending, torsion


class CircularHinge(Flexible):
    """A notch hinge: two circular cut-outs, thin along its y axis, so that it turns about z."""

    ideal = ("delta_x", "delta_y", "delta_z", "theta_x", "theta_y")
    largest_stress = staticmethod(flexure.rectangular_stress)
    sheared_stress = staticmethod(flexure.sheared_rectangle)

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
        across the depth that bend with their ends held, b^2/(12 C), C their deflection per force: an estimate, 9 % stiffer than
        solid finite elements at t/R = 0.175 and b/t = 4.3 (S1 eq. (7), `ctrlgen reproduce S1`), where bending and extension out of the
        plane are 8 to 9 % stiffer and those in it 2 % softer.
        """
        h = self.hinge.geometry(p.hinge, E=m.young, nu=m.poisson)
        shear = stated_shear(m)
        G = h.G if shear is None else shear
        plane = self.hinge.planar(p.hinge, E=m.young, nu=m.poisson)
        turn, across, coupled = circular_hinge.out_of_plane(h.R, h.t, h.b, h.E, G)
        held = circular_hinge.locked(h.R, h.t, h.b, h.E, h.G)
        saint_venant = G * flexure.torsion_ratio(h.t, h.b) / (h.E * plane[2, 2])
        twist = 1 / (saint_venant + h.b**2 / (12 * held))
        return compliance_of_entries(
            (twist, turn, plane[2, 2]), (plane[0, 0], plane[1, 1], across), plane[2, 1], coupled
        )

    def room(self) -> tuple[float, float, float]:
        """Its length 2 R, its neck and its depth."""
        return 2 * self.hinge.R.si, self.hinge.t.si, 0.0 if self.hinge.b is None else self.hinge.b.si

    def notes(self, held_length: float | None, poisson: float) -> list[str]:
        """Where its equations leave their range of t/R, and where they leave out that it is deep."""
        R, t, b = (0.0 if q is None else q.si for q in (self.hinge.R, self.hinge.t, self.hinge.b))
        nu = poisson if self.hinge.poisson is None else self.hinge.poisson.si
        stiffer = 1 / (1 - nu**2 * circular_hinge.plane_strain_share(R, t, b)) - 1
        if stiffer < DEEP:
            return self.hinge.notes()
        return [
            *self.hinge.notes(),
            f"it is {b / t:.3g} times as deep as its neck: its equations are of plane stress, and a notch that cannot curve across is "
            f"{percent(stiffer)} stiffer in bending at a Poisson's ratio of {nu:g}",
        ]

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


def _thick(ratio: float, slender: bool, what: str, nu: float) -> list[str]:
    """What a round piece with so many times its length as its diameter lacks: shear where it is `slender`, and what its held ends make
    of it, as of a square bar of its area."""
    if ratio <= SLENDEST:
        return []
    told = f"{what} {ratio:.2g} times as thick as long"
    if ratio > THICKEST:
        return [f"{told}, which is no flexure: nothing was compared beyond {THICKEST:g}"]
    side = ratio * np.sqrt(np.pi) / 2
    bar, beam = held_flexure.held_blade(1.0, side, side, 1.0, nu), flexure.blade_segment(1.0, side, side, 1.0, nu)
    free = 0.0 if slender else held_flexure.shear_share(side, flexure.shear_ratio(nu))
    held = 1 / bar.EI_z + 12 * bar.shear_y
    yields = beam.EA / bar.EA, beam.EI_z * held / (1 + free)
    left_out = "shear and held ends are left out (slender = true)" if slender else "what its ends hold is left out"
    along, across = (percent(1 / share - 1, sign=True) for share in yields)
    return [
        f"{told}: {left_out}, which changes its stiffness between ends that do not turn by about {along} along and {across} across, at a "
        f"Poisson's ratio of {nu:g}"
    ]

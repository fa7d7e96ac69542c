"""Compliances of the elementary flexures, each about its free end, x along the flexure, as slender as the papers take them.

What shear and held ends change of a blade or wire of a mechanism is in `held_flexure.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from ctrlgen.physics.screw import Matrix, Scalar, move, series


@dataclass(frozen=True)
class Segment:
    """A straight, uniform piece of a flexure: length [m], area [m^2] and second moments I_y, I_z [m^4] of its section, rigidities EA [N],
    EI_y, EI_z, GJ [N m^2], and how far it shears, 1/(kappa G A) along y and z [1/N]; of a piece of a longer one `whole`, the length of
    that [m]."""

    length: Any
    area: Any
    I_y: Any
    I_z: Any
    EA: Any
    EI_y: Any
    EI_z: Any
    GJ: Any
    shear_y: Any = 0.0
    shear_z: Any = 0.0
    whole: Any = 0.0


def bent(s: Segment, x: Any, left: Any, load: Any) -> tuple[Any, Any, Any]:
    """Rotation [rad] about x, y and z that the first x [m] of a segment add, where a `load` of six, force and moment, acts `left` [m] from
    where the segment begins: the integral of (M + (left - x) e_x x F) over G J and E I."""
    lever = x * (left - x / 2)
    _, F_y, F_z, M_x, M_y, M_z = load
    return x * M_x / s.GJ, (x * M_y - lever * F_z) / s.EI_y, (x * M_z + lever * F_y) / s.EI_z


def shear_ratio(poisson: Scalar) -> Scalar:
    """chi = G/E = 1 / (2 (1 + nu)). Source: S1 eq. (22)."""
    return 1 / (2 * (1 + poisson))


def shear_over(E: Scalar, nu: Scalar, G: Scalar | None) -> Scalar:
    """chi = G/E of a crystal whose shear modulus `G` [Pa] is stated; without it that of S1 eq. (22)."""
    return shear_ratio(nu) if G is None else G / E


def torsion_ratio(t: Scalar, w: Scalar) -> Scalar:
    """beta = J/I_z of a rectangular section t x w, t <= w: 12 (1/3 - 0.21 (t/w) (1 - (t/w)^4 / 12)).

    Source: S1 eq. (23).
    """
    return 12 * (1 / 3 - 0.21 * t / w * (1 - (t / w) ** 4 / 12))


def beam_compliance(l: Scalar, EA: Scalar, EI_y: Scalar, EI_z: Scalar, GJ: Scalar) -> Matrix:
    """Euler-Bernoulli cantilever about its free end, twist per wrench, shape (6, 6).

    theta_x/M_x = l/GJ, delta_x/F_x = l/EA; in the x-y plane delta_y/F_y = l^3/3EI_z,
    delta_y/M_z = theta_z/F_y = l^2/2EI_z, theta_z/M_z = l/EI_z; in the x-z plane the same
    with EI_y and the opposite coupling sign. Source: S1 eq. (21) and (24), common form.

    `l` [m], `EA` [N], `EI_y`, `EI_z`, `GJ` [N m^2].
    """
    zero = 0 * l
    rows = [
        [zero, zero, zero, l / GJ, zero, zero],
        [zero, zero, -(l**2) / (2 * EI_y), zero, l / EI_y, zero],
        [zero, l**2 / (2 * EI_z), zero, zero, zero, l / EI_z],
        [l / EA, zero, zero, zero, zero, zero],
        [zero, l**3 / (3 * EI_z), zero, zero, zero, l**2 / (2 * EI_z)],
        [zero, zero, l**3 / (3 * EI_y), zero, -(l**2) / (2 * EI_y), zero],
    ]
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def segment_compliance(s: Segment, length: Any = None) -> Matrix:
    """(6, 6): a segment, or so much of it from its fixed end, about its free end: `beam_compliance`, and by shear delta_y/F_y and
    delta_z/F_z greater by length/(kappa G A). Source: S. P. Timoshenko, Phil. Mag. 41 (1921) 744."""
    x = s.length if length is None else length
    C = beam_compliance(x, s.EA, s.EI_y, s.EI_z, s.GJ)
    C[4, 1] += x * s.shear_y
    C[5, 2] += x * s.shear_z
    return C


def segments_compliance(segments: Sequence[Segment]) -> Matrix:
    """(6, 6): segments in line, the first one fixed, about the free end of the last."""
    left: Any = 0.0
    parts = []
    for s in reversed(segments):
        parts.append(move(segment_compliance(s), None, (-left, 0, 0)))
        left = left + s.length
    return series(tuple(parts))


def blade_compliance(l: Scalar, t: Scalar, w: Scalar, E: Scalar, nu: Scalar, G: Scalar | None = None) -> Matrix:
    """[C^b]: blade of length l, thickness t (along y), width w (along z), t <= w, shape (6, 6).

    EA = E t w, EI_z = E w t^3/12, EI_y = E t w^3/12, GJ = chi beta EI_z.
    Source: S1 eq. (21)-(23). `l`, `t`, `w` [m], `E` [Pa], `nu` [1], `G` [Pa] as in `shear_over`.
    """
    return segment_compliance(blade_segment(l, t, w, E, nu, G))


def blade_segment(l: Scalar, t: Scalar, w: Scalar, E: Scalar, nu: Scalar, G: Scalar | None = None) -> Segment:
    """The blade of `blade_compliance`."""
    A, I_y, I_z = t * w, t * w**3 / 12, w * t**3 / 12
    EI_z = E * w * t**3 / 12
    return Segment(
        l, A, I_y, I_z, E * t * w, E * t * w**3 / 12, EI_z, shear_over(E, nu, G) * torsion_ratio(t, w) * EI_z
    )


def wire_compliance(l: Scalar, d: Scalar, E: Scalar, nu: Scalar) -> Matrix:
    """[C^w]: round wire of length l and diameter d, shape (6, 6).

    EA = pi E d^2/4, EI = pi E d^4/64, GJ = 2 chi EI.
    Source: S1 eq. (24). `l`, `d` [m], `E` [Pa], `nu` [1].
    """
    return segment_compliance(wire_segment(l, d, E, nu))


def wire_segment(l: Scalar, d: Scalar, E: Scalar, nu: Scalar, G: Scalar | None = None) -> Segment:
    """The wire of `wire_compliance`."""
    A, I = ca.pi * d**2 / 4, ca.pi * d**4 / 64
    EI = E * ca.pi * d**4 / 64
    return Segment(l, A, I, I, E * ca.pi * d**2 / 4, EI, EI, 2 * shear_over(E, nu, G) * EI)


def round_section(d: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Area pi d^2/4, section moduli pi d^3/32 of bending and pi d^3/16 of torsion of a round section of diameter d [m]."""
    bending = ca.pi * d**3 / 32
    return ca.pi * d**2 / 4, bending, 2 * bending


def round_stress(about_y: Matrix, about_z: Matrix, tension: Matrix, shear: Matrix, floor: float) -> Matrix:
    """Largest von Mises stress of a round section, sqrt((sqrt(s_y^2 + s_z^2) + |s_N|)^2 + 3 tau^2) [Pa].

    `about_y`, `about_z`, `tension`, `shear`: stress by bending about y and z, by tension and by torsion, each at its largest
    [Pa]. `floor` [Pa] is added under the root of bending, squared, so that its derivative exists without load; the stress is
    overestimated by that. Shear by transverse force is left out, as in slender flexures it is small. Source: S. Timoshenko,
    Strength of Materials I, chapters 4 and 11.
    """
    return ca.sqrt((ca.sqrt(about_y**2 + about_z**2 + floor**2) + ca.fabs(tension)) ** 2 + 3 * shear**2)


def rectangular_section(t: Scalar, w: Scalar) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """Area t w, section moduli t w^2/6 about y, w t^2/6 about z, and of torsion, of a rectangular section t <= w [m].

    Torsion, largest in the middle of the long sides: w t^2 / (3 (1 + 0.6095 r + 0.8865 r^2 - 1.8023 r^3 + 0.91 r^4)), r = t/w.
    Source: Roark's Formulas for Stress and Strain, 7th ed., table 10.1, case 4.
    """
    r = t / w
    torsion = w * t**2 / (3 * (1 + 0.6095 * r + 0.8865 * r**2 - 1.8023 * r**3 + 0.91 * r**4))
    return t * w, t * w**2 / 6, w * t**2 / 6, torsion


def rectangular_stress(about_y: Matrix, about_z: Matrix, tension: Matrix, shear: Matrix, floor: float) -> Matrix:
    """Bound of the von Mises stress of a rectangular section, sqrt((|s_y| + |s_z| + |s_N|)^2 + 3 tau^2 + floor^2) [Pa].

    Bending and tension add up at a corner, where torsion makes no shear; its largest, tau, in the middle of a side is counted
    there too, which errs on the safe side. Arguments as in `round_stress`.
    """
    normal = ca.fabs(about_y) + ca.fabs(about_z) + ca.fabs(tension)
    return ca.sqrt(normal**2 + 3 * shear**2 + floor**2)


def sheared_rectangle(bent: Sequence[Matrix], shear: Matrix, along: Sequence[Matrix]) -> Matrix:
    """Largest von Mises stress inside of a rectangular section [Pa], where transverse shear is largest, 3/2 of its mean.

    `bent`: stress by bending about y and z and by tension, each at its largest, `shear` that by torsion, `along`: mean shear along y and z
    [Pa]. In the middle of the sides that are parallel to a shear force there is none of the bending in its plane. Source: S. Timoshenko,
    Strength of Materials I, section 26. Wide sections have more at the middle of their short sides for a force across them.
    """
    about_y, about_z, tension = (ca.fabs(x) for x in bent)
    across_y, across_z = (3 / 2 * ca.fabs(x) + ca.fabs(shear) for x in along)
    return ca.sqrt(ca.fmax((about_y + tension) ** 2 + 3 * across_y**2, (about_z + tension) ** 2 + 3 * across_z**2))


def sheared_circle(bent: Sequence[Matrix], shear: Matrix, along: Sequence[Matrix]) -> Matrix:
    """The same of a round section, 4/3 of the mean at its middle line, where the bending in the plane of the force is zero."""
    tension, across = bent[2], 4 / 3 * ca.sqrt(along[0] ** 2 + along[1] ** 2) + ca.fabs(shear)
    return ca.sqrt(tension**2 + 3 * across**2)

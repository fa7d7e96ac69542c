"""Blades and wires whose ends are held in thick bodies: shear, and what their ends forbid.

A slender beam may contract across as it is stretched, curve across as it is bent (anticlastic curvature) and warp as it is twisted. Where
it is held it may not, over about its width from there on: a wide blade goes from plane stress to plane strain, E to E/(1 - nu^2), and its
torsion becomes the bending of strips. Of a blade of length l, thickness t and width w, q = w/l, r = t/w, s = t/l, the compliances between
its ends, about the middle of its length, over those of the slender beam (l/EA, l/EI, l^3/12EI, l/GJ) are

    axial             1 - nu^2 f(q (1 + 0.94 r)) (1 + 0.6 s)
    theta_z per M_z   1 - nu^2 (f(q g(r)) + 0.134 s)
    delta_y per F_y   1 - nu^2 (f(q g(r)) + 0.924 s) + S(s)
    theta_y per M_y   1 - nu^2 f(q (1 + 3.73 r))
    delta_z per F_z   1 - nu^2 f(q (1 + 2.19 r)) + S(q)
    theta_x per M_x   1 - T + 4.12 r^2 T^2 J/J_0

with f of each rising from 0 to 1, f(x) = (a x + b x^2)/(1 + c x + b x^2), g(r) = (1 + u r)/(1 + v r), and

    S(x) = E/G x^2 (1 + 0.2/(1 + 0.31 x + 0.032 x^2))      shear, 6/5 of a slender section, 1 where the ends hold all of it
    T = tanh(m)/m,  m^2 = 12 (1 - nu^2) G/E (1 + 0.12 nu^2) (J/J_0) / (q^2 C),  C = ((1 - r^2)/(1 + r^2))^3.5,  J_0 = w t^3/3.

The forms are those of the theories: Timoshenko's shear; of a plate one term in the width (L. V. Kantorovich, V. I. Krylov, Approximate
Methods of Higher Analysis (1958), chapter 4), which gives the compliances within 3 %; the warping of thin sections, S. P.
Timoshenko, J. N. Goodier, Theory of Elasticity (1970), section 109, and for wide leaf springs D. M. Brouwer, J. P. Meijaard, J. B. Jonker,
Precis. Eng. 37 (2013) 73. The coefficients are least squares to Kirchhoff plates, plane stress and solids of finite elements,
0.03 <= q <= 5, 0 <= r <= 1, s <= 0.5, nu from 0.2 to 0.4 (solids: 0.33), E/G = 2 (1 + nu), and hold them to 0.7 %, torsion of solids to 2 %
(`tests/test_held_flexure.py`).
"""

from __future__ import annotations

import casadi as ca

from ctrlgen.physics.flexure import Segment, blade_segment, shear_over, torsion_ratio, wire_segment
from ctrlgen.physics.screw import Scalar

WIDEST, THICKEST = 5.0, 0.5
"""Width and thickness over the length up to which `held_blade` was compared with finite elements."""
AXIAL = (0.2294, 0.1916, 0.2880)
THETA_Z = (0.6236, 2.1543, 1.0494)
DELTA_Y = (2.4488, 8.4436, 3.3492)
THETA_Y = (0.1179, 0.0058, 0.0290)
DELTA_Z = (0.4692, -0.0068, -0.0488)
"""a, b and c of f."""
THETA_Z_THICK, DELTA_Y_THICK = (0.8561, 3.2218), (-0.03, 2.7769)
"""u and v of g."""
LEAST_WARPING = 1e-6
"""Of C, so that its root has a slope where a section is square."""


def held_share(x: Scalar, abc: tuple[float, float, float]) -> Scalar:
    """f: the share of plane strain, from 0 to 1."""
    a, b, c = abc
    return (a * x + b * x**2) / (1 + c * x + b * x**2)


def thinned(r: Scalar, uv: tuple[float, float]) -> Scalar:
    """g: how much narrower a section is to curvature across, as it is thicker."""
    u, v = uv
    return (1 + u * r) / (1 + v * r)


def shear_share(x: Scalar, chi: Scalar) -> Scalar:
    """S: deflection by shear over that by bending between held ends, x the depth over the length, `chi` G/E."""
    return x**2 / chi * (1 + 0.2 / (1 + 0.31 * x + 0.032 * x**2))


def warping_share(q: Scalar, r: Scalar, nu: Scalar, chi: Scalar) -> Scalar:
    """Torsional compliance over l/GJ with ends that do not warp, `chi` G/E."""
    J = torsion_ratio(r, 1.0) / 4
    C = ((1 - r**2) / (1 + r**2)) ** 3.5 + LEAST_WARPING
    m = ca.sqrt(12 * (1 - nu**2) * chi * (1 + 0.12 * nu**2) * J / C) / q
    T = ca.tanh(m) / m
    return 1 - T + 4.12 * r**2 * T**2 * J


def held_blade(l: Scalar, t: Scalar, w: Scalar, E: Scalar, nu: Scalar, G: Scalar | None = None) -> Segment:
    """A blade of length l, thickness t (along y), width w (along z), t <= w [m], with the compliances above: E [Pa], nu [1],
    G [Pa] of a crystal.

    EI are those of bending alone; what is left of the deflection is counted as shear, and may be negative where the blade is thin.
    """
    s, q, r, tau, chi = blade_segment(l, t, w, E, nu, G), w / l, t / w, t / l, shear_over(E, nu, G)
    theta_z = 1 - nu**2 * (held_share(q * thinned(r, THETA_Z_THICK), THETA_Z) + 0.134 * tau)
    delta_y = 1 - nu**2 * (held_share(q * thinned(r, DELTA_Y_THICK), DELTA_Y) + 0.924 * tau) + shear_share(tau, chi)
    theta_y = 1 - nu**2 * held_share(q * (1 + 3.73 * r), THETA_Y)
    delta_z = 1 - nu**2 * held_share(q * (1 + 2.19 * r), DELTA_Z) + shear_share(q, chi)
    axial = 1 - nu**2 * held_share(q * (1 + 0.94 * r), AXIAL) * (1 + 0.6 * tau)
    return Segment(
        l,
        s.area,
        s.I_y,
        s.I_z,
        s.EA / axial,
        s.EI_y / theta_y,
        s.EI_z / theta_z,
        s.GJ / warping_share(q, r, nu, chi),
        l**2 * (delta_y - theta_z) / (12 * s.EI_z),
        l**2 * (delta_z - theta_y) / (12 * s.EI_y),
    )


def timoshenko_wire(l: Scalar, d: Scalar, E: Scalar, nu: Scalar, G: Scalar | None = None) -> Segment:
    """A round wire of length l and diameter d [m] that shears, kappa = 6 (1 + nu)/(7 + 6 nu); its ends are free to contract.

    Source: G. R. Cowper, J. Appl. Mech. 33 (1966) 335. `E` [Pa], `nu` [1].
    """
    s = wire_segment(l, d, E, nu, G)
    shear = (7 + 6 * nu) / (6 * (1 + nu)) / (shear_over(E, nu, G) * E * s.area)
    return Segment(l, s.area, s.I_y, s.I_z, s.EA, s.EI_y, s.EI_z, s.GJ, shear, shear)

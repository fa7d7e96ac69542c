"""In-plane compliances of a circular flexure hinge: equations C.1-C.24 of S2, each as printed or as corrected.

Radius `R`, neck thickness `t`, width `b` [m], `E` [Pa], `nu` [1]. The hinge extends from x = -R to x = +R; the left
end is fixed, loads act and displacements are read at (R, 0): delta_y/F_y therefore contains R^2 alpha_z/M_z, and
delta_y/M_z = alpha_z/F_y = R alpha_z/M_z by symmetry. `circular_hinge_table` gives the range of each.
The shear parts are to be added to delta_y/F_y.
"""

from __future__ import annotations

import casadi as ca

from ctrlgen.physics.screw import Scalar

TSEYTLIN_THIN, TSEYTLIN_THICK, TSEYTLIN_END = 0.07, 0.2, 0.6  # t/R where the branches C.15-C.17 meet and end


# Paros and Weisbord (1965), with beta = t/2R and theta_m = pi/2, hence gamma = 1 + beta


def c1(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """alpha_z/M_z, C.1: 3/(2 E b R^2 k) {[(1+beta)/gamma^2 + (3+2beta+beta^2)/(gamma k)] + 6 (1+beta)/k^(3/2) A}.

    k = 2 beta + beta^2, A = atan sqrt((2+beta)/beta). Beam theory, exact for the profile. Paros and Weisbord, full.
    """
    beta, k, A = _paros(R, t)
    return (
        3 / (2 * E * b * R**2 * k) * (1 / (1 + beta) + (3 + k) / ((1 + beta) * k) + 6 * (1 + beta) / k ** (3 / 2) * A)
    )


def c2(R: Scalar, t: Scalar, b: Scalar, E: Scalar, alpha: Scalar | None = None) -> Scalar:
    """delta_y/F_y without shear, C.2: R^2 (alpha_z/M_z) - 3/(2 E b) {1/(1+beta) - ... - pi}.

    {...} = (1+beta)/(1+beta)^2 - (2 + (1+beta)^2/k)/(1+beta) + [4(1+beta)/sqrt(k) - 2(1+beta)/k^(3/2)] A - pi.
    `alpha` replaces alpha_z/M_z in the first term; the rest is the deflection with the rotation locked.
    The print leaves open whether tan(theta_m/2) is inside the arctangent (it is); at theta_m = pi/2 both agree.
    Paros and Weisbord, full.
    """
    beta, k, A = _paros(R, t)
    g = 1 + beta
    braces = 1 / g - (2 + g**2 / k) / g + (4 * g / k**0.5 - 2 * g / k ** (3 / 2)) * A - ca.pi
    return R**2 * (c1(R, t, b, E) if alpha is None else alpha) - 3 / (2 * E * b) * braces


def c3(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """delta_x/F_x, C.3: [-2 atan(1) + 2 (1+beta)/sqrt(k) A]/(E b). Paros and Weisbord, full.

    In the print the first arctangent has the argument (gamma - beta)/sqrt(1 - (1 + beta - gamma)^2), which is 1.
    """
    return _stretch_paros(R, t) / (E * b)


def c4(R: Scalar, t: Scalar, b: Scalar, G: Scalar) -> Scalar:
    """Shear part of delta_y/F_y, C.4: [-theta_m + 2 (1+beta)/sqrt(k) A]/(G b), shear factor 1. Paros and Weisbord."""
    return _stretch_paros(R, t) / (G * b)


def c5(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """alpha_z/M_z, C.5: 9 pi R^(1/2)/(2 E b t^(5/2)); C.1 as t/R -> 0. Paros and Weisbord, simplified."""
    return 9 * ca.pi * R**0.5 / (2 * E * b * t**2.5)


def c6(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """delta_y/F_y, C.6: 9 pi/(2 E b) (R/t)^(5/2); C.2 as t/R -> 0, R^2 times C.5. Paros and Weisbord, simplified.

    The deflection with locked rotation vanishes in the limit: C.5 and C.6 together give a singular compliance matrix.
    """
    return 9 * ca.pi / (2 * E * b) * (R / t) ** 2.5


def c7(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """delta_x/F_x, C.7: [pi (R/t)^(1/2) - 2.57]/(E b); C.3 as t/R -> 0. Paros and Weisbord, simplified.

    2.57 is 1 + pi/2 rounded; negative for t/R > 1.49.
    """
    return (ca.pi * (R / t) ** 0.5 - 2.57) / (E * b)


def c8(R: Scalar, t: Scalar, b: Scalar, G: Scalar) -> Scalar:
    """Shear part of delta_y/F_y, C.8: [pi (R/t)^(1/2) - 2.57]/(G b). Paros and Weisbord, simplified."""
    return (ca.pi * (R / t) ** 0.5 - 2.57) / (G * b)


def _paros(R: Scalar, t: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    beta = t / (2 * R)
    return beta, 2 * beta + beta**2, ca.atan(((2 + beta) / beta) ** 0.5)


def _stretch_paros(R: Scalar, t: Scalar) -> Scalar:
    beta, k, A = _paros(R, t)
    return 2 * (1 + beta) / k**0.5 * A - ca.pi / 2


# Fits of alpha_z/M_z


def c9(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """alpha_z/M_z, C.9: (1.13 t/R + 0.332) R/(E I_zz), I_zz = b t^3/12. Smith et al. (1987)."""
    return (1.13 * t / R + 0.332) * R / (E * b * t**3 / 12)


def c10(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """alpha_z/M_z, C.10: 1/{E b t^2 [-0.035 t/2R + 0.1109 (t/2R)^(1/2)]}. Zhang and Fasse (2001).

    The print lacks the factor 1/(E b t^2), without which it is a pure number.
    """
    beta = t / (2 * R)
    return 1 / (E * b * t**2 * (-0.035 * beta + 0.1109 * beta**0.5))


# Wu and Zhou (2002), with s = R/t and A = atan sqrt(4 s + 1)


def c11(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """alpha_z/M_z, C.11: 12/(E b R^2) [2 s^3 (6s^2+4s+1)/((2s+1)(4s+1)^2) + 12 s^4 (2s+1)/(4s+1)^(5/2) A].

    Equal to C.1 and C.18. Wu and Zhou.
    """
    s, u, A = _wu(R, t)
    first = 2 * s**3 * (6 * s**2 + 4 * s + 1) / ((2 * s + 1) * u**2)
    return 12 / (E * b * R**2) * (first + 12 * s**4 * (2 * s + 1) / u**2.5 * A)


def c12(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """delta_y/F_y without shear, C.12: 12/(E b) [s p/(2 (2s+1)(4s+1)^2) + (2s+1) q/(2 (4s+1)^(5/2)) A + pi/8].

    p = 24s^4+24s^3+22s^2+8s+1, q = 24s^4+8s^3-14s^2-8s-1. Equal to C.2 and C.19. Wu and Zhou.
    """
    s, u, A = _wu(R, t)
    p = 24 * s**4 + 24 * s**3 + 22 * s**2 + 8 * s + 1
    q = 24 * s**4 + 8 * s**3 - 14 * s**2 - 8 * s - 1
    return 12 / (E * b) * (s * p / (2 * (2 * s + 1) * u**2) + (2 * s + 1) * q / (2 * u**2.5) * A + ca.pi / 8)


def c13(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """delta_x/F_x, C.13: [2 (2s+1)/sqrt(4s+1) A - pi/2]/(E b). Equal to C.3 and C.20. Wu and Zhou."""
    return _stretch_wu(R, t) / (E * b)


def c14(R: Scalar, t: Scalar, b: Scalar, G: Scalar) -> Scalar:
    """Shear part of delta_y/F_y, C.14: [2 (2s+1)/sqrt(4s+1) A - pi/2]/(G b), shear factor 1. Wu and Zhou."""
    return _stretch_wu(R, t) / (G * b)


def _wu(R: Scalar, t: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    s = R / t
    return s, 4 * s + 1, ca.atan((4 * s + 1) ** 0.5)


def _stretch_wu(R: Scalar, t: Scalar) -> Scalar:
    s, u, A = _wu(R, t)
    return 2 * (2 * s + 1) / u**0.5 * A - ca.pi / 2


# Tseytlin (2002). Three branches that do not meet: C.16/C.15 is 0.85 at t/R = 0.07, C.17/C.16 is 0.81 at t/R = 0.2.


def c15(R: Scalar, t: Scalar, b: Scalar, E: Scalar, nu: Scalar) -> Scalar:
    """alpha_z/M_z, C.15, t/R <= 0.07: 4 {1 + [1 + 0.1986 (2R/t)]^(1/2)}/[E b (t/2)^2] (1 - nu^2)/0.889. Tseytlin.

    The equation has 0.1986, the sentence below it 0.1984; the two differ by less than 0.05 %. That sentence's 0.215
    for theta_m within +-0.9 rad is a hinge that is not a half circle.
    """
    return _tseytlin(R, t, b, E, nu, 0.1986, 1.0)


def c16(R: Scalar, t: Scalar, b: Scalar, E: Scalar, nu: Scalar) -> Scalar:
    """alpha_z/M_z, C.16, 0.07 < t/R <= 0.2: as C.15 with 0.373 and E b -> 1.45 E b. Tseytlin."""
    return _tseytlin(R, t, b, E, nu, 0.373, 1.45)


def c17(R: Scalar, t: Scalar, b: Scalar, E: Scalar, nu: Scalar) -> Scalar:
    """alpha_z/M_z, C.17, 0.2 < t/R <= 0.6: as C.15 with 0.5573 and E b -> 2 E b. Tseytlin."""
    return _tseytlin(R, t, b, E, nu, 0.5573, 2.0)


def _tseytlin(R: Scalar, t: Scalar, b: Scalar, E: Scalar, nu: Scalar, c: float, stiffer: float) -> Scalar:
    # 0.889 is 1 - 0.333^2: the printed equations hold for nu = 0.333, the factor converts them to another.
    poisson = (1 - nu**2) / 0.889
    return 4 * (1 + (1 + c * 2 * R / t) ** 0.5) / (stiffer * E * b * (t / 2) ** 2) * poisson


# Lobontiu (2003), with u = 4 R + t and A = atan sqrt(1 + 4R/t)


def c18(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """alpha_z/M_z, C.18: 24R/[E b t^3 (2R+t) u^3] [t u (6R^2+4Rt+t^2) + 6R (2R+t)^2 sqrt(t u) A]. Lobontiu."""
    u, A = _lobontiu(R, t)
    inner = t * u * (6 * R**2 + 4 * R * t + t**2) + 6 * R * (2 * R + t) ** 2 * (t * u) ** 0.5 * A
    return 24 * R / (E * b * t**3 * (2 * R + t) * u**3) * inner


def c19(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """delta_y/F_y without shear, C.19. Equal to C.2 and C.12. Lobontiu.

    3/[4 E b (2R+t)] {2 (2+pi) R + pi t + 8R^3 (44R^2+28Rt+5t^2)/(t^2 u^2) + (2R+t) sqrt(t u)/sqrt(t^5 u^5) p
    - 8 (2R+t)^4 (-6R^2+4Rt+t^2)/sqrt(t^5 u^5) A}, p = -80R^4+24R^3t+8(3+2pi)R^2t^2+4(1+2pi)Rt^3+pi t^4.
    The printed sqrt(t u)/sqrt(t^5 u^5) is 1/(t u)^2.
    """
    u, A = _lobontiu(R, t)
    p = -80 * R**4 + 24 * R**3 * t + 8 * (3 + 2 * ca.pi) * R**2 * t**2 + 4 * (1 + 2 * ca.pi) * R * t**3 + ca.pi * t**4
    braces = (
        2 * (2 + ca.pi) * R
        + ca.pi * t
        + 8 * R**3 * (44 * R**2 + 28 * R * t + 5 * t**2) / (t * u) ** 2
        + (2 * R + t) * p / (t * u) ** 2
        - 8 * (2 * R + t) ** 4 * (-6 * R**2 + 4 * R * t + t**2) / (t * u) ** 2.5 * A
    )
    return 3 / (4 * E * b * (2 * R + t)) * braces


def c20(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """delta_x/F_x, C.20: [2 (2R+t)/sqrt(t u) A - pi/2]/(E b). Equal to C.3 and C.13. Lobontiu."""
    u, A = _lobontiu(R, t)
    return (2 * (2 * R + t) / (t * u) ** 0.5 * A - ca.pi / 2) / (E * b)


def c21(R: Scalar, t: Scalar, b: Scalar, E: Scalar, G: Scalar, shear_factor: Scalar) -> Scalar:
    """Shear part of delta_y/F_y, C.21: shear_factor E/G (delta_x/F_x). Lobontiu.

    The print gives the factor no value: 6/5 is the rectangular section's, 3/2 its peak over mean shear stress.
    """
    return shear_factor * E / G * c20(R, t, b, E)


def _lobontiu(R: Scalar, t: Scalar) -> tuple[Scalar, Scalar]:
    return 4 * R + t, ca.atan((1 + 4 * R / t) ** 0.5)


# Schotborgh et al. (2005), fits to finite elements, with q = sqrt(t/2R)


def c22(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """alpha_z/M_z, C.22: 1/{E b t^2/12 [-0.0089 + 1.3556 q - 0.5227 q^2]}. Schotborgh et al."""
    q = (t / (2 * R)) ** 0.5
    return 12 / (E * b * t**2 * (-0.0089 + 1.3556 * q - 0.5227 * q**2))


def c23(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """delta_y/F_y with the rotation locked, C.23: 1/{E b [0.0040 - 0.0727 q + 0.3417 q^2]}. Schotborgh et al.

    The compliance of the other authors is this one plus R^2 alpha_z/M_z. The fit fails near the minimum of its
    denominator: at t/R = 0.05 it is twice the locked compliance of finite elements, from t/R = 0.2 on within 10 %.
    """
    q = (t / (2 * R)) ** 0.5
    return 1 / (E * b * (0.0040 - 0.0727 * q + 0.3417 * q**2))


def c24(R: Scalar, t: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """delta_x/F_x, C.24: 1/{E b [0.0010 + 0.4256 q + 0.0824 q^2]}. Schotborgh et al.

    More compliant than the others by 20 % (t/R = 0.05) to 80 % (0.8), because it includes the extension of the links.
    Finite elements read on the outer faces of links of length R agree within 2 % up to t/R = 0.2,
    within 11 % at 0.8.
    """
    q = (t / (2 * R)) ** 0.5
    return 1 / (E * b * (0.0010 + 0.4256 * q + 0.0824 * q**2))


# Out of the plane: Euler-Bernoulli over the profile t(x) = t + 2R - 2 sqrt(R^2 - x^2), whose two integrals are closed


def out_of_plane(R: Scalar, t: Scalar, b: Scalar, E: Scalar, G: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """theta_y/M_y, delta_z/F_z and theta_y/F_z at the free end (R, 0).

    theta_y/M_y = 12 I_0/(E b^3), delta_z/F_z = 12 (R^2 I_0 + I_2)/(E b^3) + 6/5 I_0/(G b), theta_y/F_z = -R theta_y/M_y, with
    I_0 = int dx/t = S(R, t) of C.3 and I_2 = int x^2 dx/t = R^2/2 (gamma (2 + pi gamma - 4 sqrt(k) A) - pi/2). Source: beam theory
    as C.1-C.4, of the section b t(x) that bends about its thickness b.
    """
    beta, k, A = _paros(R, t)
    gamma = 1 + beta
    I_0 = _stretch_paros(R, t)
    I_2 = R**2 / 2 * (gamma * (2 + ca.pi * gamma - 4 * k**0.5 * A) - ca.pi / 2)
    turn = 12 * I_0 / (E * b**3)
    return turn, 12 * (R**2 * I_0 + I_2) / (E * b**3) + 6 / 5 * I_0 / (G * b), -R * turn


def locked(R: Scalar, t: Scalar, b: Scalar, E: Scalar, G: Scalar) -> Scalar:
    """delta_y/F_y with the rotation of the end locked: C.2 - R^2 C.1, and the shear of C.4 with the factor 6/5."""
    return c2(R, t, b, E) - R**2 * c1(R, t, b, E) + 6 / 5 * c4(R, t, b, G)


def plane_strain_share(R: float, t: float, b: float) -> float:
    """f(x) = 0.243 x^2/(1 + 0.04 x + 0.243 x^2), x = b/sqrt(t R): how far a notch of depth b cannot curve across, from 0 to 1.

    Its bending in the plane is that of plane stress, of which C.1, C.2 and the others are, less nu^2 f of it: 1 - nu^2 in the end. Least
    squares to solids of finite elements, t/R of 0.05 and 0.15, x from 0.5 to 10, within 0.05 of f, which is half a per cent of the
    stiffness (`tests/test_deep_notch.py`).
    """
    x = b / (t * R) ** 0.5
    return 0.243 * x**2 / (1 + 0.04 * x + 0.243 * x**2)

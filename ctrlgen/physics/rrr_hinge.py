"""The planar hinge compliances that S3 Table 2 chooses from, each by the name of its equation.

Right circular notch of least thickness t, radius R, width b; displacements of its free end. The
equations are those of S2 appendix C. `t`, `R`, `b` [m], `E` [Pa]; every function takes numbers or symbols.
"""

from __future__ import annotations

import casadi as ca

from ctrlgen.physics.screw import Matrix, Scalar


def _arc(t: Scalar, R: Scalar) -> Scalar:
    """atan sqrt(1 + 4R/t), which all the full equations share."""
    return ca.atan(ca.sqrt(1 + 4 * R / t))


def rotation_full(t: Scalar, R: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """Paros and Weisbord, full: Delta-alpha_z/M_z [rad/(N m)]. Source: S2 eq. (C.1), gamma = 1 + beta."""
    beta = t / (2 * R)
    k = 2 * beta + beta**2
    brace = 1 / (1 + beta) + (3 + 2 * beta + beta**2) / ((1 + beta) * k) + 6 * (1 + beta) / k**1.5 * _arc(t, R)
    return 3 / (2 * E * b * R**2 * k) * brace


def rotation_schotborgh(t: Scalar, R: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """Schotborgh et al.: Delta-alpha_z/M_z [rad/(N m)], a fit to finite elements. Source: S2 eq. (C.22)."""
    s = ca.sqrt(t / (2 * R))
    return 12 / (E * b * t**2 * (-0.0089 + 1.3556 * s - 0.5227 * s**2))


def transverse_simplified(t: Scalar, R: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """Paros and Weisbord, simplified: Delta-y/F_y [m/N], bending only. Source: S2 eq. (C.6)."""
    return 9 * ca.pi / (2 * E * b) * (R / t) ** 2.5


def transverse_lobontiu(t: Scalar, R: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """Lobontiu: Delta-y/F_y [m/N], bending only. Source: S2 eq. (C.19)."""
    q = t * (4 * R + t)
    polynomial = (
        -80 * R**4 + 24 * R**3 * t + 8 * (3 + 2 * ca.pi) * R**2 * t**2 + 4 * (1 + 2 * ca.pi) * R * t**3 + ca.pi * t**4
    )
    brace = (
        2 * (2 + ca.pi) * R
        + ca.pi * t
        + 8 * R**3 * (44 * R**2 + 28 * R * t + 5 * t**2) / q**2
        + (2 * R + t) * polynomial / q**2
        - 8 * (2 * R + t) ** 4 * (-6 * R**2 + 4 * R * t + t**2) / q**2.5 * _arc(t, R)
    )
    return 3 / (4 * E * b * (2 * R + t)) * brace


def axial_simplified(t: Scalar, R: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """Paros and Weisbord, simplified: Delta-x/F_x [m/N]. Source: S2 eq. (C.7)."""
    return (ca.pi * ca.sqrt(R / t) - 2.57) / (E * b)


def axial_full(t: Scalar, R: Scalar, b: Scalar, E: Scalar) -> Scalar:
    """Paros and Weisbord, full: Delta-x/F_x [m/N]. Source: S2 eq. (C.3), the same integral as (C.20)."""
    return (2 * (2 * R + t) / ca.sqrt(t * (4 * R + t)) * _arc(t, R) - ca.pi / 2) / (E * b)


def shear(t: Scalar, R: Scalar, b: Scalar, E: Scalar, nu: Scalar) -> Scalar:
    """[Delta-y/F_y]_s [m/N] with shear factor 1: E/G times the full axial compliance. Source: S2 eq. (C.21)."""
    return 2 * (1 + nu) * axial_full(t, R, b, E)


ROTATION = {"paros_weisbord_full": rotation_full, "schotborgh": rotation_schotborgh}
TRANSVERSE = {"paros_weisbord_simplified": transverse_simplified, "lobontiu": transverse_lobontiu}
AXIAL = {"paros_weisbord_simplified": axial_simplified, "paros_weisbord_full": axial_full}


def hinge_compliance(x: Scalar, y: Scalar, alpha: Scalar, R: Scalar) -> Matrix:
    """[C] of one hinge about its free end, (dx, dy, dalpha) per (F_x, F_y, M_z), shape (3, 3).

    A notch of length 2R turns about its middle: a force across the end turns it by R alpha, a moment moves
    the end by as much. Positive definite only where y > R^2 alpha. Source: S3 eq. (B.9), (B.13), (B.21).
    """
    return ca.vertcat(ca.horzcat(x, 0, 0), ca.horzcat(0, y, R * alpha), ca.horzcat(0, R * alpha, alpha))

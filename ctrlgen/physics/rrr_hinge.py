"""The planar hinge compliances that S3 Table 2 chooses from, each by the name of its equation.

The equations themselves are those of S2 appendix C, in `circular_hinge`, with its arguments (R, t, b, E).
"""

from __future__ import annotations

import casadi as ca

from ctrlgen.physics import circular_hinge
from ctrlgen.physics.screw import Matrix, Scalar

ROTATION = {"paros_weisbord_full": circular_hinge.c1, "schotborgh": circular_hinge.c22}
TRANSVERSE = {"paros_weisbord_simplified": circular_hinge.c6, "lobontiu": circular_hinge.c19}
AXIAL = {"paros_weisbord_simplified": circular_hinge.c7, "paros_weisbord_full": circular_hinge.c3}


def shear(R: Scalar, t: Scalar, b: Scalar, E: Scalar, nu: Scalar) -> Scalar:
    """[Delta-y/F_y]_s [m/N] with shear factor 1, which S3 multiplies by 3/2. Source: S2 eq. (C.4)."""
    return circular_hinge.c4(R, t, b, E / (2 * (1 + nu)))


def hinge_compliance(x: Scalar, y: Scalar, alpha: Scalar, R: Scalar) -> Matrix:
    """[C] of one hinge about its free end, (dx, dy, dalpha) per (F_x, F_y, M_z), shape (3, 3).

    A notch of length 2R turns about its middle: a force across the end turns it by R alpha, a moment moves
    the end by as much. Positive definite only where y > R^2 alpha. Source: S3 eq. (B.9), (B.13), (B.21).
    """
    return ca.vertcat(ca.horzcat(x, 0, 0), ca.horzcat(0, y, R * alpha), ca.horzcat(0, R * alpha, alpha))

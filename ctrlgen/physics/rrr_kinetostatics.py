"""The planar 3-RRR stage: compliances at output and inputs from any three hinge compliances.

Source: S3 appendix B. Displacements (dx, dy, dalpha) [m, m, rad], loads (F_x, F_y, M_z) [N, N, N m]. A hinge is a
(3, 3) compliance about its free end, x along the hinge (`circular_hinge_table.end_compliance`). The compliance of
each hinge of Link 1 is transformed to the platform by the equilibrium of the links between, which gives every entry of
(B.9)-(B.48).

Misprints: B.8 row 3 is Delta-alpha; B.12 is with respect to M_o'z; B.42 has hinge 3; B.36-B.38 and B.46-B.48 are at o'; B.62
has -sin(-120 deg) in row 1; B.49 rotates displacements only, because the columns of B.29 and B.39 are already loads at o'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from ctrlgen.physics.screw import Matrix, Scalar, parallel, rotation_z, series

THIRD_TURN = (0.0, -2 * ca.pi / 3, 2 * ca.pi / 3)  # Links 1, 2, 3; Source: S3 eq. (B.59), (B.60)


def lever(x: Scalar, y: Scalar) -> Matrix:
    """[T_d]: displacement at (x, y) of a body per displacement at its origin, shape (3, 3). `x`, `y` [m].

    Its transpose is [T_f], the load at the origin of a load at (x, y). Source: S3 eq. (B.17), (B.25), (B.54), (B.56).
    """
    return ca.vertcat(ca.horzcat(1, 0, -y), ca.horzcat(0, 1, x), ca.horzcat(0, 0, 1))


def transformed(C: Matrix, A: Matrix) -> Matrix:
    """A C A': a compliance at the end of the rigid link A."""
    return ca.mtimes([A, C, A.T])


def hinge_1_lever(g: Any) -> Matrix:
    """The lever from Point 1 to Point o', which is at (l_1, l_4) from it. Source: S3 eq. (B.17), (B.25)."""
    return lever(g.l1, g.l4)


def link_compliance(hinges: Sequence[Matrix], g: Any) -> Matrix:
    """[C_L1o,Fo]: the RRR Link 1 at Point o, shape (3, 3).

    Hinge 2 is l_2 + l_3 + 2 R_3 and hinge 3 l_3 from o', both along y. `hinges`: three (3, 3); `g` has l1 ... l6 and
    the hinge radii R1, R2, R3 [m]. Source: S3 eq. (B.8)-(B.58).
    """
    quarter = rotation_z(ca.pi / 2)  # (B.51)
    arms = (
        hinge_1_lever(g),
        ca.mtimes(quarter, lever(g.l2 + g.l3 + 2 * g.R3, 0)),
        ca.mtimes(quarter, lever(g.l3, 0)),
    )
    at_o_prime = series(transformed(C, A) for C, A in zip(hinges, arms, strict=True))  # (B.52)
    return transformed(at_o_prime, lever(-g.l6, 0))  # (B.58)


def input_lever(g: Any) -> Matrix:
    """Load at Point 1 of a unit force F_1in, which acts along -y at l_5, shape (3, 1). Source: S3 below eq. (B.8)."""
    return ca.vertcat(0, -1, -g.l5)


def link_input_compliance(hinges: Sequence[Matrix], g: Any) -> Matrix:
    """[C_L1o,F1in]: displacement of Point o of Link 1 alone per F_1in, shape (3, 1). Only hinge 1 is loaded.

    Source: S3 eq. (B.68)-(B.74).
    """
    arm = ca.mtimes(lever(-g.l6, 0), hinge_1_lever(g))
    return ca.mtimes([arm, hinges[0], input_lever(g)])


@dataclass(frozen=True)
class Kinetostatics:
    """The matrices of S3 eq. (1) and (7), each of shape (3, 3), SI.

    `C_oFo`: output displacement per output load. `C_oFin`: per input force; its transpose is C_inFo (B.81).
    `C_inFin`: input displacement per input force by (B.82)-(B.85). `clamped`: the term that (B.83) neglects, the input
    displacement per input force at a fixed platform [m/N], equal at the three inputs.
    """

    C_oFo: Matrix
    C_oFin: Matrix
    C_inFin: Matrix
    clamped: Scalar

    @property
    def C_inFo(self) -> Matrix:
        """Input displacement per output load, (3, 3). Source: S3 eq. (B.81)."""
        return self.C_oFin.T

    @property
    def J(self) -> Matrix:
        """Output per input displacement with `C_inFin`, (3, 3) [1, 1, rad/m]. Source: S3 eq. (7).

        Independent of C_oFo: it is the inverse transpose of the equivalent forces (B.77).
        """
        return ca.mtimes(self.C_oFin, ca.inv(self.C_inFin))

    @property
    def input_compliance(self) -> Matrix:
        """Input displacement per input force of the whole linear model, (3, 3) [m/N]: C_inFin + clamped."""
        return self.C_inFin + self.clamped * ca.DM.eye(3)

    @property
    def input_stiffness(self) -> Matrix:
        """Input force per input displacement, all three inputs moved, (3, 3) [N/m]: inverse of `input_compliance`."""
        return ca.inv(self.input_compliance)

    @property
    def complete_J(self) -> Matrix:
        """Output per input displacement with `input_compliance`, (3, 3) [1, 1, rad/m]."""
        return ca.mtimes(self.C_oFin, self.input_stiffness)


def kinetostatics(hinges: Sequence[Matrix], g: Any) -> Kinetostatics:
    """Three Links in parallel, and the equivalent force at o of each input. Source: S3 eq. (B.65)-(B.85).

    The output frame of the paper is rotated by g.frame_angle [rad] against that of Link 1.
    """
    C_L = link_compliance(hinges, g)
    c_o = link_input_compliance(hinges, g)
    turns = [rotation_z(angle) for angle in THIRD_TURN]
    C_o = ca.inv(parallel(transformed(ca.inv(C_L), T) for T in turns))  # (B.65)
    equivalent = ca.solve(C_L, c_o)  # (B.77)
    F_eqv = ca.horzcat(*(ca.mtimes(T, equivalent) for T in turns))
    C_oFin = ca.mtimes(C_o, F_eqv)  # (B.78)-(B.80)
    frame = rotation_z(g.frame_angle)
    load = input_lever(g)
    return Kinetostatics(
        C_oFo=transformed(C_o, frame),
        C_oFin=ca.mtimes(frame, C_oFin),
        C_inFin=ca.mtimes(C_oFin.T, F_eqv),  # (B.83)
        clamped=ca.mtimes([load.T, hinges[0], load]) - ca.mtimes(c_o.T, equivalent),
    )

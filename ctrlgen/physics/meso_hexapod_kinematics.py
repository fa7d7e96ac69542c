"""The meso-scale hexapod on three planar stages: strut ends, constraint, kinematic Jacobian, cube and platform.

Source: S0 sections 2 and 4. The origin of the global frame is the geometrical centre of the platform at home.
Actuator order, S0 eq. (6): U = (1x, 2x, 2y, 3x, 3y, 1y) [m]; pose order: the twist (theta, delta) [rad, m].

Misprints: eq. (8) is the negative of the cross-product matrix, which would cancel the minus of eq. (7), and its entry
(3, 2) reads -A_y instead of -A_x; here [a x] b = a x b. Eq. (9) exchanges the two inputs of stage 3 against eq. (4).
The numbers of eq. (10) and (15) cannot be read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from ctrlgen.physics.screw import Matrix, Scalar, adjoint, rotation_to_second_order, rotation_vector, rotation_z

STAGE_OF_STRUT = (0, 1, 1, 2, 2, 0)  # S0 eq. (4): struts 1 and 6 on stage 1, 2 and 3 on stage 2, 4 and 5 on stage 3
STAGE_OF_ACTUATOR = (0, 1, 1, 2, 2, 0)  # S0 eq. (6)


def geometry(h: Any) -> tuple[Matrix, Matrix]:
    """A_i^0 = Z(phi_i) (r_a, 0, -t/2), B_i^0 = Z(psi_i) (r_b, 0, -H) [m], each of shape (3, 6). Source: S0 eq. (1)."""
    A = [
        ca.mtimes(rotation_z(angle), ca.vertcat(h.platform_radius, 0, -h.platform_thickness / 2))
        for angle in h.platform_angles
    ]
    B = [ca.mtimes(rotation_z(angle), ca.vertcat(h.base_radius, 0, -h.height)) for angle in h.base_angles]
    return ca.horzcat(*A), ca.horzcat(*B)


def home_lengths(h: Any) -> Matrix:
    """|A_i^0 - B_i^0| [m], shape (6, 1): the strut lengths with which home fulfils eq. (2). Printed L = 240 mm."""
    A, B = geometry(h)
    return ca.sqrt(ca.sum1((A - B) ** 2)).T


def travel(directions: Sequence[Scalar], strut: int) -> Matrix:
    """M_i: dB_i = M_i U, shape (3, 6). Source: S0 eq. (4).

    `directions` [rad]: the angle in the base plane, from x, in which each of the six actuators moves its stage.
    """
    columns = [
        ca.vertcat(ca.cos(angle), ca.sin(angle), 0) if stage == STAGE_OF_STRUT[strut] else ca.DM.zeros(3, 1)
        for angle, stage in zip(directions, STAGE_OF_ACTUATOR, strict=True)
    ]
    return ca.horzcat(*columns)


def spans(
    pose: Matrix,
    u: Matrix,
    h: Any,
    directions: Sequence[Scalar],
    rotation: Callable[[Matrix], Matrix] = rotation_vector,
) -> Matrix:
    """A_i - B_i [m], shape (3, 6), with A_i = R(theta) A_i^0 + delta and B_i = B_i^0 + M_i U.

    R(theta) is the `rotation` by the vector theta, exact unless given; S0 eq. (3) is its first order.
    """
    A, B = geometry(h)
    R = rotation(pose[:3])
    return ca.horzcat(
        *(ca.mtimes(R, A[:, i]) + pose[3:] - B[:, i] - ca.mtimes(travel(directions, i), u) for i in range(6))
    )


def constraint(pose: Matrix, u: Matrix, h: Any, directions: Sequence[Scalar], lengths: Matrix) -> Matrix:
    """(A_i - B_i)' (A_i - B_i) - L_i^2 [m^2], shape (6, 1); zero where every strut keeps its length.

    Source: S0 eq. (2). `lengths` (6, 1) [m].
    """
    return ca.sum1(spans(pose, u, h, directions) ** 2).T - lengths**2


def loop_closure(pose: Matrix, u: Matrix, h: Any, directions: Sequence[Scalar]) -> Matrix:
    """`constraint` with the lengths of home, over 2 L_i [m], shape (6, 1), its rotation to second order."""
    A_B, L = spans(pose, u, h, directions, rotation_to_second_order), home_lengths(h)
    return (ca.sum1(A_B**2).T - L**2) / (2 * L)


def jacobian_left(h: Any) -> Matrix:
    """[J_l], rows (A_i^0 - B_i^0)' [-A_i^0 x | I], shape (6, 6) [m^2, m]. Source: S0 eq. (7), (8)."""
    A, B = geometry(h)
    D = A - B
    return ca.vertcat(*(ca.mtimes(D[:, i].T, ca.horzcat(-ca.skew(A[:, i]), ca.DM.eye(3))) for i in range(6)))


def jacobian_right(h: Any, directions: Sequence[Scalar]) -> Matrix:
    """[J_r], rows (A_i^0 - B_i^0)' M_i, shape (6, 6) [m]. Source: S0 eq. (9) with the directions read from it."""
    A, B = geometry(h)
    return ca.vertcat(*(ca.mtimes((A[:, i] - B[:, i]).T, travel(directions, i)) for i in range(6)))


def kinematic_jacobian(h: Any, directions: Sequence[Scalar]) -> Matrix:
    """[J^k] = [J_l]^-1 [J_r], twist per actuator displacement, shape (6, 6) [rad/m, 1]. Source: S0 eq. (6), (10)."""
    return ca.solve(jacobian_left(h), jacobian_right(h, directions))


def commands(J: Matrix, T: Matrix) -> Matrix:
    """U = [J]^-1 T [m], one column a pose, shape (6, n). Source: S0 eq. (11) and section 5.1, step 2."""
    return ca.solve(J, T)


def cube_to_platform(h: Scalar) -> Matrix:
    """[Ad]: T = [Ad] ^cT, hence [J^c] = [Ad] [J_cube], shape (6, 6). Source: S0 eq. (15), (16).

    The cube's centre is `h` [m] below the platform's, at (0, 0, -h), as in the printed matrix; the printed t = (0, 0, h)
    has the opposite sign.
    """
    return adjoint(None, (0, 0, -h))

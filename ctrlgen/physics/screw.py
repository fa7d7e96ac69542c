"""Screw algebra of flexure chains: twists, wrenches, adjoints, series and parallel connection.

Order (S1 section 2.2): twist ``T = (theta_x, theta_y, theta_z, delta_x, delta_y, delta_z)``
[rad, m], wrench ``W = (F_x, F_y, F_z, M_x, M_y, M_z)`` [N, N m], ``W = K T``, ``T = C W``.
Because force comes before moment, the same adjoint transforms twists and wrenches.

Every function takes CasADi SX, DM or plain numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Literal, TypeAlias, get_args

import casadi as ca
import numpy as np

TwistComponent = Literal["theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z"]
WrenchComponent = Literal["F_x", "F_y", "F_z", "M_x", "M_y", "M_z"]
TWIST: tuple[str, ...] = get_args(TwistComponent)
WRENCH: tuple[str, ...] = get_args(WrenchComponent)
Matrix: TypeAlias = ca.SX | ca.DM
Scalar: TypeAlias = float | ca.SX


def told_in(component: str) -> str:
    """The unit in which a component of a twist is told: 'urad' of a turn, 'um' of a displacement."""
    return "urad" if component.startswith("theta") else "um"


def numbers(matrix: Matrix) -> np.ndarray:
    """A matrix without symbols as an array (rows, columns)."""
    return np.array(ca.evalf(ca.SX(matrix)).full())


def rotation_z(angle: Scalar) -> Matrix:
    """[Z(angle)], rotation about z, shape (3, 3). Source: S1 section 2.2."""
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(ca.horzcat(c, -s, 0), ca.horzcat(s, c, 0), ca.horzcat(0, 0, 1))


def rotation_to(axis: Matrix) -> Matrix:
    """A rotation whose first column is the unit vector `axis`, shape (3, 3).

    The other two columns are any right-handed completion, which makes no difference for a body of revolution.
    `axis` must not be parallel to x.
    """
    y = ca.cross(axis, ca.DM([1, 0, 0]))
    y = y / ca.norm_2(y)
    return ca.horzcat(axis, y, ca.cross(axis, y))


FULL_TURN = 2 * math.pi  # rad, the largest rotation vector for which `turned` holds
_TERMS = 16  # of each series: at a full turn the next one is 5e-20 of the sum


def turned(theta: Matrix, vectors: Matrix) -> Matrix:
    """(R - I) `vectors` for a rotation vector `theta` (3,) [rad] of at most a full turn, shape (3, n) as the vectors:

    (R - I) r = s c theta x r + s^2/2 theta x (theta x r),   s = sin(a/2)/(a/2), c = cos(a/2), a = |theta|:

    Rodrigues' formula in half angles, which subtracts nothing near theta = 0. s and c are their power series in (a/2)^2, exact to
    rounding with all derivatives: roots and quotients would spoil those near theta = 0, the third one by its own size.
    """
    square, S = ca.dot(theta, theta) / 4, ca.skew(theta)
    s, c = (_series([(-1) ** k / math.factorial(2 * k + odd) for k in range(_TERMS)], square) for odd in (1, 0))
    across = ca.mtimes(S, vectors)
    return s * c * across + s**2 / 2 * ca.mtimes(S, across)


def _series(coefficients: Sequence[float], x: Matrix) -> Matrix:
    """The polynomial of these coefficients, lowest first."""
    value = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        value = value * x + coefficient
    return value


def rotation_vector(theta: Matrix) -> Matrix:
    """R, shape (3, 3): the rotation by |theta| [rad] about theta, see `turned`."""
    return ca.DM.eye(3) + turned(theta, ca.DM.eye(3))


def rotation_to_second_order(theta: Matrix) -> Matrix:
    """R = I + S + S^2/2, S = [theta x], shape (3, 3): the rotation by the vector `theta` [rad] up to third order."""
    S = ca.skew(theta)
    return ca.DM.eye(3) + S + ca.mtimes(S, S) / 2


def adjoint(rotation: Matrix | None = None, position: Sequence[Scalar] | Matrix = (0, 0, 0)) -> Matrix:
    """[Ad] = [[R, 0], [D R, R]], D the cross-product matrix of `position`, shape (6, 6).

    Transforms a twist or wrench from the local frame to the reference frame in which
    `rotation` and `position` [m] are given. Source: S1 eq. (2).
    """
    R = ca.DM.eye(3) if rotation is None else rotation
    d = position if isinstance(position, (ca.SX, ca.DM)) else ca.vertcat(*position)
    return ca.vertcat(ca.horzcat(R, ca.DM.zeros(3, 3)), ca.horzcat(ca.mtimes(ca.skew(d), R), R))


def inverse_adjoint(rotation: Matrix | None = None, position: Sequence[Scalar] | Matrix = (0, 0, 0)) -> Matrix:
    """[Ad]^-1 in closed form: [[R', 0], [-R' D, R']], shape (6, 6)."""
    R = ca.DM.eye(3) if rotation is None else rotation
    d = position if isinstance(position, (ca.SX, ca.DM)) else ca.vertcat(*position)
    return ca.vertcat(ca.horzcat(R.T, ca.DM.zeros(3, 3)), ca.horzcat(-ca.mtimes(R.T, ca.skew(d)), R.T))


def move(matrix: Matrix, rotation: Matrix | None = None, position: Sequence[Scalar] | Matrix = (0, 0, 0)) -> Matrix:
    """[Ad] [C] [Ad]^-1: a compliance or stiffness expressed in another frame. Source: S1 eq. (1), (3)."""
    return ca.mtimes([adjoint(rotation, position), matrix, inverse_adjoint(rotation, position)])


_LENGTH = ca.diag(ca.DM([1, 1, 1, 1e3, 1e3, 1e3]))  # displacements and moments in units of 1 mm
_PER_LENGTH = ca.diag(ca.DM([1, 1, 1, 1e-3, 1e-3, 1e-3]))


def solve(matrix: Matrix, right: Matrix) -> Matrix:
    """x with `matrix` x = `right`, for a compliance or stiffness, shape (6, n).

    It is solved with lengths in mm, where forces and moments are of similar size; in m half of the digits are lost.
    """
    scaled = ca.mtimes([_LENGTH, matrix, _PER_LENGTH])
    return ca.mtimes(_PER_LENGTH, ca.solve(scaled, ca.mtimes(_LENGTH, right)))


def inverse(matrix: Matrix) -> Matrix:
    """Compliance from stiffness or back, shape (6, 6)."""
    return solve(matrix, ca.DM.eye(6))


def series(compliances: Iterable[Matrix]) -> Matrix:
    """Compliance of a serial chain, all members in one frame. Source: S1 eq. (1)."""
    members = list(compliances)
    return sum(members[1:], members[0])


def parallel(stiffnesses: Iterable[Matrix]) -> Matrix:
    """Stiffness of parallel members, all in one frame. Source: S1 eq. (3)."""
    members = list(stiffnesses)
    return sum(members[1:], members[0])

"""Damping of a structure by a damping ratio that all its modes have."""

from __future__ import annotations

import casadi as ca

from ctrlgen.physics.screw import Matrix, Scalar

ROOT_STEPS = 16  # Newton steps of the matrix root: frequencies up to a thousand times apart, and five steps to rounding


def modal_damping(M: Matrix, K: Matrix, ratio: Scalar) -> Matrix:
    """D = 2 ratio M (M^-1 K)^(1/2) (n, n) [N s/m]: M d'' + D d' + K d = 0 has every mode with the damping ratio `ratio`.

    `M` and `K` (n, n) are symmetric and positive. With one axis D = 2 ratio sqrt(K M). Source: R. W. Clough, J. Penzien, Dynamics of
    Structures (1993), section 12-5.
    """
    if M.shape[0] == 1:
        return 2 * ratio * ca.sqrt(K * M)
    return 2 * ratio * ca.mtimes(M, square_root(ca.mtimes(ca.inv(M), K)))


def square_root(A: Matrix) -> Matrix:
    """A^(1/2) (n, n) of a matrix with positive eigenvalues, as an expression.

    Y = (Y + Z^-1)/2, Z = (Z + Y^-1)/2 from Y = A/s, Z = 1, where s is the mean eigenvalue. Source: E. D. Denman, A. N. Beavers,
    Appl. Math. Comput. 2 (1976) 63.
    """
    n = A.shape[0]
    s = ca.trace(A) / n
    Y, Z = A / s, ca.DM.eye(n)
    for _ in range(ROOT_STEPS):
        Y, Z = (Y + ca.inv(Z)) / 2, (Z + ca.inv(Y)) / 2
    return ca.sqrt(s) * Y

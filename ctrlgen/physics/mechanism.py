"""Rigid bodies joined by flexures: stiffness assembled over all bodies, and what loads and prescribed motions do to them.

Every body's twist T = (theta, delta) is taken at the origin of the global frame, in its axes, so that an element between two
bodies carries W = K (T_to - T_from - m s): K is its stiffness there, m s what prescribes its motion (a stage's stroke). Balance of
every body, sum of W = load, is solved body by body (block elimination, least connected first), symbolically or in numbers.

Source: direct stiffness method, J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), chapters 5 and 6, in the screw
notation of S1 section 2.2.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from ctrlgen.physics.screw import Matrix

GROUND = -1  # stands for the body that does not move


@dataclass(frozen=True)
class Element:
    """A flexure from body `first` to body `second` (`GROUND`: none), `stiffness` (6, 6) [N/m ...] in the global frame."""

    first: int
    second: int
    stiffness: Matrix


def frame(along: Matrix, across: Matrix) -> Matrix:
    """R (3, 3) with x along `along`, y in the plane of both on the side of `across`, z completing them."""
    x = along / ca.norm_2(along)
    y = across - ca.dot(across, x) * x
    y = y / ca.norm_2(y)
    return ca.horzcat(x, y, ca.cross(x, y))


def point_motion(point: Matrix, direction: Matrix) -> Matrix:
    """(1, 6): displacement of `point` along the unit vector `direction` per twist, n . (delta + theta x p)."""
    return ca.horzcat(ca.cross(point, direction).T, direction.T)


def point_force(point: Matrix, direction: Matrix) -> Matrix:
    """(6, 1): the wrench of a unit force along `direction` at `point`, (n, p x n)."""
    return ca.vertcat(direction, ca.cross(point, direction))


def twists(count: int, elements: Sequence[Element], loads: Mapping[int, Matrix], size: float = 1e-3) -> list[Matrix]:
    """The twists (6, n) of `count` bodies under `loads` {body: wrenches (6, n)} at the global origin; `size` [m] of the mechanism, in
    which lengths are counted while it is solved.

    A body k that is eliminated leaves, with S = sum_j K_kj over its neighbours and the ground, K_ik S^-1 K_kj between each two of
    them and K_ik S^-1 W_k on them. Nothing is subtracted, so that soft flexures in series with stiff ones lose no digits (the block
    form of W. K. Grassmann, M. I. Taksar, D. P. Heyman, Oper. Res. 33 (1985) 1107). Raises ValueError naming a body (by its
    number) that nothing joins to the ground.
    """
    if loose := loose_bodies(count, elements):
        raise ValueError(f"body {loose[0]} is not joined to the ground")
    K: list[dict[int, Matrix]] = [{} for _ in range(count)]  # K[i][j]: the wrench on i per T_i - T_j
    for e in elements:
        for i, j in ((e.first, e.second), (e.second, e.first)):
            if i != GROUND:
                K[i][j] = K[i][j] + e.stiffness if j in K[i] else e.stiffness
    columns = next((W.shape[1] for W in loads.values()), 0)
    right = [loads.get(i, ca.DM.zeros(6, columns)) for i in range(count)]
    left, order = set(range(count)), []
    while left:  # forward elimination
        k = min(left, key=lambda i: (len(K[i].keys() & left), i))
        left.remove(k)
        order.append(k)
        near = sorted(j for j in K[k] if j in left or j == GROUND)
        S = sum((K[k][j] for j in near[1:]), K[k][near[0]])
        reduced = _solve(S, size, ca.horzcat(*(K[k][j] for j in near), right[k]))
        *factors, T = ca.horzsplit(reduced, [*(6 * i for i in range(len(near) + 1)), reduced.shape[1]])
        for i in near:
            if i == GROUND:
                continue
            for j, factor in zip(near, factors, strict=True):
                if i != j:
                    passed = ca.mtimes(K[i][k], factor)
                    K[i][j] = K[i][j] + passed if j in K[i] else passed
            right[i] = right[i] + ca.mtimes(K[i][k], T)
        K[k] = {j: factor for j, factor in zip(near, factors, strict=True) if j != GROUND}
        right[k] = T
    for k in reversed(order):  # back substitution: T_k = S^-1 (sum_j K_kj T_j + W_k)
        for j, factor in K[k].items():
            right[k] = right[k] + ca.mtimes(factor, right[j])
    return right


def loose_bodies(count: int, elements: Sequence[Element]) -> list[int]:
    """The bodies that no chain of elements joins to the ground."""
    joined, grown = {GROUND}, True
    while grown:
        reached = {b for e in elements for b in (e.first, e.second) if {e.first, e.second} & joined}
        grown = not reached <= joined
        joined |= reached
    return [i for i in range(count) if i not in joined]


def _solve(matrix: Matrix, size: float, right: Matrix) -> Matrix:
    """x with `matrix` x = `right` (6, n), lengths in units of `size`: forces and moments are then of similar magnitude.

    Wrenches written as (moment; force), the matrix is symmetric and positive, and L D L' needs no pivots: a third of the operations
    of the QR decomposition that CasADi would write, which are what a compiler sees of a mechanism.
    Source: G. H. Golub, C. F. Van Loan, Matrix Computations (4th ed.), section 4.2.
    """
    per, times, swap = ca.DM([1 / size] * 3 + [1] * 3), ca.DM([1, 1, 1, *[size] * 3]), [3, 4, 5, 0, 1, 2]
    A = ca.mtimes([ca.diag(per), matrix[swap, :], ca.diag(times)])
    x = _symmetric_solver(right.shape[1])(A, ca.mtimes(ca.diag(per), right[swap, :]))
    return ca.mtimes(ca.diag(times), x)


@functools.cache
def _symmetric_solver(columns: int) -> ca.Function:
    """(A, b) -> x with A x = b (6, columns), A (6, 6) symmetric and positive, by A = L D L'; its lower triangle is read."""
    n, A, right = 6, ca.SX.sym("A", 6, 6), ca.SX.sym("b", 6, columns)
    below: list[list[Any]] = [[] for _ in range(n)]  # L, row by row
    pivots: list[Any] = []
    for i in range(n):
        for j in range(i):
            scaled = A[i, j] - sum(below[i][k] * pivots[k] * below[j][k] for k in range(j))
            below[i].append(scaled / pivots[j])
        pivots.append(A[i, i] - sum(below[i][k] ** 2 * pivots[k] for k in range(i)))
    rows: list[Any] = []
    for i in range(n):
        rows.append(right[i, :] - sum(below[i][k] * rows[k] for k in range(i)))
    rows = [row / pivot for row, pivot in zip(rows, pivots, strict=True)]
    for i in reversed(range(n)):
        rows[i] = rows[i] - sum(below[k][i] * rows[k] for k in range(i + 1, n))
    return ca.Function("solve", [A, right], [ca.vertcat(*rows)])

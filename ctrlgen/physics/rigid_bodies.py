"""Rigid bodies joined by flexures: stiffness assembled over all bodies, and what loads and prescribed motions do to them.

Every body's twist T = (theta, delta) is taken at the origin of the global frame, in its axes, so that an element between two
bodies carries W = K (T_to - T_from - m s): K is its stiffness there, m s what prescribes its motion (a stage's stroke). Balance of
every body, sum of W = load, is solved body by body (block elimination, least connected first), symbolically or in numbers.

Source: direct stiffness method, J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), chapters 5 and 6, in the screw
notation of S1 section 2.2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from ctrlgen.numerics.symmetric_solve import factor, substitute
from ctrlgen.physics.screw import Matrix

GROUND = -1  # stands for the body that does not move


@dataclass(frozen=True)
class Element:
    """A flexure from body `first` to body `second` (`GROUND`: none), `stiffness` (6, 6) [N/m ...] in the global frame: the wrench on
    `second` per T_second - T_first. A pair of a part that joins more bodies, `of_many`, has no symmetric one: with the wrenches as
    (moment; force) that on `first` per T_first - T_second is its transpose."""

    first: int
    second: int
    stiffness: Matrix
    of_many: bool = False


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
    form of W. K. Grassmann, M. I. Taksar, D. P. Heyman, Oper. Res. 33 (1985) 1107). Wrenches written as (moment; force), K_ji is the
    transpose of K_ij, and what two flexures in series leave, (K_ik^-1 + K_kj^-1)^-1, is symmetric: only what differs is computed.
    Raises ValueError naming a body (by its number) that nothing joins to the ground.
    """
    if loose := loose_bodies(count, elements):
        raise ValueError(f"body {loose[0]} is not joined to the ground")
    counted = ca.diag(ca.DM([1 / size] * 3 + [1] * 3))  # T and (moment; force) to and from lengths in units of `size`
    swap = [3, 4, 5, 0, 1, 2]
    K: list[dict[int, Matrix]] = [{} for _ in range(count)]  # K[i][j]: the wrench on i per T_i - T_j
    skew: set[tuple[int, int]] = set()  # the pairs whose K is not symmetric
    for e in elements:
        block = ca.mtimes([counted, e.stiffness[swap, :], counted])
        block = block if e.of_many else _mirrored(block)
        for i, j, on_i in ((e.first, e.second, block.T if e.of_many else block), (e.second, e.first, block)):
            if i != GROUND:
                K[i][j] = K[i][j] + on_i if j in K[i] else on_i
        skew |= {_pair(e.first, e.second)} if e.of_many else set()
    columns = next((W.shape[1] for W in loads.values()), 0)
    right = [ca.mtimes(counted, loads[i][swap, :]) if i in loads else ca.DM.zeros(6, columns) for i in range(count)]
    left = set(range(count))
    order: list[int] = []
    factors: dict[int, Matrix] = {}
    while left:  # forward elimination
        k = min(left, key=lambda i: (len(K[i].keys() & left), i))
        left.remove(k)
        order.append(k)
        near = sorted(j for j in K[k] if j in left or j == GROUND)  # the ground first
        factors[k] = factor(sum((K[k][j] for j in near[1:]), K[k][near[0]]))
        solved = substitute(factors[k], ca.horzcat(right[k], *(K[k][j] for j in near[:-1])))
        T, *moved = ca.horzsplit(solved, [0, *(columns + 6 * i for i in range(len(near)))])
        series = len(near) == 2 and not {_pair(k, j) for j in near} & skew
        for j, motion in zip(near[:-1], moved, strict=True):
            for i in near:
                if i > j:
                    passed = ca.mtimes(K[i][k], motion)
                    passed = _mirrored(passed) if series else passed
                    K[i][j] = K[i][j] + passed if j in K[i] else passed
                    if j != GROUND:
                        K[j][i] = K[i][j].T
                    if not series:
                        skew.add(_pair(i, j))
        for i in near:
            if i != GROUND:
                right[i] = right[i] + ca.mtimes(K[i][k], T)
        right[k] = T
        K[k] = {j: K[k][j] for j in near if j != GROUND}
    for k in reversed(order):  # back substitution: T_k = S^-1 (sum_j K_kj T_j + W_k)
        if K[k]:
            right[k] = right[k] + substitute(factors[k], sum(ca.mtimes(block, right[j]) for j, block in K[k].items()))
    return [ca.mtimes(counted, T) for T in right]


def _pair(i: int, j: int) -> tuple[int, int]:
    return min(i, j), max(i, j)


def _mirrored(matrix: Matrix) -> Matrix:
    """A symmetric matrix whose upper triangle is its lower one: the same expressions, which are evaluated once."""
    return ca.tril2symm(ca.tril(matrix))


def loose_bodies(count: int, elements: Sequence[Element]) -> list[int]:
    """The bodies that no chain of elements joins to the ground."""
    joined, grown = {GROUND}, True
    while grown:
        reached = {b for e in elements for b in (e.first, e.second) if {e.first, e.second} & joined}
        grown = not reached <= joined
        joined |= reached
    return [i for i in range(count) if i not in joined]

"""The second order of what a constraint defines, such as the pose of a linkage whose links keep their lengths."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca


def second_order(closure: Callable[[ca.SX, ca.SX], ca.SX], d: ca.SX) -> ca.SX:
    """pose_2 (n,) of pose = J d + pose_2 + ..., second order in the displacements `d` (m,), with closure(pose, d) = 0 (n,).

    With f_p, f_d the closure's derivatives at home, p_1 = -f_p^-1 f_d d = J d the first order and f(s) the closure along
    (s p_1, s d): pose_2 = -f_p^-1 f''(0)/2. The closure is zero at home and needs its rotations to second order.
    Source: implicit differentiation; J.-P. Merlet, Parallel Robots (2006), chapter 4: loop closure.
    """
    pose, moved, s = ca.SX.sym("pose", d.shape[0]), ca.SX.sym("moved", d.shape[0]), ca.SX.sym("s")
    f = closure(pose, moved)
    both = ca.vertcat(pose, moved)
    f_p, f_d = ca.substitute([ca.jacobian(f, pose), ca.jacobian(f, moved)], [both], [ca.DM.zeros(both.shape)])
    first = -ca.solve(f_p, ca.mtimes(f_d, d))
    along = ca.substitute(f, both, s * ca.vertcat(first, d))
    curvature = ca.substitute(ca.jacobian(ca.jacobian(along, s), s), s, 0)
    return -ca.solve(f_p, curvature) / 2

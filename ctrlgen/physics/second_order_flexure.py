"""How flexures deform to second order in the motions of their ends: finite rotations, and what bending shortens, turns and twists.

A body that turns by the vector theta and whose point at the origin moves by delta takes its point r to exp(theta x) r + delta. Seen
from the body at its fixed end, the free end of a flexure then deforms it by e = e_1 + e_2: linear in the motions, and quadratic. The
elastic energy of the flexure to third order is e_1' K e_1/2 + W . (e_2 + i), W = K e_1 its load to first order and i what its own
shape adds, so that e_2 + i acts like a deformation. All are bilinear in two motions; columns are motions.

Sources: geometrically exact rods, J. C. Simo, Comput. Methods Appl. Mech. Eng. 49 (1985) 55, their strains expanded to second order;
for a straight beam in a plane, the coefficients 6/5, -1/10 and 2/15 of S. Awtar, A. H. Slocum, E. Sevincer, J. Mech. Des. 129 (2007)
625, eq. (5) to (8).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.physics.flexure import Segment, bent
from ctrlgen.physics.screw import Matrix

NEXT, LAST = [1, 2, 0], [2, 0, 1]  # rows in a cross product: three at once, as a mechanism has thousands of them
AXIS = ca.DM([1, 0, 0])
# Exact to the fifth degree; the strains are of the fourth along a segment.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(3)
AWTAR_2 = ca.DM([[-1 / 700, 1 / 1400], [1 / 1400, -11 / 6300]])  # of (displacement/l, rotation): p^2 in a beam-column


def dot(load: Matrix, deformation: Matrix) -> Matrix:
    """(1, m): F . delta + M . theta of wrenches (6, m) and twists (6, m), column by column."""
    return ca.sum1(load[:3, :] * deformation[3:, :] + load[3:, :] * deformation[:3, :])


def cross(a: Matrix, b: Matrix) -> Matrix:
    """a x b (3, m), column by column."""
    return a[NEXT, :] * b[LAST, :] - a[LAST, :] * b[NEXT, :]


def relative_motion(point: Matrix, first: Matrix, second: Matrix, a: Sequence[int], b: Sequence[int]) -> Matrix:
    """e_2 (6, m) in the columns `a` and `b` of the twists `first` and `second` (6, k): rotation vector of the second body and
    displacement of its `point`, seen from the first body, in the axes that it has at home.

    log(R_1' R_2) = theta_2 - theta_1 - theta_1 x theta_2/2 and R_1' (R_2 r + delta_2 - R_1 r - delta_1), half of each order of the
    two columns.
    """
    if all(
        isinstance(x, ca.DM) for x in (point, first, second)
    ):  # NumPy is faster on so few numbers, and there are many flexures
        arm, one, two = (x.full() for x in (point, first, second))
        return ca.DM(np.vstack(_relative(arm, one, two, a, b)) + np.vstack(_relative(arm, one, two, b, a))) / 2
    arm = ca.repmat(point, 1, len(a))
    return (ca.vertcat(*_relative(arm, first, second, a, b)) + ca.vertcat(*_relative(arm, first, second, b, a))) / 2


def _relative(arm: Any, first: Any, second: Any, a: Sequence[int], b: Sequence[int]) -> tuple[Any, Any]:
    """Rotation and displacement (3, m); of NumPy or CasADi, as the arguments are."""
    one, two = first[:3, :], second[:3, :]
    between = two - one
    moved = second[3:, b] - first[3:, b] + cross(between[:, b], arm)
    turned = cross(two[:, a], cross(two[:, b], arm)) - cross(one[:, a], cross(one[:, b], arm))
    return -cross(one[:, a], between[:, b]) / 2, turned / 2 - cross(one[:, a], moved)


def point_flexure(twist: Matrix, a: Sequence[int], b: Sequence[int]) -> Matrix:
    """i (6, m) of a flexure that yields at one point, from its deformations `own` (6, k): a displacement counts in the axes halfway
    between those of both bodies, as the two are alike, -theta x delta/2."""
    halves = cross(twist[:3, a], twist[3:, b]) + cross(twist[:3, b], twist[3:, a])
    return ca.vertcat(ca.DM.zeros(3, len(a)), -halves / 4)


def beam(segments: Sequence[Segment], load: Matrix, a: Sequence[int], b: Sequence[int]) -> Matrix:
    """i (6, m) of segments in line, from the fixed to the free end, x along them, from the `load` (6, k) on the free end.

    With kappa = the curvatures, psi their integral, the rotation of the section, Gamma_1 = stretch and shear, and
    u' = psi x e_x + Gamma_1, the second order of the strains is Gamma_2 = -psi x u' + psi x (psi x e_x)/2 and K_2 = -psi x kappa/2; i is
    what the free end does where those are strains without a load: the integral of K_2, and of Gamma_2 + K_2 x (l - s) e_x.
    """
    return (_beam(segments, load, a, b) + _beam(segments, load, b, a)) / 2


def _beam(segments: Sequence[Segment], load: Matrix, a: Sequence[int], b: Sequence[int]) -> Matrix:
    left = sum((s.length for s in segments[1:]), segments[0].length)  # from the section to the free end
    psi, rows = ca.DM.zeros(3, load.shape[1]), ca.vertsplit(load)
    along, across = ca.repmat(AXIS, 1, len(a)), cross(ca.repmat(AXIS, 1, load.shape[1]), load[:3, :])
    turn, shift = ca.DM.zeros(3, len(a)), ca.DM.zeros(3, len(a))
    for s in segments:
        flexibility = ca.vertcat(1 / s.GJ, 1 / s.EI_y, 1 / s.EI_z)

        strain = ca.vertcat(load[0, :] / s.EA, load[1, :] * s.shear_y, load[2, :] * s.shear_z)
        for node, weight in zip(NODES, WEIGHTS, strict=True):
            x = s.length * (1 + node) / 2
            rest = left - x
            kappa = ca.mtimes(ca.diag(flexibility), load[3:, :] + rest * across)
            R = psi + ca.vertcat(*bent(s, x, left, rows))
            slope = cross(R[:, b], along)
            Gamma = -cross(R[:, a], slope) / 2 - cross(R[:, a], strain[:, b])
            K = -cross(R[:, a], kappa[:, b]) / 2
            turn += weight * s.length / 2 * K
            shift += weight * s.length / 2 * (Gamma + rest * cross(K, along))
        psi = psi + ca.vertcat(*bent(s, s.length, left, rows))
        left = left - s.length
    return ca.vertcat(turn, shift)

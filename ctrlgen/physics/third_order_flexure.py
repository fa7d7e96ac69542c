"""What an expansion of a flexure to deformations of second order leaves out of its energy of fourth order.

A load W of first order works on deformations of third order. Seen from the body at its fixed end, R_1' (R_2 r + delta_2 - R_1 r - delta_1),
with R = exp(theta x), those of the ends follow from the series of R, and of the rotation from that of log(R_1' R_2) (Baker, Campbell,
Hausdorff). A beam that neither shears nor stretches adds Gamma_3 = -psi x (psi x (psi x e_x))/6, psi the rotation of its axis: in a plane
the work of the shear force on psi^3/6, which with that of the ends is

    integral of E I kappa^2 psi^2 / 2

beside the integral of E I kappa^2/2, (36/35) (y/l)^2 of the force of a guided blade, as in the elastica. Where a beam bends in both planes
or twists, what the two make of each other is left out here.

Source: geometrically exact rods, J. C. Simo, Comput. Methods Appl. Mech. Eng. 49 (1985) 55, their strains expanded to third order.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.physics.flexure import Segment, bent

# Exact to the seventh degree; the cube of a rotation along a segment is of the sixth.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)
ALONG = np.array([1.0, 0.0, 0.0])


def third_order_motion(point: np.ndarray, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """e_3: rotation vector (3,) [rad] of the second body and displacement (3,) [m] of its `point`, seen from the first one, to third order
    in their twists `first` and `second` (6,)."""
    one, two = first[:3], second[:3]
    moved = second[3:] - first[3:] + np.cross(two - one, point)  # of first order
    turn = (np.cross(one, np.cross(one, two)) - np.cross(two, np.cross(two, one))) / 12
    own, other = np.cross(two, np.cross(two, point)), np.cross(one, np.cross(one, point))
    shift = np.cross(two, own) / 6 - np.cross(one, own) / 2 + np.cross(one, np.cross(one, moved)) / 2
    return turn, shift + np.cross(one, other) / 3


def third_order_work(segments: Sequence[Segment], load: np.ndarray) -> float:
    """[N m] of the `load` (6,) on the free end, force and moment in the frame of the beam, on Gamma_3 of segments in line."""
    left = sum(float(s.length) for s in segments)
    force, psi, work = load[:3], np.zeros(3), 0.0
    for s in segments:
        length = float(s.length)
        sheared = np.array([0.0, -float(s.shear_z) * force[2], float(s.shear_y) * force[1]])
        for x, weight in zip(length * (1 + NODES) / 2, length * WEIGHTS / 2, strict=True):
            turned = psi + sheared + np.array(bent(s, x, left, load), float)
            work -= weight * force @ np.cross(turned, np.cross(turned, np.cross(turned, ALONG))) / 6
        psi = psi + np.array(bent(s, length, left, load), float)
        left -= length
    return float(work)

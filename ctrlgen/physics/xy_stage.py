"""The X-Y stage: notch flexures, levers, and the force its actuators need. Source: S1 sections 3.2-4.

One axis (the X stage; the Y stage is the same rotated by 90 degrees) moves along its local x. Four arms of length e_4
along y connect ground and the moving plate: two are levers, driven through a notch at e_3 from their root, two only guide.
Fig. 5 and 6, which show the positions of the arms, are not legible; these positions on the plate and the lever's axial
compliance are our reconstruction.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from ctrlgen.physics import thermal_actuator
from ctrlgen.physics.flexure import blade_compliance
from ctrlgen.physics.screw import Matrix, Scalar, inverse, move, parallel, rotation_z, series


def linear_force(d: Scalar, s: Any, a: Any) -> Scalar:
    """F^l = (K^t_14 / r + r N / (c e_4^2)) d [N] on the actuator bar, `d` [m] the stage displacement.

    r = e_4/e_3 is the lever ratio, N the number of notches, each rotating by d/e_4, and c = theta_z/M_z
    the rotational compliance of one. Source: S1 eq. (9), referred to the bar by virtual work.
    """
    r = s.lever_long / s.lever_short
    K_t14 = thermal_actuator.stiffness(a)[0, 3]
    return (K_t14 / r + r * s.notches / (s.notch.theta_z_per_M_z * s.lever_long**2)) * d


def rotation(d: Scalar, s: Any) -> Scalar:
    """phi = asin(d/e_4) [rad], the rotation of lever and guide. Source: S1 section 4.2."""
    return ca.asin(d / s.lever_long)


def parasitic(d: Scalar, s: Any) -> Scalar:
    """delta_y = e_4 - sqrt(e_4^2 - d^2) [m]. Source: S1 eq. (10).

    Computed as d^2 / (e_4 + sqrt(e_4^2 - d^2)), which does not cancel in single precision.
    """
    return d**2 / (s.lever_long + ca.sqrt(s.lever_long**2 - d**2))


def nonlinear_force(d: Scalar, s: Any) -> Scalar:
    """F^n = 2 r k_a sin(phi) cos(phi) delta_y [N] on the bar, sin(phi) = d/e_4, r = e_4/e_3.

    The axial stiffness k_a of one half stage, rotated by phi, resists the parasitic shortening delta_y of eq. (10).
    Source: S1 eq. (11), with K^n the rotated axial stiffness.
    """
    r = s.lever_long / s.lever_short
    sin_phi = d / s.lever_long
    cos_phi = ca.sqrt(s.lever_long**2 - d**2) / s.lever_long
    return 2 * r * s.half_stage_stiffness * sin_phi * cos_phi * parasitic(d, s)


def force(d: Scalar, s: Any, a: Any) -> Scalar:
    """F = F^l + F^n [N] on the bar for a stage displacement `d` [m]. Source: S1 eq. (12)."""
    return linear_force(d, s, a) + nonlinear_force(d, s)


def stiffened(d: Matrix, s: Any, a: Any) -> Matrix:
    """c(0) - c(d) [m/N] of each axis: by how much a plate at `d` (n,) is less compliant along its axis than at home.

    c = r / (dF/dd), the force on the plate being 1/r of that on the bar. Source: S1 eq. (12), differentiated.
    """
    r = s.lever_long / s.lever_short
    at = ca.SX.sym("d")
    slope = ca.gradient(force(at, s, a), at)
    slope = ca.vertcat(*(ca.substitute(slope, at, x) for x in ca.vertsplit(ca.SX(d))))
    home = linear_force(1.0, s, a)
    return r / home - r / slope


def notch_compliance(s: Any) -> Matrix:
    """[C^c] of a circular notch about its free end, x along the flexure, shape (6, 6). Source: S1 eq. (7).

    The coupling entries are printed twice with different rounding (7.10 and 7.11, -0.802 and -0.801); by reciprocity they
    are equal, and the mean is taken.
    """
    n = s.notch
    z = (n.theta_z_per_F_y + n.delta_y_per_M_z) / 2
    y = (n.theta_y_per_F_z + n.delta_z_per_M_y) / 2
    rows = [
        [0, 0, 0, n.theta_x_per_M_x, 0, 0],
        [0, 0, y, 0, n.theta_y_per_M_y, 0],
        [0, z, 0, 0, 0, n.theta_z_per_M_z],
        [n.delta_x_per_F_x, 0, 0, 0, 0, 0],
        [0, n.delta_y_per_F_y, 0, 0, 0, z],
        [0, 0, n.delta_z_per_F_z, 0, y, 0],
    ]
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def lever_compliance(s: Any, a: Any) -> Matrix:
    """Lever or guide beam between two notches, x along it, about its far end, shape (6, 6).

    A blade of length e_4 - 2 r. Its axial compliance is chosen so that an arm (beam and two notches) has half of k_a,
    because a half stage has two arms in parallel.
    """
    C = blade_compliance(s.lever_long - 2 * s.notch_radius, a.thickness, s.lever_width, a.young, a.poisson)
    C = move(C, _QUARTER_TURN_X)  # the blade is thin along z
    axial = 2 / s.half_stage_stiffness - 2 * s.notch.delta_x_per_F_x
    return C + (axial - C[3, 0]) * _AXIAL


_AXIAL = ca.DM(ca.Sparsity.triplet(6, 6, [3], [0]), [1])
_QUARTER_TURN_X = ca.DM([[1, 0, 0], [0, 0, -1], [0, 1, 0]])


def _arm_stiffness(root: Matrix, s: Any, a: Any) -> Matrix:
    """Stiffness of root compliance, lever beam and end notch in series, about the end notch's centre.

    x runs along the arm from the root's centre at (-e_4, 0, 0) to the end's at the origin; `root` is given
    about its own centre.
    """
    r = s.notch_radius
    return inverse(
        series(
            (
                move(root, None, (-s.lever_long, 0, 0)),
                move(lever_compliance(s, a), None, (-r, 0, 0)),
                move(notch_compliance(s), None, (r, 0, 0)),
            )
        )
    )


def axis_stiffness(s: Any, a: Any) -> Matrix:
    """[K^X] = sum of blocks 1-4 about the plate's centre, local x the actuated direction, shape (6, 6).

    Blocks 1, 2: ground notch parallel to (half actuator in series with its notch), then lever and
    end notch. Blocks 3, 4: notch, guide beam, notch. Source: S1 section 3.4, steps 1-3.
    """
    about_centre = move(notch_compliance(s), None, (s.notch_radius, 0, 0))
    half_actuator = 2 * inverse(thermal_actuator.stiffness(a))
    drive = series((half_actuator, about_centre))
    blocks = []
    for side in (1, -1):  # the arm runs from (x, side (b + e_4)) to (x, side b)
        # In the arm's frame (x along the arm) the bar pushes along +y or -y: the two blocks are mirror images.
        push = rotation_z(side * ca.pi / 2)
        driven_root = inverse(parallel((inverse(about_centre), move(inverse(drive), push, (s.lever_short, 0, 0)))))
        toward_plate = rotation_z(-side * ca.pi / 2)
        for x, root in ((-s.plate_half_length, driven_root), (s.plate_half_length, about_centre)):
            blocks.append(move(_arm_stiffness(root, s, a), toward_plate, (x, side * s.plate_half_width, 0)))
    return parallel(blocks)


def stage_compliance(s: Any, a: Any) -> Matrix:
    """[C^XY] = Ad^X C^X Ad^X^-1 + Ad^Y C^Y Ad^Y^-1 at the stage centre, shape (6, 6). Source: S1 eq. (8).

    The Y stage is the X stage rotated by 90 degrees, with its centre at e_8 along the stage's y.
    """
    C_X = inverse(axis_stiffness(s, a))
    return series((C_X, move(C_X, rotation_z(ca.pi / 2), (0, s.centre_offset, 0))))

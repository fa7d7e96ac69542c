"""The hexapod on three X-Y stages: geometry, strut stiffness, Jacobian, wire stress.

Source: S1 section 5. The origin of the global frame is the centre of the platform's top face at home.
Actuator order: d = (1X, 1Y, 2X, 2Y, 3X, 3Y) [m]; pose order: the twist (theta, delta).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from ctrlgen.physics.flexure import round_section, round_stress, wire_compliance
from ctrlgen.physics.screw import (
    Matrix,
    inverse,
    inverse_adjoint,
    move,
    parallel,
    rotation_to,
    rotation_to_second_order,
    rotation_z,
    series,
    solve,
)

STAGE_OF_STRUT = (0, 1, 1, 2, 2, 0)  # struts 1 and 6 stand on stage 1, 2 and 3 on stage 2, 4 and 5 on stage 3


@dataclass(frozen=True)
class Geometry:
    """Strut ends and stage frames, lengths in m.

    `platform` A_i and `base` B_i: six points each; `centre`: the three stage centres, midway
    between the two B_i on a stage; `rotation`: the three rotations from stage to global frame.
    """

    platform: list[Matrix]
    base: list[Matrix]
    centre: list[Matrix]
    rotation: list[Matrix]


def geometry(h: Any) -> Geometry:
    """A_i = Z(alpha_i) (r_a, 0, -t), B_i = Z(beta_i) (r_b, 0, -(H + t)). Source: S1 eq. (13), Table 2.

    The printed B_z = -H would make the struts 5.077 mm long; with H as the vertical extent of a strut they have the
    printed 5.4 mm.
    """
    A = [
        ca.mtimes(rotation_z(angle), ca.vertcat(h.platform_radius, 0, -h.platform_thickness))
        for angle in h.platform_angles
    ]
    depth = -(h.height + h.platform_thickness)
    B = [ca.mtimes(rotation_z(angle), ca.vertcat(h.base_radius, 0, depth)) for angle in h.base_angles]
    centre = []
    for j in range(3):
        first, second = (B[i] for i in range(6) if STAGE_OF_STRUT[i] == j)
        centre.append((first + second) / 2)
    return Geometry(A, B, centre, [rotation_z(angle) for angle in h.stage_angles])


def strut_length(h: Any) -> Any:
    """L = |A_1 - B_1| [m]; printed 5.4 mm. Source: S1 Table 2."""
    g = geometry(h)
    return ca.norm_2(g.platform[0] - g.base[0])


def _strut_frame(g: Geometry, i: int) -> tuple[Matrix, Any]:
    """Rotation with x from B_i to A_i, and the distance between them."""
    span = g.platform[i] - g.base[i]
    length = ca.norm_2(span)
    return rotation_to(span / length), length


def strut_stiffness(length: Any, h: Any) -> Matrix:
    """[K^s]: wire, rod, wire in series about the platform end, x along the strut, shape (6, 6).

    Source: S1 section 5.2, with [C^w] of eq. (24). Both wires are part of `length` [m].
    """
    wire = wire_compliance(h.wire_length, h.wire_diameter, h.young, h.poisson)
    rod = wire_compliance(length - 2 * h.wire_length, h.rod_diameter, h.young, h.poisson)
    lower = move(wire, None, (h.wire_length - length, 0, 0))
    return inverse(series((lower, move(rod, None, (-h.wire_length, 0, 0)), wire)))


def _global_struts(g: Geometry, h: Any) -> list[Matrix]:
    """The six strut stiffnesses in the global frame."""
    members = []
    for i in range(6):
        R, length = _strut_frame(g, i)
        members.append(move(strut_stiffness(length, h), R, g.platform[i]))
    return members


def _pairs(struts: list[Matrix]) -> list[Matrix]:
    """Stiffness of the two struts on each stage, in parallel."""
    return [parallel(struts[i] for i in range(6) if STAGE_OF_STRUT[i] == j) for j in range(3)]


def _travel(g: Geometry, j: int) -> Matrix:
    """[M_j]: twist of stage j, at the global origin, per unit (d_jX, d_jY), shape (6, 2). Source: S1 eq. (15)."""
    return ca.vertcat(ca.DM.zeros(3, 2), g.rotation[j][:, :2])


def _global_stages(g: Geometry, C_XY: Matrix) -> list[Matrix]:
    """The three stage compliances [C_j^XY] in the global frame."""
    return [move(C_XY, g.rotation[j], g.centre[j]) for j in range(3)]


def kinematic_jacobian(h: Any) -> Matrix:
    """J of rigid struts and ideal ball joints, twist per stage displacement, shape (6, 6) [rad/m, 1].

    n_i . (delta + theta x A_i) = n_i . b_i for each strut; the limit of `jacobian` for short, soft wires
    on stiff stages.
    """
    g = geometry(h)
    rows_p, rows_d = [], []
    for i in range(6):
        n = _strut_frame(g, i)[0][:, 0]
        rows_p.append(ca.horzcat(ca.cross(g.platform[i], n).T, n.T))
        j = STAGE_OF_STRUT[i]
        stage = ca.mtimes(n.T, g.rotation[j][:, :2])
        rows_d.append(ca.horzcat(*(stage if k == j else ca.DM.zeros(1, 2) for k in range(3))))
    return ca.solve(ca.vertcat(*rows_p), ca.vertcat(*rows_d))


def loop_closure(pose: Matrix, d: Matrix, h: Any) -> Matrix:
    """(|a_i + delta - b_i|^2 - l^2) / 2l [m], shape (6, 1): zero where every strut keeps its length between the middles of its
    wires, as on ideal ball joints there.

    a_i = R(theta) A_i + delta and b_i = B_i + M_j d, each moved half a wire along the strut, `pose` (6,) the twist (theta,
    delta) and `d` (6,) [m] the stage displacements. Source: |A_i - B_i| = l, S1 section 3 with ideal joints.
    """
    g = geometry(h)
    turned = rotation_to_second_order(pose[:3])
    rows = []
    for i in range(6):
        R, length = _strut_frame(g, i)
        half, j = R[:, 0] * h.wire_length / 2, STAGE_OF_STRUT[i]
        upper = ca.mtimes(turned, g.platform[i] - half) + pose[3:]
        lower = g.base[i] + half + ca.mtimes(g.rotation[j][:, :2], d[2 * j : 2 * j + 2])
        between = length - h.wire_length
        rows.append((ca.sumsqr(upper - lower) - between**2) / (2 * between))
    return ca.vertcat(*rows)


def jacobian(h: Any, C_XY: Matrix) -> Matrix:
    """J = [C_j^T (C_j^Hex + C_j^XY)^-1 M_j], j = 1..3: twist of the platform per stage displacement, shape (6, 6).

    C_j^T is the platform's compliance on the other two blocks (strut pair in series with its
    stage), C_j^Hex = C_j^T + C_j^pair the compliance at stage j. All matrices are in the global frame, so that the
    adjoints of eq. (17) are already applied. Source: S1 eq. (14)-(18).
    """
    g = geometry(h)
    pair = [inverse(K) for K in _pairs(_global_struts(g, h))]
    stage = _global_stages(g, C_XY)
    block = [inverse(series((pair[j], stage[j]))) for j in range(3)]
    columns = []
    for j in range(3):
        C_T = inverse(parallel(block[k] for k in range(3) if k != j))
        wrench = solve(series((C_T, pair[j], stage[j])), _travel(g, j))  # eq. (16)
        columns.append(ca.mtimes(C_T, wrench))  # eq. (17)
    return ca.horzcat(*columns)


def mass(h: Any, m: Any, J: Matrix) -> Matrix:
    """(6, 6) [kg] of the stages' displacements d, T = 1/2 d'^T M d' at home, the platform moving by J d.

    Stages `stage_mass` along each axis; platform T = 1/2 m |delta' + theta' x c|^2 + 1/2 theta'^T I theta', its centre of mass c half its
    thickness below the origin; struts, slender rods that move in line between their ends, m/6 (|a'|^2 + a'.b' + |b'|^2). Flexures have no
    mass. Source: R. J. Guyan, AIAA J. 3 (1965) 380 (all bodies move as they do at rest).
    """
    g = geometry(h)
    turn, shift = J[:3, :], J[3:, :]
    centre = shift + ca.mtimes(ca.skew(ca.vertcat(0, 0, h.platform_thickness / 2)), turn)  # theta' x (0, 0, -t/2)
    M = m.stage_mass * ca.DM.eye(6)
    M += m.platform_mass * ca.mtimes(centre.T, centre)
    M += ca.mtimes([turn.T, ca.diag(ca.vertcat(*m.platform_inertia)), turn])
    for i, j in enumerate(STAGE_OF_STRUT):
        upper = shift - ca.mtimes(ca.skew(g.platform[i]), turn)
        lower = ca.horzcat(*(g.rotation[j][:, :2] if k == j else ca.DM.zeros(3, 2) for k in range(3)))
        both = ca.mtimes(upper.T, lower)
        ends = ca.mtimes(upper.T, upper) + (both + both.T) / 2 + ca.mtimes(lower.T, lower)
        M += m.strut_mass / 3 * ends
    return M


def platform_compliance(h: Any, C_XY: Matrix) -> Matrix:
    """Twist of the platform at the origin per wrench there, the stages' displacements held, shape (6, 6): the three strut pairs, each in
    series with its stage, in parallel. Source: S1 section 3.2, eq. (14)."""
    g = geometry(h)
    pairs, stages = _pairs(_global_struts(g, h)), _global_stages(g, C_XY)
    return inverse(parallel(inverse(series((inverse(K), C))) for K, C in zip(pairs, stages, strict=True)))


def stage_loads(h: Any, C_XY: Matrix, motion: Matrix) -> Matrix:
    """Force of the struts against each actuated axis per input [N/m], shape (6, m), of which the first six are the stages'
    displacements; `motion` (6, m) is the platform's twist per input, J of `jacobian` or J with columns of loads.

    In-plane components of W_j of `wire_loads`; they deflect the stage by C_j^XY W_j. Source: S1 eq. (16).
    """
    g = geometry(h)
    pair, stage = [inverse(K) for K in _pairs(_global_struts(g, h))], _global_stages(g, C_XY)
    rows = []
    for j in range(3):
        travel = ca.horzcat(
            *(_travel(g, j) if k == j else ca.DM.zeros(6, 2) for k in range(3)), ca.DM(6, motion.shape[1] - 6)
        )
        W = solve(series((pair[j], stage[j])), travel - motion)
        rows.append(ca.mtimes(g.rotation[j][:, :2].T, W[:3, :]))
    return ca.vertcat(*rows)


@dataclass(frozen=True)
class WireLoads:
    """Section loads of the wires per unit of stage displacement.

    `tension` (6, 6) [N/m] and `torque` (6, 6) [N m/m] are constant along a strut, one row per strut.
    `bending_y`, `bending_z` (24, 6) [N m/m] at both ends of all twelve wires; row order: strut 1
    base wire (lower end, upper end), strut 1 platform wire (lower, upper), strut 2 ...
    """

    tension: Matrix
    torque: Matrix
    bending_y: Matrix
    bending_z: Matrix


def wire_loads(h: Any, C_XY: Matrix, motion: Matrix) -> WireLoads:
    """Loads of the wires in the linear model of `jacobian`, per input; `motion` (6, m) as in `stage_loads`.

    Stage j carries W_j = (C_j^XY + C_j^pair)^-1 (M_j d_j - T^p), moves by T_j = M_j d_j - C_j^XY W_j, and
    strut i on it carries K_i^s (T_j - T^p). Source: S1 eq. (14)-(16), solved for the wrench.
    """
    g = geometry(h)
    struts = _global_struts(g, h)
    pair = [inverse(K) for K in _pairs(struts)]
    stage = _global_stages(g, C_XY)
    relative = []
    for j in range(3):
        travel = ca.horzcat(
            *(_travel(g, j) if k == j else ca.DM.zeros(6, 2) for k in range(3)), ca.DM(6, motion.shape[1] - 6)
        )
        W = solve(series((pair[j], stage[j])), travel - motion)
        relative.append(ca.mtimes(pair[j], W))  # T_j - T^p; the difference itself cancels six digits
    sections: list[list[Matrix]] = []
    for i in range(6):
        R, length = _strut_frame(g, i)
        W = -ca.mtimes(struts[i], relative[STAGE_OF_STRUT[i]])
        ends = (0, h.wire_length, length - h.wire_length, length)
        sections.append([ca.mtimes(inverse_adjoint(R, g.base[i] + R[:, 0] * along), W) for along in ends])
    return WireLoads(
        tension=ca.vertcat(*(strut[0][0, :] for strut in sections)),
        torque=ca.vertcat(*(strut[0][3, :] for strut in sections)),
        bending_y=ca.vertcat(*(section[4, :] for strut in sections for section in strut)),
        bending_z=ca.vertcat(*(section[5, :] for strut in sections for section in strut)),
    )


def wire_stress(d: Matrix, loads: WireLoads, h: Any) -> Matrix:
    """Von Mises stress sqrt((32 M/(pi d^3) + |N|/A)^2 + 3 (16 T/(pi d^3))^2) at 24 wire sections [Pa].

    M = |(M_y, M_z)|, N the tension, T the torque; `d`: (6,) [m]. (1e-9 of the allowed stress)^2 is added under
    the root of the bending stress, so that its derivative exists at home; the stress is overestimated by that.
    """
    area, bending, torsion = round_section(h.wire_diameter)
    strut = [i // 4 for i in range(24)]
    return round_stress(
        ca.mtimes(loads.bending_y / bending, d),
        ca.mtimes(loads.bending_z / bending, d),
        ca.mtimes(loads.tension / area, d)[strut],
        ca.mtimes(loads.torque / torsion, d)[strut],
        1e-9 * h.stress_limit,
    )

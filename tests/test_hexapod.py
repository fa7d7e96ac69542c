"""The hexapod of S1: its Jacobians, reach and wire stress against PHYSICS.md and a direct-stiffness frame."""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi, sin
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from direct_stiffness import Frame, assemble, section_loads
from matrices import array, numbers, replaced

from ctrlgen.physics import hexapod, screw, thermal_actuator, xy_stage

MICRO = 1e-6

# PHYSICS.md, rad/mm and mm/mm
KINEMATIC_J = """
    -0.094587 -0.054610  0.000000  0.109219  0.094587 -0.054610
    -0.054610  0.094587  0.109219  0.000000 -0.054610 -0.094587
     0.058795 -0.033946  0.058795 -0.033946  0.058795 -0.033946
     0.207749  0.217518  0.084501  0.288675 -0.292251 -0.506193
     0.217518  0.458917 -0.288675 -0.417835  0.071157 -0.041083
     0.134062  0.232202  0.134062  0.232202  0.134062  0.232202
"""

# S1 Table 3, T_A: rad and um
TABLE_3 = (
    (0, 0, 0, 0, 0, 30),
    (0, 0, 0, -10, 0, 30),
    (0, 0, 0, 0, -10, 30),
    (-4e-3, 0, 0, 0, 0, 30),
    (0, -4e-3, 0, 0, 0, 30),
    (0, 0, -4e-3, 0, 0, 30),
)


def block_error(J: np.ndarray, reference: np.ndarray) -> float:
    """Largest difference, rotation and translation rows each relative to their largest entry."""
    error, size = (np.abs(M).reshape(2, -1).max(1) for M in (J - reference, reference))
    return float((error / size).max())


@pytest.fixture(scope="module")
def C_XY(p: SimpleNamespace) -> np.ndarray:
    return array(xy_stage.stage_compliance(p.stage, p.actuator))


@pytest.fixture(scope="module")
def frame(p: SimpleNamespace, C_XY: np.ndarray) -> Frame:
    return assemble(p.hexapod, C_XY)


@pytest.fixture(scope="module")
def loads(p: SimpleNamespace, C_XY: np.ndarray) -> hexapod.WireLoads:
    return hexapod.wire_loads(p.hexapod, C_XY, hexapod.jacobian(p.hexapod, ca.DM(C_XY)))


# Hexapod


def test_the_struts_have_the_printed_length_when_height_is_their_rise(p: SimpleNamespace) -> None:
    length = float(hexapod.strut_length(p.hexapod)) * 1e3
    assert abs(length - 5.399) <= 5e-4  # half a unit of the last digit in PHYSICS.md
    assert abs(length - 5.4) <= 0.05  # half a unit of the last printed digit
    literal = replaced(p.hexapod, height=p.hexapod.height - p.hexapod.platform_thickness)
    assert abs(float(hexapod.strut_length(literal)) * 1e3 - 5.077) <= 5e-4  # eq. (13) read literally


def test_the_strut_ends_have_the_printed_distances(p: SimpleNamespace) -> None:
    g = hexapod.geometry(p.hexapod)
    A, B = (np.hstack([array(point) for point in points]) * 1e3 for points in (g.platform, g.base))
    on_one_stage, neighbours = ((0, 5), (1, 2), (3, 4)), ((0, 1), (2, 3), (4, 5))
    for points, pairs, printed in (
        (B, on_one_stage, 0.4),
        (B, neighbours, 7.2),
        (A, neighbours, 0.4),
        (A, on_one_stage, 2.5),
    ):
        for i, k in pairs:
            assert abs(np.linalg.norm(points[:, i] - points[:, k]) - printed) <= 0.05  # S1 Table 2, half a unit
    assert hexapod.STAGE_OF_STRUT == (0, 1, 1, 2, 2, 0)


def test_kinematic_jacobian_reproduces_the_table(p: SimpleNamespace) -> None:
    J = array(hexapod.kinematic_jacobian(p.hexapod)) * np.repeat([1e-3, 1], 3)[:, None]  # rad/mm, mm/mm
    assert (np.abs(J - numbers(KINEMATIC_J)) <= 0.5e-6 + 1e-12).all()  # half a unit of the sixth decimal: 5e-6 relative


def test_a_pure_lift_of_20_um_takes_the_known_displacements_and_forces(p: SimpleNamespace) -> None:
    J = array(hexapod.kinematic_jacobian(p.hexapod))
    d = np.linalg.solve(J, [0, 0, 0, 0, 0, 20 * MICRO])
    assert np.abs(d.reshape(3, 2) / MICRO - (12.4321, 21.5330)).max() <= 5e-5  # half a unit in PHYSICS.md
    F = array(xy_stage.force(ca.DM(d), p.stage, p.actuator)).reshape(3, 2)
    assert np.abs(F - (0.024556, 0.045965)).max() <= 1e-6  # one unit: the exact 0.04596551 is cut, not rounded, there


def test_the_circle_spans_the_known_displacements(p: SimpleNamespace) -> None:
    inverse = np.linalg.inv(array(hexapod.kinematic_jacobian(p.hexapod)))
    centre, swing = inverse[:, 5] * 20, np.hypot(inverse[:, 3], inverse[:, 4]) * 10
    low, high = (centre - swing).reshape(3, 2), (centre + swing).reshape(3, 2)
    assert np.abs(low - (2.432, 11.533)).max() <= 5e-4  # half a unit in PHYSICS.md
    assert np.abs(high - (22.432, 31.533)).max() <= 5e-4  # half a unit in PHYSICS.md


@pytest.mark.parametrize("pose", TABLE_3, ids=str)
def test_every_pose_of_table_3_is_within_reach_and_strength(
    p: SimpleNamespace, C_XY: np.ndarray, loads: hexapod.WireLoads, pose: tuple[float, ...]
) -> None:
    twist = np.array(pose) * np.repeat([1, MICRO], 3)
    hottest = thermal_actuator.force(p.actuator.temperature_limit, p.actuator)
    for J in (hexapod.kinematic_jacobian(p.hexapod), hexapod.jacobian(p.hexapod, ca.DM(C_XY))):
        d = np.linalg.solve(array(J), twist)
        assert (d >= 0).all() and (d <= p.stage.stroke).all()
        assert (array(xy_stage.force(ca.DM(d), p.stage, p.actuator)) <= hottest).all()
    # The paper's FE model carried these poses; a tilt about y uses 546 of the 550 MPa.
    assert (array(hexapod.wire_stress(ca.DM(d), loads, p.hexapod)) <= p.hexapod.stress_limit).all()


def random_spring(seed: int, like: np.ndarray) -> np.ndarray:
    """A reciprocal, positive, fully coupled compliance with the diagonal of `like`."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(6, 9))
    work = A @ A.T
    size = np.sqrt(np.diag(np.hstack([like[:, 3:], like[:, :3]])) / np.diag(work))
    work *= np.outer(size, size)
    return np.hstack([work[:, 3:], work[:, :3]])


@pytest.mark.parametrize(
    ("changes", "seed"),
    [({}, None), ({}, 1), ({"wire_diameter": 40e-6, "wire_length": 2e-4, "stage_angles": (0.3, -1.0, 2.5)}, 2)],
    ids=["printed", "any stage", "thick wires, any stage, any angles"],
)
def test_jacobian_equals_the_direct_stiffness_frame(
    p: SimpleNamespace, C_XY: np.ndarray, changes: dict[str, Any], seed: int | None
) -> None:
    h = replaced(p.hexapod, **changes)
    C = C_XY if seed is None else random_spring(seed, C_XY)
    error = block_error(array(hexapod.jacobian(h, ca.DM(C))), assemble(h, C).jacobian)
    assert error < 1e-9  # one linear model solved twice; float64 x condition 1e6 in scaled lengths


def test_moving_all_stages_alike_carries_the_platform_along(p: SimpleNamespace, C_XY: np.ndarray, frame: Frame) -> None:
    angles = p.hexapod.stage_angles
    for direction in (0.0, 1.0):
        d = np.concatenate([(cos(direction - angle), sin(direction - angle)) for angle in angles])
        expected = [0, 0, 0, cos(direction), sin(direction), 0]
        for J in (frame.jacobian, hexapod.kinematic_jacobian(p.hexapod), hexapod.jacobian(p.hexapod, ca.DM(C_XY))):
            # A rigid motion is exact. 1e-9 of the largest entries (109 rad/m, 0.5).
            assert (np.abs(array(J) @ d - expected) < np.repeat([109e-9, 0.5e-9], 3)).all()
        assert np.abs(section_loads(frame, d).tension).max() < 1e-9 * np.abs(frame.tension).max()  # nothing is strained


def test_the_platform_answers_alike_to_each_of_the_three_stages(
    p: SimpleNamespace, C_XY: np.ndarray, frame: Frame
) -> None:
    turn = array(screw.adjoint(screw.rotation_z(2 * pi / 3)))
    following = [4, 5, 0, 1, 2, 3]  # a turn by 120 degrees brings stage 1 to stage 3, 2 to 1, 3 to 2
    for J in (frame.jacobian, array(hexapod.jacobian(p.hexapod, ca.DM(C_XY)))):
        assert block_error(turn @ J, J[:, following]) < 1e-9  # exact symmetry; rounding as against the frame


def section_rows(matrix: Any) -> np.ndarray:
    """One row per wire end, also for loads stored once per strut."""
    rows = array(matrix)
    return np.repeat(rows, 24 // len(rows), axis=0)


def frame_bending(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Bending moments of the frame about the section axes of `screw.rotation_to`."""
    R = np.array([array(screw.rotation_to(ca.DM(axis))) for axis in frame.axis])
    return np.einsum("sac,sc->sa", frame.moment, R[:, :, 1]), np.einsum("sac,sc->sa", frame.moment, R[:, :, 2])


@pytest.mark.parametrize("kind", ["tension", "torque", "bending"])
def test_wire_loads_equal_the_direct_stiffness_frame(frame: Frame, loads: hexapod.WireLoads, kind: str) -> None:
    if kind == "bending":
        ours = np.hstack([section_rows(loads.bending_y), section_rows(loads.bending_z)])
        theirs = np.hstack(frame_bending(frame))
    else:
        ours, theirs = section_rows(getattr(loads, kind)), getattr(frame, kind)
    side = np.sign(np.sum(ours * theirs))  # which side of the cut a load is read on is a convention
    error = float(np.abs(side * ours - theirs).max() / np.abs(theirs).max())
    # A strut lengthens by 1e-5 of its ends' motion, so its tension loses five of the Jacobian's twelve digits.
    assert error < 1e-7


def test_tension_is_positive_where_a_wire_is_stretched(frame: Frame, loads: hexapod.WireLoads) -> None:
    largest = np.unravel_index(np.abs(frame.tension).argmax(), frame.tension.shape)
    assert section_rows(loads.tension)[largest] * frame.tension[largest] > 0


def test_the_jacobian_tends_to_rigid_struts_on_ball_joints(p: SimpleNamespace, C_XY: np.ndarray) -> None:
    h = p.hexapod
    limit = array(hexapod.kinematic_jacobian(h))
    distances = []
    for scale in (1.0, 0.6, 0.4, 0.25):
        wires = replaced(h, wire_diameter=h.wire_diameter * scale, wire_length=h.wire_length * scale)
        distances.append(block_error(array(hexapod.jacobian(wires, ca.DM(C_XY * scale**2))), limit))
    assert 0.005 < distances[0] < 0.05  # PHYSICS.md: about one percent for the printed dimensions
    assert all(later < earlier for earlier, later in pairwise(distances))
    assert distances[-1] < 1e-4  # bending falls as d^4/l = scale^3, the stages' part as scale^5: 2.5e-2 x 0.25^5


# Wire stress


def stress_function(p: SimpleNamespace, loads: hexapod.WireLoads) -> ca.Function:
    d = ca.SX.sym("d", 6)
    return ca.Function("stress", [d], [hexapod.wire_stress(d, loads, p.hexapod)])


def test_wire_stress_is_von_mises_of_the_frame_loads(
    p: SimpleNamespace, frame: Frame, loads: hexapod.WireLoads
) -> None:
    d = np.array([12.4, 21.5, 30.0, 5.0, 0.0, 40.0]) * MICRO
    cut, r = section_loads(frame, d), p.hexapod.wire_diameter / 2
    bending = np.linalg.norm(cut.bending, axis=1) * 4 / (pi * r**3)  # M r/I
    axial = np.abs(cut.tension) / (pi * r**2)
    shear = cut.torque * 2 / (pi * r**3)  # T r/2I
    expected = np.sqrt((bending + axial) ** 2 + 3 * shear**2)
    ours = array(stress_function(p, loads)(d)).ravel()
    assert ours.shape == (24,) and expected.max() > 0.01 * p.hexapod.stress_limit
    # The two floors, 1e-6 of the allowed stress each, and 1e-6 for the axial part's rounding.
    assert np.abs(ours - expected).max() < 3e-6 * p.hexapod.stress_limit


def test_wire_stress_is_convex_in_the_displacement(p: SimpleNamespace, loads: hexapod.WireLoads) -> None:
    rng, n = np.random.default_rng(3), 400
    a, b = rng.uniform(-55 * MICRO, 55 * MICRO, (2, 6, n))
    b = a + (b - a) * 10.0 ** rng.uniform(-6, 0, n)  # long and short segments
    a[:, -20:] = -b[:, -20:] * rng.uniform(0, 1, 20)  # through home
    w = rng.uniform(0, 1, n)
    stress = stress_function(p, loads).map(n)
    left, right, middle = (array(stress(x)) for x in (a, b, w * a + (1 - w) * b))
    assert (middle <= w * left + (1 - w) * right + 1e-13 * p.hexapod.stress_limit).all()  # rounding of the stress


def test_the_wires_ends_inside_a_strut_are_never_stressed_more_than_both_outer_ones(
    p: SimpleNamespace, loads: hexapod.WireLoads
) -> None:
    """So the device's limit is on the outer ends alone."""
    d = np.random.default_rng(5).uniform(-55 * MICRO, 55 * MICRO, (6, 2000))
    stress = array(stress_function(p, loads).map(2000)(d)).reshape(6, 4, 2000)
    assert (stress[:, 1:3].max(axis=1) <= stress[:, [0, 3]].max(axis=1) * (1 + 1e-12)).all()


def test_wire_stress_grows_in_proportion_to_the_displacement(p: SimpleNamespace, loads: hexapod.WireLoads) -> None:
    rng, n = np.random.default_rng(4), 200
    d, t = rng.uniform(-55 * MICRO, 55 * MICRO, (6, n)), 10.0 ** rng.uniform(-6, 0, n)
    stress = stress_function(p, loads).map(n)
    excess = (array(stress(t * d)) - t * array(stress(d))) / p.hexapod.stress_limit
    assert excess.min() > -1e-13  # the floor errs on the safe side; rounding
    assert excess.max() <= 2e-6 * (1 + 1e-9)  # both floors, bending and axial, stand alone at home

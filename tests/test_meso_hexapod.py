"""S0: the constraint, its Jacobians and the exact pose."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from conftest import MESO_FILE
from exact_struts import actuators_from_pose, pose_from_actuators
from scipy.spatial.transform import Rotation

from ctrlgen import build_model, simulate
from ctrlgen.devices import load_device
from ctrlgen.devices.meso_hexapod import matrices
from ctrlgen.numerics.constraint_second_order import second_order
from ctrlgen.physics import meso_hexapod_kinematics as meso_hexapod
from ctrlgen.physics import screw
from papers import s0

DEG, UM = np.pi / 180, 1e-6


@pytest.fixture(scope="module")
def device():
    return load_device(MESO_FILE)


@pytest.fixture(scope="module")
def rows():
    return s0.rows()


def some_hexapod(rng) -> tuple[SimpleNamespace, np.ndarray]:
    """A hexapod of the same build with other lengths, angles and actuator directions."""

    def spread(centre):
        return tuple(np.radians(centre) + rng.uniform(-0.05, 0.05, 6))

    return SimpleNamespace(
        platform_radius=rng.uniform(0.05, 0.1),
        base_radius=rng.uniform(0.12, 0.2),
        platform_thickness=rng.uniform(0.01, 0.02),
        height=rng.uniform(0.15, 0.3),
        platform_angles=spread([189, 171, 69, 51, -51, -69]),
        base_angles=spread([236, 124, 116, 4, -4, -116]),
    ), np.radians([0, 0, 90, 0, 90, 90]) + np.repeat(rng.uniform(-3, 3, 3), 2)[[0, 2, 3, 4, 5, 1]]


def differentiated(h, directions) -> tuple[np.ndarray, np.ndarray]:
    """Half the derivatives of eq. (2) by pose and, negative, by input, at home: what eq. (7) and (9) write out."""
    pose, u = ca.SX.sym("pose", 6), ca.SX.sym("u", 6)
    f = meso_hexapod.constraint(pose, u, h, directions, meso_hexapod.home_lengths(h))
    both = ca.Function("both", [pose, u], [ca.jacobian(f, pose) / 2, -ca.jacobian(f, u) / 2, f])
    left, right, value = (m.full() for m in both(np.zeros(6), np.zeros(6)))
    assert np.abs(value).max() < 1e-16  # home keeps every strut's length; rounding of 0.06 m^2
    return left, right


# Geometry, constraint, Jacobians


def test_the_device_file_carries_table_1_and_both_equations_as_printed(p) -> None:
    h = p.hexapod
    lengths = (
        h.platform_radius,
        h.base_radius,
        h.platform_thickness,
        h.height,
        h.strut_length,
        h.base_near,
        h.base_far,
        h.platform_near,
        h.platform_far,
    )
    assert np.allclose(np.array(lengths) * 1e3, (81.44, 138.92, 13.2, 221.93, 240, 20, 230, 20, 100), rtol=1e-15)
    assert np.allclose(np.degrees(h.platform_angles), (189, 171, 69, 51, -51, -69), rtol=1e-15)
    assert np.allclose(np.degrees(h.base_angles), (236, 124, 116, 4, -4, -116), rtol=1e-15)
    assert np.allclose(np.degrees(p.directions.constraint), (0, 0, 90, 0, 90, 90), rtol=1e-15)
    assert np.allclose(np.degrees(p.directions.jacobian), (0, 0, 90, 90, 0, 90), rtol=1e-15)
    assert p.cube.depth == pytest.approx(31.57e-3, rel=1e-15)


def test_every_number_of_the_device_has_a_source(device) -> None:
    assert [path for path, q in device.quantities() if q.source is None] == []


@pytest.mark.parametrize("seed", [None, 1, 2], ids=["printed", "another", "yet another"])
def test_both_jacobians_are_the_derivatives_of_the_constraint(p, seed) -> None:
    h, directions = (p.hexapod, p.directions.constraint)
    if seed is not None:
        h, directions = some_hexapod(np.random.default_rng(seed))
    left, right = differentiated(h, directions)
    for ours, by_rule in (
        (meso_hexapod.jacobian_left(h), left),
        (meso_hexapod.jacobian_right(h, directions), right),
        (meso_hexapod.kinematic_jacobian(h, directions), np.linalg.solve(left, right)),
    ):
        assert np.abs(ca.DM(ours).full() - by_rule).max() < 1e-12 * np.abs(by_rule).max()  # the bound


def test_the_right_jacobian_is_equation_9_as_printed(p) -> None:
    A, B = (ca.DM(points).full() for points in meso_hexapod.geometry(p.hexapod))
    x, y, _ = A - B
    printed = [
        [x[0], 0, 0, 0, 0, y[0]],
        [0, x[1], y[1], 0, 0, 0],
        [0, x[2], y[2], 0, 0, 0],
        [0, 0, 0, y[3], x[3], 0],
        [0, 0, 0, y[4], x[4], 0],
        [x[5], 0, 0, 0, 0, y[5]],
    ]
    ours = ca.DM(meso_hexapod.jacobian_right(p.hexapod, p.directions.jacobian)).full()
    assert np.abs(ours - printed).max() < 1e-16  # cos 90 deg is 6e-17 in float64


def test_equation_9_contradicts_equation_4_at_stage_3_alone(p) -> None:
    _, right = differentiated(p.hexapod, p.directions.constraint)
    printed = ca.DM(meso_hexapod.jacobian_right(p.hexapod, p.directions.jacobian)).full()
    assert np.flatnonzero((np.abs(printed - right) > 1e-3).any(0)).tolist() == [3, 4]  # 1 mm, of up to 100


def test_strut_ends_stand_where_equation_1_puts_them(p) -> None:
    A, B = (ca.DM(points).full() for points in meso_hexapod.geometry(p.hexapod))
    a, b = np.radians(51), np.radians(4)  # strut 4
    assert np.allclose(A[:, 3], (0.08144 * np.cos(a), 0.08144 * np.sin(a), -0.0066), rtol=1e-14)
    assert np.allclose(B[:, 3], (0.13892 * np.cos(b), 0.13892 * np.sin(b), -0.22193), rtol=1e-14)
    assert np.allclose(ca.DM(meso_hexapod.home_lengths(p.hexapod)).full(), 0.23846693, atol=5e-9)  # not the printed 240


def test_a_rotation_vector_turns_like_scipys_and_differentiates_at_zero(rng) -> None:
    for size in (1e-9, 1e-3, 1.0, 3.0):
        theta = rng.normal(size=3) * size
        ours = ca.DM(screw.rotation_vector(ca.DM(theta))).full()
        assert np.abs(ours - Rotation.from_rotvec(theta).as_matrix()).max() < 1e-15 * 8  # rounding of two products
    theta = ca.SX.sym("theta", 3)
    turned = ca.mtimes(screw.rotation_vector(theta), ca.DM([1, 2, 3]))
    slope = ca.Function("slope", [theta], [ca.jacobian(turned, theta)])(0).full()
    assert np.array_equal(slope, -ca.DM(ca.skew(ca.DM([1, 2, 3]))).full())


# The exact constraint


def workspace(p, rng, n: int) -> np.ndarray:
    sides = np.repeat([p.workspace.rotation, p.workspace.translation], 3)
    return rng.uniform(-1, 1, (n, 6)) * sides


def test_pose_and_actuators_return_to_each_other_over_the_workspace(p, rng) -> None:
    T = workspace(p, rng, 40)
    U = actuators_from_pose(T, p.hexapod, p.directions.constraint)
    again = pose_from_actuators(U, p.hexapod, p.directions.constraint)
    # 1e-15 m of strut length through a condition of some tens, and 1/0.08 m for angles.
    assert np.abs(again - T).max() < 1e-13


def test_every_strut_keeps_its_length_at_the_solved_pose(p, rng) -> None:
    h = p.hexapod
    U = rng.uniform(-5e-3, 5e-3, (10, 6))
    A, B = (ca.DM(points).full() for points in meso_hexapod.geometry(h))
    home = np.linalg.norm(A - B, axis=0)
    stage = {0: (0, 5), 1: (1, 2), 2: (3, 4)}  # U = (1x, 2x, 2y, 3x, 3y, 1y)
    for u, T in zip(U, pose_from_actuators(U, h, p.directions.constraint), strict=True):
        moved = Rotation.from_rotvec(T[:3]).as_matrix() @ A + T[3:, None]
        feet = B.copy()
        for strut, j in enumerate((0, 1, 1, 2, 2, 0)):
            feet[:2, strut] += u[list(stage[j])]
        assert np.abs(np.linalg.norm(moved - feet, axis=0) - home).max() < 2e-15  # Newton's bound, and rounding


def test_the_kinematic_jacobian_errs_by_the_square_of_the_displacement(p, rng) -> None:
    J = ca.DM(meso_hexapod.kinematic_jacobian(p.hexapod, p.directions.constraint)).full()
    U = rng.uniform(-1, 1, (5, 6))
    errors = [
        np.abs(pose_from_actuators(s * U, p.hexapod, p.directions.constraint) - s * U @ J.T).max()
        for s in (4e-4, 2e-4, 1e-4)
    ]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.02)  # the next order is 1e-3 of it
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.02)


def test_moving_all_stages_alike_carries_the_platform_along(p) -> None:
    U = np.array([[3, 3, -5, 3, -5, -5]]) * 1e-4
    pose = pose_from_actuators(U, p.hexapod, p.directions.constraint)[0]
    assert np.abs(pose - [0, 0, 0, 3e-4, -5e-4, 0]).max() < 1e-14  # Newton's bound


def test_other_strut_lengths_raise_the_platform_straight(p) -> None:
    pose = pose_from_actuators(
        np.zeros((1, 6)), p.hexapod, p.directions.constraint, ca.DM([p.hexapod.strut_length] * 6)
    )[0]
    run = 0.08144**2 + 0.13892**2 - 2 * 0.08144 * 0.13892 * np.cos(np.radians(47))
    lift = np.sqrt(0.24**2 - run) - (0.22193 - 0.0066)
    assert np.abs(pose - [0, 0, 0, 0, 0, lift]).max() < 1e-13  # with the printed L, home stands 1.7 mm higher


def test_inputs_that_tear_the_struts_are_refused(p) -> None:
    with pytest.raises(ValueError, match="no pose within 20 Newton steps"):
        pose_from_actuators(np.array([[1.0, 0, 0, 0.5, 0, 0]]), p.hexapod, p.directions.constraint)


# Cube and platform


def test_the_adjoint_is_the_printed_matrix(p) -> None:
    h = 31.57e-3
    printed = np.eye(6)
    printed[3, 1], printed[4, 0] = h, -h
    assert np.array_equal(ca.DM(meso_hexapod.cube_to_platform(p.cube.depth)).full(), printed)


def test_the_adjoint_carries_the_motion_of_a_rigid_body(p) -> None:
    theta, shift = np.array([2e-7, -3e-7, 1e-7]), np.array([1e-6, 2e-6, 3e-6])
    cube = np.array([0, 0, -p.cube.depth])
    moved = Rotation.from_rotvec(theta).as_matrix() @ cube + shift - cube
    platform = ca.DM(meso_hexapod.cube_to_platform(p.cube.depth)).full() @ np.concatenate([theta, moved])
    assert np.abs(platform - np.concatenate([theta, shift])).max() < 1e-14  # second order: 0.03 m x (4e-7)^2


def test_the_named_matrices_are_those_of_the_device(device, p) -> None:
    named = matrices(device)
    assert set(named) == {"J_l", "J_r", "J_k", "Ad"}
    assert np.allclose(named["J_l"] @ named["J_k"], named["J_r"], rtol=0, atol=1e-15)  # rounding of 0.2 m


def test_the_model_is_the_kinematic_jacobian_without_state_or_force(device, rng) -> None:
    model = build_model(device)
    assert model.n_states == 0 and "state" not in model.signals
    travel = rng.uniform(-2e-4, 2e-4, 6)
    pose = simulate(model, np.tile(travel, (2, 1)), 1e-2).signals["pose"][-1]
    assert np.allclose(pose, matrices(device)["J_k"] @ travel, rtol=1e-12, atol=0)


def test_the_model_follows_its_whole_travel(device, rng) -> None:
    model = build_model(device)
    travels = rng.uniform(*model.u_bounds, (500, 6))
    assert np.allclose(simulate(model, travels, 1e-2).z[:-1][1:], travels[:-1], rtol=1e-12, atol=0)


def test_what_the_linear_kinematics_leave_is_the_second_order_of_the_loop_closure():
    """Against the constraint solved exactly, with its exact rotation: of half a millimetre, 3 % are the third order, (d/L)^2 of the
    motion over its second."""
    p = load_device(MESO_FILE).values()
    directions = p.directions.jacobian
    J = ca.DM(meso_hexapod.kinematic_jacobian(p.hexapod, directions)).full()
    for d in 5e-4 * np.random.default_rng(2).uniform(-1, 1, (5, 6)):
        left = pose_from_actuators(d[None, :], p.hexapod, directions)[0] - J @ d
        found = second_order(lambda pose, u: meso_hexapod.loop_closure(pose, u, p.hexapod, directions), ca.DM(d))
        expected = ca.DM(found).full().ravel()
        for part in (slice(0, 3), slice(3, 6)):
            assert np.abs(left[part] - expected[part]).max() < 0.03 * np.abs(expected[part]).max()
            assert np.abs(expected[part]).max() > 1e-4 * np.abs((J @ d)[part]).max()

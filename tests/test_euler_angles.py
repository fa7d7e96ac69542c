"""Euler angles of a stated order beside rotation vectors: as in closed form, there and back, refused where two of them are one."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen import InputError, solve
from ctrlgen.physics.euler_angles import ORDERS, angles_of, rotation_vector_of
from ctrlgen.trajectory.frame import Frame, read_poses
from ctrlgen.trajectory.scenario import load_scenario, model_of

CHANNELS = ("theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z")
UNITS = ("urad",) * 3 + ("um",) * 3


def about(axis: str, angle: float) -> np.ndarray:
    """The rotation about one of the axes."""
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    R = np.eye(3)
    R[[i, i, j, j], [i, j, i, j]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    return R


def rotation(theta: np.ndarray) -> np.ndarray:
    """R = I + sin a S + (1 - cos a) S^2 (Rodrigues)."""
    a = np.linalg.norm(theta)
    S = np.column_stack([np.cross(theta / a, e) for e in np.eye(3)])
    return np.eye(3) + np.sin(a) * S + (1 - np.cos(a)) * S @ S


def test_every_order_is_the_product_of_its_three_turns_and_comes_back():
    rng = np.random.default_rng(1)
    for order in ORDERS:
        for angles in rng.uniform(-1.5, 1.5, (20, 3)):
            first, second, third = (about(axis, a) for axis, a in zip(order[:3], angles, strict=True))
            product = first @ second @ third if order.endswith("intrinsic") else third @ second @ first
            theta = rotation_vector_of(angles, order)
            assert np.allclose(rotation(theta), product, atol=1e-12)
            # near the singular angle of 90 deg, here 86, roundings grow by its inverse cosine
            assert np.allclose(angles_of(theta, order), angles, atol=1e-12)


def test_where_two_angles_are_one_they_are_refused():
    for order in ORDERS:
        with pytest.raises(ValueError, match=f"middle angle of '{order}', about {order[1]}, is at 90 deg"):
            angles_of(rotation_vector_of(np.array([0.3, np.pi / 2, -0.2]), order), order)


def test_a_pose_is_read_in_the_order_that_the_scenario_states(tmp_path):
    """0.1 about z, then 0.2 about the turned x: as (theta_z, theta_x) of "zxy intrinsic"; theta_y is the third."""
    frame = Frame(CHANNELS, UNITS, "zxy intrinsic")
    pose = frame.point({"theta_x": "0.2 rad", "theta_z": "0.1 rad", "delta_y": "5 um"}, "start")
    assert np.allclose(rotation(pose[:3]), about("z", 0.1) @ about("x", 0.2), atol=1e-14)
    assert np.allclose(pose[3:], [0, 5e-6, 0])
    (tmp_path / "poses.csv").write_text("theta_z [rad],theta_x [rad],delta_y [um]\n0.1,0.2,5\n0,0,1\n")
    assert np.allclose(read_poses(tmp_path / "poses.csv", frame)[0], pose)
    with pytest.raises(InputError, match="theta_z is no channel"):
        Frame(CHANNELS[:2], UNITS[:2], "xyz intrinsic").point({"theta_x": "1 urad"}, "start")


def test_a_scenario_states_the_order(tmp_path):
    device = SCENARIOS / "devices/meso_hexapod.toml"
    text = (
        f'title = "t"\ndevice = "{device}"\nangles = "yzx extrinsic"\n[path]\nkind = "poses"\n'
        'points = [{ theta_x = "0.1 deg", theta_y = "-0.2 deg", theta_z = "0.15 deg" }, { delta_z = "10 um" }]\n'
    )
    (tmp_path / "scenario.toml").write_text(text)
    scenario = load_scenario(tmp_path)
    samples = scenario.bind(model_of(scenario)).samples
    x, y, z = np.deg2rad([0.1, -0.2, 0.15])
    assert np.allclose(rotation(samples[0, :3]), about("x", x) @ about("z", z) @ about("y", y), atol=1e-15)
    (tmp_path / "scenario.toml").write_text(text.replace("yzx", "xyx"))
    with pytest.raises(InputError, match="angles: 'xyx extrinsic' must be"):
        load_scenario(tmp_path)


def test_a_solution_tells_the_angles_that_were_asked_for(tmp_path):
    device = SCENARIOS / "devices/meso_hexapod.toml"
    (tmp_path / "scenario.toml").write_text(
        f'title = "t"\ndevice = "{device}"\nangles = "yzx extrinsic"\n[path]\nkind = "poses"\n'
        'points = [{ theta_x = "0.1 deg", theta_y = "-0.2 deg", theta_z = "0.15 deg" }, { delta_z = "10 um" }]\n'
    )
    scenario = load_scenario(tmp_path)
    told = solve(scenario, model_of(scenario)).angle_columns
    assert [column.name for column in told] == ["angle.y", "angle.z", "angle.x"]
    expected = np.deg2rad([-0.2, 0.15, 0.1]) * 1e6  # urad
    assert np.allclose([column.values[0] for column in told], expected, atol=1e-6)  # a picoradian

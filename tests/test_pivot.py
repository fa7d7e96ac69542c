"""A pose that turns about a point given with it: exact for large rotations, its derivatives, as input of a scenario."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import SCENARIOS
from scipy.spatial.transform import Rotation

from ctrlgen import InputError
from ctrlgen.path_timing.retimed import retimed
from ctrlgen.physics.pivot import about, can_turn
from ctrlgen.physics.screw import TWIST
from ctrlgen.trajectory.problem import PathProblem
from ctrlgen.trajectory.scenario import load_scenario, model_of

ARM = np.array([3e-3, -20e-3, 11e-3])
HEXAPOD = SCENARIOS / "devices/meso_hexapod.toml"
STAGE = SCENARIOS / "devices/rrr_case1.toml"


def test_the_pivot_is_displaced_as_told_and_the_stated_point_turns_about_it():
    """Against SciPy's matrices, from no rotation and 1e-9 rad to half a turn; 1e-17 m is the rounding of 20 mm."""
    rng = np.random.default_rng(5)
    for angle in (0.0, 1e-9, 1e-4, 0.3, 2.0, np.pi):
        axis, moved = rng.normal(size=3), rng.normal(size=3) * 1e-5
        pose = np.concatenate([angle * axis / np.linalg.norm(axis), moved])
        R = Rotation.from_rotvec(pose[:3]).as_matrix()
        stated = about(TWIST, pose[None, None, :], ARM)[0, 0]
        assert np.array_equal(stated[:3], pose[:3])
        assert np.allclose(R @ ARM - ARM + stated[3:], moved, rtol=0, atol=2e-17)


def test_the_order_of_channels_is_that_of_the_signal_and_what_it_lacks_is_still():
    planar = about(("delta_x", "delta_y", "theta_z"), np.array([[[1e-6, 2e-6, 0.2]]]), ARM)[0, 0]
    full = about(TWIST, np.array([[[0, 0, 0.2, 1e-6, 2e-6, 0]]]), ARM)[0, 0]
    assert np.allclose(planar, full[[3, 4, 2]], rtol=0, atol=1e-17)


def test_derivatives_are_those_of_the_moved_pose():
    def path(t):
        return np.array([0.4 * t, -0.3 * t**2, 0.2 * np.sin(t), 1e-3 * t**3, 2e-3 * t, 1e-3 * np.cos(t)])

    def rates(t):
        return np.array(
            [
                [0.4, -0.6 * t, 0.2 * np.cos(t), 3e-3 * t**2, 2e-3, -1e-3 * np.sin(t)],
                [0, -0.6, -0.2 * np.sin(t), 6e-3 * t, 0, -1e-3 * np.cos(t)],
            ]
        )

    def stated(t):
        return about(TWIST, path(t)[None, None, :], ARM)[0, 0]

    t, h = 0.8, 1e-4
    tables = about(TWIST, np.vstack([path(t), rates(t)])[:, None, :], ARM)[:, 0]
    # central differences: h^2 of the third and fourth derivative, roundings of 1e-17 over h^2
    assert np.allclose(tables[1], (stated(t + h) - stated(t - h)) / (2 * h), atol=1e-9)
    assert np.allclose(tables[2], (stated(t + h) - 2 * stated(t) + stated(t - h)) / h**2, atol=1e-8)


def test_the_third_derivative_is_exact_near_no_rotation():
    """Through theta = 0 at the speed w about z, d^3/dt^3 (R - I) r = w^3 (sin a r - cos a z x r) across z."""
    w, r = 3.0, ARM[:2]
    for angle in (0.0, 1e-15, 1e-9, 1e-5):
        tables = np.zeros((4, 1, 6))
        tables[0, 0, 2], tables[1, 0, 2] = angle, w
        third = w**3 * (np.sin(angle) * r - np.cos(angle) * np.array([-r[1], r[0]]))
        # a few roundings of w^3 times the arm
        assert np.allclose(about(TWIST, tables, ARM)[3, 0, 3:], [*-third, 0], rtol=0, atol=1e-15)


def written(folder, device, lines, path='kind = "poses"\npoints = [{ theta_z = "0.1 deg" }, { delta_x = "3 um" }]'):
    (folder / "scenario.toml").write_text(f'title = "t"\ndevice = "{device}"\n{lines}\n[path]\n{path}\n')
    return load_scenario(folder)


def test_a_scenario_turns_about_its_pivot(tmp_path):
    scenario = written(tmp_path, HEXAPOD, 'pivot = ["5 mm", "0 mm", "-20 mm"]')
    samples, a = scenario.bind(model_of(scenario)).samples, np.deg2rad(0.1)
    moved = -5e-3 * np.array([np.cos(a) - 1, np.sin(a), 0])
    assert np.allclose(samples[0], [0, 0, a, *moved], rtol=0, atol=1e-17)
    assert np.allclose(samples[1], [0, 0, 0, 3e-6, 0, 0], rtol=0, atol=1e-20)


def test_derivatives_of_a_path_are_of_the_path_about_the_pivot(tmp_path):
    scenario = written(
        tmp_path,
        STAGE,
        'pivot = ["5 mm", "1 mm", "0 mm"]\npoints = 9',
        'kind = "line"\nend = { theta_z = "1 mrad", delta_y = "1 um" }',
    )
    problem, share = scenario.bind(model_of(scenario)), np.linspace(0.1, 0.9, 5)
    place, rate = problem.geometry(1, share)
    assert np.allclose(
        rate, (problem.geometry(0, share + 1e-4)[0] - problem.geometry(0, share - 1e-4)[0]) / 2e-4, atol=1e-12
    )
    assert np.allclose(place[:, 0], 1e-3 * 1e-3 * share, atol=1e-8)  # y of the arm times the angle
    assert np.allclose(problem.samples[-1], problem.geometry(0, np.array([1.0]))[0, 0], rtol=0, atol=1e-18)


def test_set_points_of_a_path_about_a_pivot_are_of_the_stated_point(tmp_path):
    """They are written as what the device is led through: a pivot once more would turn them twice."""
    scenario = written(
        tmp_path,
        STAGE,
        'pivot = ["5 mm", "1 mm", "0 mm"]\nsample_rate = "1 kHz"\nduration = "9 ms"',
        'kind = "line"\nend = { theta_z = "1 mrad" }',
    )
    model = model_of(scenario)
    samples = scenario.bind(model).samples
    assert scenario.file.sample_rate is not None
    again = retimed(scenario, model, samples, scenario.file.sample_rate, "set-points")
    assert np.array_equal(again.bind(model).samples, samples)


def test_a_path_between_its_samples_is_about_the_pivot_too(tmp_path, monkeypatch):
    """A straight line of the pivot: what is asked for between samples is moved as they are, and the mode that is shaped is that of the
    stated point's end."""
    timed = 'pivot = ["5 mm", "1 mm", "0 mm"]\nsample_rate = "1 kHz"\nduration = "8 ms"'
    line = 'kind = "line"\nend = { theta_z = "1 mrad" }'
    problem = (scenario := written(tmp_path, STAGE, timed, line)).bind(model := model_of(scenario))
    assert np.allclose(problem.positions(0.0), problem.samples, rtol=0, atol=1e-17)
    a = (between := problem.positions(0.5))[:, 2]
    moved = -np.column_stack([5e-3 * (np.cos(a) - 1) - 1e-3 * np.sin(a), 5e-3 * np.sin(a) + 1e-3 * (np.cos(a) - 1)])
    assert np.allclose(between[:, :2], moved, rtol=0, atol=1e-17)

    asked = []
    monkeypatch.setattr(PathProblem, "order", 2)
    monkeypatch.setattr(
        "ctrlgen.trajectory.problem.least_damped_mode", lambda *given: asked.append(given) or (400.0, 0.0)
    )
    _ = written(tmp_path, STAGE, f'{timed}\nshaping = {{ kind = "ZV" }}', line).bind(model).shaper
    assert np.allclose(asked[0][2], problem.samples[-1], rtol=0, atol=1e-17)


def test_what_cannot_turn_is_refused_where_it_is_read(tmp_path):
    line, axis = 'kind = "line"\nend = {}', SCENARIOS / "devices/flexure_axis.toml"
    with pytest.raises(InputError, match="pivot: turns a pose about a point, and what is followed is the pose axis"):
        written(tmp_path, axis, 'pivot = ["5 mm", "0 mm", "0 mm"]\npoints = 3', line)
    with pytest.raises(InputError, match="what is followed is the displacement"):
        written(tmp_path, HEXAPOD, 'follow = "displacement"\npivot = ["5 mm", "0 mm", "0 mm"]\npoints = 3', line)
    assert can_turn(("theta_z", "delta_x")) and not can_turn(("theta_z", "delta_z")) and not can_turn(TWIST[3:])


def test_more_than_a_turn_about_a_pivot_is_refused(tmp_path):
    scenario = written(
        tmp_path, HEXAPOD, 'pivot = ["5 mm", "0 mm", "0 mm"]', 'kind = "poses"\npoints = [{ theta_z = "361 deg" }]'
    )
    with pytest.raises(InputError, match="path: turns by 361 deg"):
        _ = scenario.bind(model_of(scenario)).samples

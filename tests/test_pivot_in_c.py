"""The C takes the pose of a pivot that is given at run time, as a scenario that states one does, and refuses what is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import SCENARIOS
from scipy.spatial.transform import Rotation

from ctrlgen import build_model, generate, load_scenario
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.toolchains import compile_c
from ctrlgen.firmware.folder import CFolder, write_harness
from ctrlgen.firmware.online.stated_pivot import FARTHEST, StatedPivot
from ctrlgen.verification.comparison import compare
from ctrlgen.verification.comparison_entry import ComparisonKind
from ctrlgen.verification.host import run_host

INPUT = 16


def harness(folder: CFolder, scenario, model, real: Real, compiler: str, out):
    """The program that runs the online controller of a folder alone."""
    alone = replace(folder, player={})
    write_harness(alone, scenario, model, real, out / "harness.c")
    sources = [str(out / "harness.c"), str(folder.path / f"{folder.online[real]}.c")]
    compile_c(compiler, folder.path, [*sources, "-o", str(out / "harness")])
    return out / "harness"


def stated(poses, pivots):
    """delta = delta_p - (R - I) pivot by SciPy's matrices, of poses with all six channels."""
    turned = Rotation.from_rotvec(poses[:, :3]).apply(pivots)
    return np.hstack([poses[:, :3], poses[:, 3:] - (turned - pivots)])


def test_the_c_gives_the_pose_of_the_stated_point_and_refuses_what_is_none(circle_c, circle, compiler, tmp_path):
    """In double to the roundings of 100 mm; from no rotation to a full turn about an axis."""
    program = harness(circle_c, circle.scenario, circle.model, Real.DOUBLE, compiler, tmp_path)
    rng = np.random.default_rng(7)
    axes = rng.normal(size=(60, 3))
    angles = np.concatenate([[0.0, 1e-12, 1e-6], np.geomspace(1e-4, 2 * np.pi, 57)])
    poses = np.hstack([angles[:, None] * axes / np.linalg.norm(axes, axis=1)[:, None], rng.normal(size=(60, 3)) * 1e-5])
    pivots = rng.uniform(-0.1, 0.1, (60, 3))
    answer = run_host(program, "about", np.hstack([pivots, poses]), 6)
    assert not answer[:, 0].any()
    assert np.array_equal(answer[:, 1:4], poses[:, :3])
    assert np.allclose(answer[:, 1:], stated(poses, pivots), rtol=0, atol=1e-15)

    whole = np.concatenate([pivots[9], poses[9]])
    limits = np.concatenate([[FARTHEST] * 3, StatedPivot(controller_of(circle.model, "pose", 1e-3).kernels).limits])
    assert np.all(limits[3:6] == 2 * np.pi)
    for wrong in (np.full(9, np.nan), np.full(9, np.inf), np.full(9, -np.inf), -limits * (1 + 1e-15)):
        spoilt = np.tile(whole, (9, 1))
        np.fill_diagonal(spoilt, wrong)
        refused = run_host(program, "about", spoilt, 6)
        assert np.all(refused[:, 0] == INPUT) and not refused[:, 1:].any()


@pytest.mark.long
@pytest.mark.parametrize(
    ("device", "end"),
    [("rrr_case1", "theta_z"), ("dynamic_hexapod", "theta_y")],
)
def test_targets_of_a_pivot_are_those_of_a_scenario_that_states_it(device, end, compiler, tmp_path):
    """Positions and derivatives along a path from no rotation on, planar and with inertia: the C's in double for the pose of the pivot
    are the targets that the controller is given for a scenario with it, to the roundings of its kernel."""
    rest = f'title = "t"\ndevice = "{SCENARIOS}/devices/{device}.toml"\nsample_rate = "20 kHz"\nduration = "20 ms"\n'
    rest += f'[path]\nkind = "line"\nend = {{ {end} = "100 urad", delta_x = "2 um" }}\n'
    bound, scenarios = [], []
    for pivot in ("", 'pivot = ["3 mm", "-20 mm", "11 mm"]\n'):
        (tmp_path / "scenario.toml").write_text(pivot + rest)
        scenarios.append(load_scenario(tmp_path))
        model = build_model(scenarios[-1].device)
        bound.append(scenarios[-1].bind(model).targets[::7])
    scenario, (poses, wanted) = scenarios[0], bound
    pivot = np.array([3e-3, -20e-3, 11e-3])
    folder = generate(scenario, model, tmp_path / "c")
    program = harness(folder, scenario, model, Real.DOUBLE, compiler, tmp_path)
    answer = run_host(program, "about", np.hstack([np.tile(pivot, (len(poses), 1)), poses]), poses.shape[1])
    assert not answer[:, 0].any() and not np.array_equal(poses, wanted)
    numbers = StatedPivot(controller_of(model, "pose", scenario.sample_time).kernels)
    off = np.array([numbers.rounding(pose, pivot, Real.DOUBLE) for pose in poses])
    assert np.all(np.abs(answer[:, 1:] - wanted) <= off + 1e-13 * np.abs(wanted).max(axis=0))


@pytest.mark.long
def test_the_comparison_has_the_poses_of_pivots_and_they_hold(circle_c, circle, tmp_path):
    rows = [row for row in compare(circle_c, circle).rows if row.what is ComparisonKind.ABOUT]
    assert {row.build.real for row in rows} == set(Real) and all(row.passed and row.samples == 277 for row in rows)

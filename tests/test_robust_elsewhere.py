"""Scenarios that ask for a probability, where a path is solved for something else: learning, calibration, the fastest motion."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENARIOS
from learning_bench import Bench, shortened, solved

import ctrlgen
from ctrlgen import InputError, build_model, learn, load_device
from ctrlgen.calibration.budgets_compared import budgets
from ctrlgen.calibration.calibrate import CalibratedConstant, Calibration
from ctrlgen.recordings.reader import load_recordings

SPECIMEN = SCENARIOS / "hexapod_specimen"
RUN_TIME = SCENARIOS / "devices" / "mems_hexapod_run_time.toml"


@pytest.fixture
def robust(tmp_path) -> Path:
    """The shipped example in 50 samples."""
    folder = shortened("circle_robust", tmp_path / "circle_robust", sample_rate="100 Hz")
    shutil.copy(SCENARIOS / "circle_robust" / "uncertainty.toml", folder)
    return folder


@pytest.mark.long
def test_the_next_drives_of_a_robust_path_are_learnt_within_its_tightened_limits(robust, tmp_path):
    solution = solved(robust)
    bench = Bench(solution, tmp_path)
    bench.run(solution.drive)
    learnt = learn(robust, bench.runs)
    assert (
        learnt.solution.model.probability == pytest.approx(0.999)
        and learnt.solution.scenario.home == solution.scenario.home
    )
    assert not learnt.stop and np.abs(learnt.next.drive - solution.drive).max() > 1e-3  # W, of 0.2
    # The command of the first solution is followed to rounding, that of the bench is 3.6 % of the circle off
    assert learnt.runs[0].rms["translation"] > 100e-9
    assert all(m.distance >= -1e-6 * abs(m.bound) for m in learnt.next.margins)
    assert {m.limit.name for m in learnt.next.margins if m.reserve} == {
        m.limit.name for m in solution.margins if m.reserve
    }


@pytest.mark.long
def test_the_budgets_of_a_calibration_are_those_of_a_robust_path(robust):
    device = load_device(RUN_TIME)
    rows = tuple(CalibratedConstant(c, c.default, 1e-3 * abs(c.default), True) for c in device.given_at_start)
    covariance = np.diag([row.sd**2 for row in rows])
    made = Calibration(device, {}, load_recordings([SPECIMEN], build_model(device)), rows, covariance, (), ())
    before, after = budgets(made, robust, RUN_TIME)
    assert before.solution.model.probability == after.solution.model.probability == pytest.approx(0.999)
    assert after.peak(after.groups[0]) < before.peak(before.groups[0])
    assert after.solution.scenario.home == before.solution.scenario.home != {}


def test_the_fastest_motion_is_refused_for_limits_that_hold_at_a_probability(robust):
    with pytest.raises(InputError, match="the fastest path is not computed"):
        ctrlgen.fastest(robust)

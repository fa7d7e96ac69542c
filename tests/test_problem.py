"""What is to be followed by which model: samples, clock, motion and the inverse that is chosen."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import SCENARIOS
from three_stacks import circle, heavy, loaded, stage

from ctrlgen import InputError, build_model, load_scenario
from ctrlgen.trajectory.inverse.balanced import BalancedInverse
from ctrlgen.trajectory.inverse.clock import Sampled, Settled, in_time
from ctrlgen.trajectory.inverse.inertial import InertialInverse
from ctrlgen.trajectory.inverse.redundant import RedundantInverse


def bound(name: str):
    scenario = load_scenario(SCENARIOS / name)
    return scenario.bind(build_model(scenario.device))


def test_equilibria_have_no_sample_time():
    problem = bound("coupled_dof")
    assert problem.clock == Settled() and not problem.closed
    assert not hasattr(problem.clock, "sample_time") and problem.clock.moment(3) == ""
    with pytest.raises(ValueError, match="no time passes"):
        in_time(problem.clock)


def test_samples_in_time_have_one():
    problem = bound("circle20")
    assert problem.clock == Sampled(1e-3) == in_time(problem.clock) and problem.closed
    assert problem.clock.times(3) == pytest.approx([0, 1e-3, 2e-3]) and problem.clock.moment(3) == " at 0.003 s"


def test_a_motion_has_as_many_derivatives_as_the_drive_follows_none_in_balance():
    still, moved = bound("circle20"), bound("flexure_axis_line")
    assert still.order == 0 and still.motion.derivatives.shape == (0, *still.samples.shape)
    assert np.array_equal(still.motion.position, still.samples) and np.array_equal(still.targets, still.samples)
    assert len(moved.motion.derivatives) == moved.order >= 2
    # From sample to sample by Taylor's formula; what it leaves is of third order in a path of a thousand samples
    h, (first, second) = moved.clock.sample_time, moved.motion.derivatives[:2]
    foreseen = (moved.samples + h * first + h**2 / 2 * second)[:-1]
    assert np.abs(foreseen - moved.samples[1:]).max() < 1e-3 * np.abs(np.diff(moved.samples, axis=0)).max()


def test_each_kind_of_device_has_the_inverse_of_its_kind(tmp_path):
    timing = 'sample_rate = "1 kHz"\nduration = "0.1 s"\n'
    assert type(bound("circle20").inverse) is BalancedInverse
    assert type(bound("flexure_axis_line").inverse) is InertialInverse
    for device, inner in ((stage(), BalancedInverse), (heavy(), InertialInverse)):
        scenario, model = loaded(tmp_path, device, circle(2), timing)
        inverse = scenario.bind(model).inverse
        assert type(inverse) is RedundantInverse and type(inverse.inner) is inner


def test_with_inertia_a_path_without_time_is_refused(tmp_path):
    scenario, model = loaded(tmp_path, heavy(), circle(2), "points = 20\n")
    with pytest.raises(InputError, match="what it needs depends on time"):
        _ = scenario.bind(model).motion


def test_in_balance_the_samples_stay_those_of_the_path_with_inertia(tmp_path):
    """A path in balance that leaves it open is less smooth: what inertia asks for is written out."""
    line = 'kind = "line"\nend = { x = "12 um", y = "4 um" }\n'
    scenario, model = loaded(tmp_path, heavy(), line)
    problem = scenario.bind(model)
    still = problem.in_balance
    assert still.order == 0 and not still.model.inertial and type(still.inverse.inner) is BalancedInverse
    assert np.array_equal(still.samples, problem.samples)
    assert not np.allclose(scenario.bind(still.model).samples, still.samples, atol=1e-9)

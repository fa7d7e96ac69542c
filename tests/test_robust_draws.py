"""Limits of the robust circle against draws of its uncertain numbers and a device at the quantile."""

from __future__ import annotations

from dataclasses import replace

import pytest
from robust_paths import EXAMPLE, RISK, farthest, without
from scipy.stats import norm

from ctrlgen import InputError, load_scenario, solve
from ctrlgen.budget.error_budget import budget_of
from ctrlgen.budget.uncertainty import load_uncertainties
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.folder import generate
from ctrlgen.trajectory.scenario import model_of


@pytest.fixture(scope="module")
def example():
    """The shipped scenario with a tenth of its samples, with its model."""
    scenario = load_scenario(EXAMPLE)
    rate = type(scenario.file.sample_rate)(100.0, "100 Hz", None)
    scenario = replace(scenario, file=scenario.file.model_copy(update={"sample_rate": rate}))
    return scenario, model_of(scenario)


@pytest.fixture(scope="module")
def plain(example):
    scenario, model = example
    return solve(without(scenario), model)


@pytest.fixture(scope="module")
def robust(example):
    return solve(*example)


def broken(solution, draws, seed=3):
    """The share of draws that break a limit anywhere on the path, and the budget."""
    scenario = without(solution.scenario)
    budget = budget_of(solution, load_uncertainties(scenario, solution.model), draws=draws, seed=seed)
    return budget.broken, budget


@pytest.mark.long
def test_draws_break_limits_of_the_plain_path_and_not_of_the_robust_one(plain, robust):
    share, _ = broken(plain, 2_000)
    assert 0.01 < share < 0.1
    share, budget = broken(robust, 10_000)
    assert share <= RISK
    assert all(s.kept >= 0 and s.probability >= 1 - RISK for s in budget.safeties)
    assert robust.scenario.home["delta_z"] < -5e-6  # lower is colder: the error is less


@pytest.mark.exhaustive
def test_of_a_hundred_thousand_draws_as_few_break_limits_as_is_stated():
    scenario = load_scenario(EXAMPLE)
    model = model_of(scenario)
    share, _ = broken(solve(scenario, model), 100_000)
    assert share <= RISK
    # the same where the path cannot be moved and its reserve is used up: as far up as it holds
    held = solve(replace(without(scenario, home=()), home={"delta_z": -1.8e-6}), model)
    share, _ = broken(held, 100_000)
    assert RISK / 30 < share <= RISK


@pytest.mark.long
def test_a_simulated_device_at_the_quantile_keeps_the_stroke_on_the_robust_path_alone(plain, robust):
    z = norm.isf(RISK)
    end = plain.model.z_bounds[1].max()
    assert farthest(plain, z) > end > farthest(robust, z)
    # where the plain path has its own distance from the end, it just meets it: the propagation is that of the simulator
    stated = load_uncertainties(plain.scenario, plain.model)
    (stroke,) = (
        s for s in budget_of(plain, stated, draws=0).safeties if s.limit.name == "stroke" and s.side == "upper"
    )
    assert farthest(plain, stroke.margin / stroke.sd) == pytest.approx(end, abs=0.03 * stroke.sd)  # its second order


@pytest.mark.long
def test_the_generated_controller_keeps_the_tightened_limits(robust, plain, tmp_path):
    controller = controller_of(robust.model, "pose", robust.scenario.sample_time)
    target = robust.command[0].copy()
    target[robust.model.signals["pose"].channels.index("delta_z")] = 80e-6  # above the workspace
    step = controller.step((robust.trace.x[0], robust.trace.z[0]), target, settle=True)
    assert step.status and step.displacement.max() <= robust.model.z_bounds[1].max() * (1 + 1e-9)
    limits = {limit.name: limit for limit in robust.model.limits}
    own = {limit.name: limit for limit in plain.model.limits}
    assert limits["stroke"].upper < own["stroke"].upper and limits["temperature"].upper < own["temperature"].upper
    # what the device rests at is not taken from it
    assert limits["stroke"].lower == own["stroke"].lower and limits["temperature"].lower == own["temperature"].lower
    c = generate(robust.scenario, robust.model, tmp_path / "c", robust)
    (header,) = (path for path in c.path.glob("*online_f64.h"))
    text = header.read_text()
    assert "55 um less" in text and "99.9 % along circle_robust" in text
    (source,) = (path for path in c.path.glob("*online_f64.c"))
    assert repr(limits["stroke"].upper) in source.read_text() and repr(own["stroke"].upper) not in source.read_text()


def test_limits_as_described_are_refused_where_they_are_to_be_tightened(example, tmp_path):
    scenario, model = example
    with pytest.raises(InputError, match="asks for tightened limits"):
        generate(scenario, model, tmp_path / "c")
    assert not (tmp_path / "c").exists()

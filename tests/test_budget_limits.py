"""The error budget of limits: how safe they are, which are uncertain themselves, and what draws say of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from budget_cases import number, stated
from conftest import SCENARIOS

from ctrlgen import SolverError, build_model, load_scenario, solve, user_device
from ctrlgen.budget.error_budget import agreement, budget_of
from ctrlgen.budget.limits import DrawnLimits, Margins, Slopes, critical_samples, slopes_of_limits
from ctrlgen.budget.linear import propagate
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.budget.uncertainty import load_uncertainties
from ctrlgen.devices.changed_numbers import changed


@pytest.mark.long
def test_a_number_that_moves_a_bound_is_found_wherever_it_stands(circle, tmp_path):
    """The coldest that a heater can be is its surroundings: that bound rises as they do, and with no other of these numbers."""
    others = ["actuator.young", "actuator.expansion", "actuator.thickness"]
    for place in (0, 1, 3):
        names = [*others[:place], "actuator.ambient", *others[place:]]
        text = "".join(f'"{n}" = {{ sd = "{"2 K" if "ambient" in n else "1 %"}", source = "a" }}\n' for n in names)
        path = UncertainPath(circle, stated(circle, f"[numbers]\n{text}", tmp_path))
        slopes = slopes_of_limits(path, propagate(path))
        hot = [i for i, (limit, _) in enumerate(path.channels) if limit.name == "temperature"]
        expected = np.tile(np.arange(4) == place, (len(hot), 1))
        np.testing.assert_allclose(slopes.lower[hot], expected, atol=1e-9)
        np.testing.assert_allclose(slopes.upper[hot], 0.0, atol=1e-9)


def test_a_limit_is_least_safe_where_the_least_is_left_at_the_quantile_not_where_it_is_nearest():
    """Margins of 1 and 2 K with sds of 0.1 and 1 K: at 99.9 % 0.69 K is left of the first and -1.09 K of the second."""
    margin, sd = np.array([1.0, 2.0]).reshape(1, 2, 1), np.array([0.1, 1.0]).reshape(1, 2, 1)
    found = Margins(np.repeat(margin, 2, axis=0), np.repeat(sd, 2, axis=0), np.zeros((2, 1)), np.array([[-9.0], [9.0]]))
    assert critical_samples(found, 0.5).tolist() == [[0], [0]] and critical_samples(found, 0.999).tolist() == [[1], [1]]


def test_a_draw_with_another_limit_is_held_against_that_one():
    """A quantity within 0 and 100 K; the first column raises both bounds by what it deviates, the second the quantity itself."""
    one, zero = np.ones((2, 1, 1)), np.zeros((1, 1))
    found = Margins(one, one, zero, np.array([[0.0], [100.0]]))
    limits = DrawnLimits(found, Slopes(np.array([[1.0, 0.0]]), np.array([[1.0, 0.0]]), np.array([[[0.0, 1.0]]])))
    values, broken = [99.0, 103.0, 103.0, 3.0, 3.0, 98.0, 2.0], [True, False, True, True, False, True, True]
    columns = [(-2, 0), (5, 0), (2, 0), (5, 0), (2, 0), (0, 3), (0, -3)]
    assert limits.of(np.array(columns, float)).broken(0, np.array(values)[:, None]).tolist() == broken


def test_a_number_that_acts_on_a_limit_alone_makes_it_uncertain(tmp_path):
    """A stress of 1 MPa/um, known to 5 %, at 20 um below 22 MPa: two standard deviations, which 2.3 % of devices are beyond; of 4000
    draws that is known to 0.24 %."""
    device = user_device(
        "axis",
        parameters={"k": "1 N/um", "c": "1e12 Pa/m"},
        drive={"a": "100 N"},
        axes={"x": "50 um"},
        force=lambda u: [u.a],
        restoring_force=lambda d, p: p.k * d.vector,
        limits={"stress": (lambda d, p: p.c * d.x, "22 MPa")},
    )
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "axis"\n[path]\nkind = "poses"\npoints = [{ x = "20 um" }]\n'
    )
    (tmp_path / "uncertainty.toml").write_text(
        'title = "u"\n[numbers]\n"mechanism.c" = { sd = "5 %", source = "chosen" }\n'
    )
    scenario = load_scenario(tmp_path, device)
    solution = solve(scenario, build_model(device))
    uncertainties = load_uncertainties(scenario, solution.model)
    path = UncertainPath(solution, uncertainties)
    (k,) = (k for k, (limit, _) in enumerate(path.channels) if limit.name == "stress")
    assert slopes_of_limits(path, propagate(path)).direct[0, k, 0] == pytest.approx(20e-6)  # d(c x)/dc, with its sign
    found = budget_of(solution, uncertainties, probability=0.99, draws=4000)
    (stress,) = (s for s in found.safeties if s.limit.name == "stress" and s.side == "upper")
    assert stress.margin == pytest.approx(2e6) and stress.sd == pytest.approx(1e6, rel=1e-6)
    assert stress.probability == pytest.approx(0.97725, abs=1e-5) and stress.kept == pytest.approx(-0.3263e6, rel=1e-3)
    assert found.broken == pytest.approx(0.0228, abs=0.007)
    assert stress.drawn == pytest.approx(stress.kept, abs=0.15e6)  # forty draws lie beyond the quantile


@pytest.mark.long
def test_a_limit_that_is_not_kept_says_by_how_much(circle, tmp_path):
    tight = changed(circle.model.device, {"actuator.temperature_limit": 273.15 + 160.0})
    scenario = load_scenario(SCENARIOS / "circle20")
    scenario = type(scenario)(scenario.name, scenario.path, scenario.file, tight, scenario.inputs)
    found = budget_of(solve(scenario, build_model(tight)), load_uncertainties(scenario, build_model(tight)), draws=0)
    (hot,) = (s for s in found.safeties if s.limit.name == "temperature" and s.side == "upper")
    assert 0 < hot.margin < 3 * hot.sd and hot.kept < 0 and 0.5 < hot.probability < 0.999 and hot.drawn is None


@pytest.mark.long
def test_where_first_order_and_draws_differ_it_is_said_why(circle, tmp_path):
    text = '[numbers]\n"actuator.beam_width" = { sd = "20 %", source = "not measured" }\n'
    found = budget_of(circle, stated(circle, text, tmp_path), draws=2000)
    assert not all(a.passed for a in found.agreements)
    assert any("actuator.beam_width" in reason and "not linear" in reason for reason in found.reasons)


@pytest.mark.long
@pytest.mark.parametrize("turned", [False, True])
def test_draws_far_off_are_counted_and_named(circle, tmp_path, turned):
    given = stated(circle, '[numbers]\n"actuator.thermal_resistance" = { sd = "5 %", source = "chosen" }', tmp_path)
    found = budget_of(circle, given, draws=200)
    pose, columns = found.drawn.pose.copy(), found.drawn.columns.copy()
    pose[7] = -1e4 * np.abs(pose[7])  # as of a draw that grows, to either side
    columns[7] = -2 * number(circle, "actuator.thermal_resistance") if turned else columns[7]
    drawn = replace(found.drawn, pose=pose, columns=columns)
    path = UncertainPath(circle, given)
    far = replace(found, agreements=tuple(agreement(g, found.combined, drawn, path) for g in found.groups))
    assert far.agreements[0].outlying == 1 and "more than 10 standard uncertainties off" in far.reasons[0]
    assert ("actuator.thermal_resistance has the other sign" in far.reasons[0]) == turned


def test_sds_with_which_a_draw_is_no_device_are_refused(circle, tmp_path):
    text = '[numbers]\n"stage.half_stage_stiffness" = { sd = "60 %", source = "not measured" }\n'
    with pytest.raises(SolverError, match=r"pose or a limited quantity of [0-9]+ of 1000 draws is not finite"):
        budget_of(circle, stated(circle, text, tmp_path), draws=1000)

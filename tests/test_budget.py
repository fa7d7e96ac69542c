"""The error budget against devices whose numbers are changed and simulated, one by one and drawn at random."""

from __future__ import annotations

import numpy as np
import pytest
from budget_cases import FILE, TRANSLATIONS, driven, largest_nm, number, pushed, stated, two_axes
from conftest import DEVICES, SCENARIOS

from ctrlgen import InputError, build_model, error_budget, load_device, load_scenario, simulate, solve, user_device
from ctrlgen.budget import monte_carlo
from ctrlgen.budget.error_budget import budget_of
from ctrlgen.budget.finer_model import load_finer
from ctrlgen.budget.limits import margins, slopes_of_limits
from ctrlgen.budget.linear import propagate
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.budget.uncertainty import load_uncertainties
from ctrlgen.devices.changed_numbers import changed


@pytest.fixture(scope="module")
def budget(circle):
    """Of the circle with what is stated beside it."""
    return budget_of(circle, load_uncertainties(circle.scenario, circle.model), seed=1)


@pytest.fixture(scope="module")
def linear(circle):
    path = UncertainPath(circle, load_uncertainties(circle.scenario, circle.model))
    return propagate(path)


# Figures measured on the circle with the drives of the device as described: the largest deviation of one translation.
@pytest.mark.long
def test_measured_figures_are_reproduced(circle, budget):
    lines = {line.name: line for line in budget.lines}
    R, tau = (number(circle, f"actuator.{name}") for name in ("thermal_resistance", "time_constant"))
    measured = {
        "actuator.thermal_resistance": (5, 857, {"actuator.thermal_resistance": 1.05 * R}, {}),
        "actuator.time_constant": (20, 63, {"actuator.time_constant": 1.2 * tau}, {}),
        "surroundings": (1, 262, {}, {"warmer": 1.0}),
    }
    for name, (steps, known, numbers, more) in measured.items():
        simulated = largest_nm(driven(circle, numbers, **more))
        assert simulated == pytest.approx(known, rel=0.01), name  # the figures have two or three digits
        # 5 %: the second order of a step as large as these
        assert 1e9 * steps * lines[name].sensitivity["translation"] == pytest.approx(simulated, rel=0.05), name


@pytest.mark.long
@pytest.mark.parametrize(
    "path",
    [
        "actuator.thermal_resistance",
        "actuator.ambient",
        "actuator.thickness",
        "stage.half_stage_stiffness",
        "hexapod.height",
        "hexapod.wire_diameter",
        "hexapod.base_angles[3]",
    ],
)
def test_a_sensitivity_is_that_of_a_device_with_another_number(circle, linear, path):
    columns = [p for line in load_uncertainties(circle.scenario, circle.model).lines for p in line.paths]
    step = 1e-4 * number(circle, path)
    pair = [driven(circle, {path: number(circle, path) + sign * step}) for sign in (1, -1)]
    slope = (pair[0] - pair[1]) / (2 * step)
    found = linear.sensitivity["pose"][:, :, columns.index(path)]
    # by symmetry some numbers do not turn the platform about an axis: rounding is then all that is left of that channel
    for kind in (slice(0, 3), TRANSLATIONS):
        assert np.abs(found - slope)[:, kind].max() <= 1e-4 * np.abs(slope[:, kind]).max()  # what differences leave


def test_gains_are_those_of_scaled_drives(circle, linear, rng):
    columns = [(line.name, p) for line in load_uncertainties(circle.scenario, circle.model).lines for p in line.paths]
    places = [i for i, (name, _) in enumerate(columns) if name == "drive.channel_gain"]
    gains = 1e-4 * rng.standard_normal(6)
    deviation = driven(circle, {}, circle.drive * (1 + gains))
    found = linear.sensitivity["pose"][:, :, places] @ gains
    np.testing.assert_allclose(found, deviation, atol=1e-3 * np.abs(deviation).max())
    common = linear.sensitivity["pose"][:, :, columns.index(("drive.gain", "all"))]
    np.testing.assert_allclose(common, linear.sensitivity["pose"][:, :, places].sum(axis=2), rtol=1e-9, atol=1e-15)


def test_draws_are_correlated_as_stated(tmp_path):
    """x = g u/k, shares of 1 % each with the coefficient -0.6: sqrt(1 + 1 + 2 * 0.6) %. 4000 draws tell it to 1 %."""
    both = "".join(f'"mechanism.{name}" = {{ sd = "1 %", source = "chosen" }}\n' for name in "gk")
    between = '[[correlation]]\nbetween = ["mechanism.g", "mechanism.k"]\ncoefficient = -0.6\nsource = "chosen"\n'
    found = budget_of(*pushed(tmp_path, f"[numbers]\n{both}{between}"), draws=4000)
    expected = np.sqrt(3.2) * 0.01 * np.array([[10e-6], [20e-6]])
    assert found.combined == pytest.approx(expected, rel=1e-6)
    assert found.drawn.pose.std(axis=0) == pytest.approx(expected, rel=0.04)


@pytest.mark.long
def test_draws_and_first_order_agree(budget):
    assert len(budget.agreements) == 2 and all(a.passed for a in budget.agreements) and budget.reasons == ()
    for a in budget.agreements:
        assert a.drawn == pytest.approx(a.linear, rel=0.1) and 0 < a.difference < 0.1


@pytest.mark.long
def test_a_draw_is_a_simulated_device(circle, budget):
    given = budget.uncertainties
    columns = [(line.kind, p) for line in given.lines for p in line.paths]
    drawn = budget.drawn.columns[3]
    numbers = {p: number(circle, p) + d for (kind, p), d in zip(columns, drawn, strict=True) if kind == "number"}
    gain = 1 + sum(d for (kind, _), d in zip(columns, drawn, strict=True) if kind == "gain")
    gains = gain + np.array([d for (kind, _), d in zip(columns, drawn, strict=True) if kind == "channel_gain"])
    (warmer,) = (d for (kind, _), d in zip(columns, drawn, strict=True) if kind == "surroundings")
    R = numbers["actuator.thermal_resistance"]
    u = circle.drive * gains + warmer / R
    deviation = driven(circle, numbers, u)[budget.drawn.kept]
    off = np.abs(budget.drawn.pose[3] - deviation).max(axis=0)
    scatter = np.sqrt(sum(sd**2 for sd in budget.linear.scatter["pose"].values())).max(axis=0)
    # Converter and jitter are drawn anew
    assert np.all(off < 5 * scatter) and np.all(np.abs(deviation).max(axis=0) > 20 * scatter)


@pytest.mark.long
def test_the_ranking_is_by_what_is_left_without(circle, budget, tmp_path):
    assert [line.share for line in budget.lines] == sorted((line.share for line in budget.lines), reverse=True)
    first = budget.lines[0]
    text = FILE.read_text().replace(
        '"actuator.thermal_resistance"   = { sd = "5 %"', '"actuator.thermal_resistance" = { sd = "2.5 %"'
    )
    (tmp_path / "half.toml").write_text(text)
    half = budget_of(circle, load_uncertainties(circle.scenario, circle.model, tmp_path / "half.toml"), draws=0)
    assert first.name == "actuator.thermal_resistance"
    for group in budget.groups:
        assert half.peak(group) == pytest.approx(first.halved[group.name], rel=1e-6)


def test_draws_are_the_same_in_any_number_of_processes(tmp_path, monkeypatch):
    """Several blocks of them, the last one not full; with other seeds they differ."""
    monkeypatch.setattr(monte_carlo, "BLOCK", 100)
    scenario, found = two_axes(tmp_path), {}
    for jobs, seed in (("1", 0), ("2", 0), ("1", 1)):
        monkeypatch.setenv("CTRLGEN_JOBS", jobs)
        found[jobs, seed] = error_budget(scenario, draws=250, seed=seed).drawn
    one, two, other = found.values()
    assert one.pose.shape[0] == 250
    assert (
        np.array_equal(one.pose, two.pose)
        and np.array_equal(one.limits, two.limits)
        and np.array_equal(one.alone, two.alone)
    )
    assert not np.array_equal(one.pose, other.pose)


def test_what_scatters_has_its_share_and_is_halved_like_a_number(tmp_path):
    """A converter is all there is: without it nothing is left, with half of it half."""
    solution, given = pushed(tmp_path, '[drive]\nconverter = { bits = 8, source = "chosen" }')
    found = budget_of(solution, given, draws=0)
    (line,), (group,) = found.lines, found.groups
    assert line.share == pytest.approx(1.0) and line.halved[group.name] == pytest.approx(found.peak(group) / 2)


def test_of_two_equal_axes_both_must_be_better_known(tmp_path):
    """Each makes the largest uncertainty somewhere: half the sd of one leaves the peak, half of both halves it; the variance is shared."""
    found = error_budget(two_axes(tmp_path), draws=0)
    (group,) = found.groups
    assert found.peak(group) == pytest.approx(0.04 * 10e-6, rel=1e-9)  # 4 % of the radius
    assert [line.share for line in found.lines] == pytest.approx([0.5, 0.5], abs=1e-9)
    one, both = (line.halved[group.name] for line in found.lines)
    assert one == pytest.approx(found.peak(group), rel=1e-9) and both == pytest.approx(found.peak(group) / 2, rel=1e-9)


def test_a_number_in_a_list_is_called_by_the_name_of_its_table():
    device = load_device(DEVICES / "parallelogram.toml")
    assert device.called("element[1].thickness") == "element[1].thickness (right)"
    assert device.called("output.at[0]") == "output.at[0]" and device.called("drive.gain") == "drive.gain"


@pytest.mark.long
def test_correlated_deviations_add_or_cancel(circle, tmp_path):
    two = '[numbers]\n"actuator.young" = { sd = "1 %", source = "a" }\n"actuator.expansion" = { sd = "1 %", source = "b" }\n'
    between = '[[correlation]]\nbetween = ["actuator.young", "actuator.expansion"]\ncoefficient = {}\nsource = "c"\n'
    peaks = {}
    for r in (-1, 0, 1):
        found = budget_of(circle, stated(circle, two + between.format(r), tmp_path), draws=0)
        peaks[r] = found.combined
        Y = [found.linear.sensitivity["pose"][:, :, i] * found.uncertainties.sds[i] for i in (0, 1)]
    np.testing.assert_allclose(peaks[1], np.abs(Y[0] + Y[1]), atol=1e-14)
    np.testing.assert_allclose(peaks[-1], np.abs(Y[0] - Y[1]), atol=1e-14)
    np.testing.assert_allclose(peaks[0], np.hypot(Y[0], Y[1]), atol=1e-14)


def test_a_limit_that_is_itself_uncertain(circle, tmp_path):
    text = """[numbers]
    "actuator.temperature_limit" = { sd = "5 K", source = "a" }
    "actuator.ambient" = { sd = "2 K", source = "b" }
    """
    path = UncertainPath(circle, stated(circle, text, tmp_path))
    linear = propagate(path)
    slopes = slopes_of_limits(path, linear)
    found = margins(path, linear, slopes)
    hot = [i for i, (limit, _) in enumerate(path.channels) if limit.name == "temperature"]
    # T rises with the ambient, its limit does not
    np.testing.assert_allclose(found.sd[1][:, hot], np.hypot(5, 2), rtol=1e-6)
    # T and its lower bound, the ambient, rise alike; e^-14 is left of 2 K
    np.testing.assert_allclose(found.sd[0][:, hot], 0, atol=1e-5)
    stress = [i for i, (limit, _) in enumerate(path.channels) if limit.name == "wire_stress"]
    step = changed(circle.model.device, {"actuator.ambient": number(circle, "actuator.ambient") + 2})
    trace = simulate(
        build_model(step), np.vstack([circle.drive, circle.drive]), circle.scenario.sample_time, circle.trace.x[0]
    )
    n, model = len(circle.drive), circle.model
    values = [
        model.evaluate_limits(x[200], z[200], circle.drive[199], [])[-1].full().ravel()
        for x, z in ((circle.trace.x, circle.trace.z), (trace.x[n:], trace.z[n:]))
    ]
    np.testing.assert_allclose(found.sd[1][200, stress], np.abs(values[1] - values[0]), rtol=0.02)  # 2 K: second order


def test_the_safety_of_limits_is_that_of_the_draws(budget):
    by_side = {(s.limit.name, s.side): s for s in budget.safeties}
    assert ("temperature", "upper") in by_side and ("wire_stress", "upper") in by_side
    for s in budget.safeties:
        assert s.kept == pytest.approx(s.margin - 3.0902 * s.sd, rel=1e-4)
        assert abs(s.drawn - s.kept) < 0.5 * s.sd  # ten draws lie beyond the quantile of 99.9 %: it is known to 0.3 sd


@pytest.mark.long
@pytest.mark.parametrize(
    "name, path, step",
    [
        ("flexure_axis_line", "mechanics.stiffness", 1e-5),
        ("flexure_axis_line", "mechanics.mass", 1e-5),
        ("lever_circle", "actuator[1].stiffness", 1e-4),
        ("mirror_spiral", "actuator[0].gain", 1e-4),
    ],
)
def test_open_paths_and_stages_with_inertia(name, path, step):
    """sds of the device file; the same drives, simulated with another number from the state that these hold at the start."""
    scenario = load_scenario(SCENARIOS / name)
    model = build_model(scenario.device)
    solution = solve(scenario, model)
    uncertain = UncertainPath(solution, load_uncertainties(scenario, model))
    linear = propagate(uncertain)
    columns = [p for line in uncertain.uncertainties.lines for p in line.paths]
    np.testing.assert_allclose(linear.nominal["pose"], solution.trace.signals["pose"], atol=1e-13)
    value, poses, h = number(solution, path), [], scenario.sample_time
    for sign in (1, -1):
        other = build_model(changed(scenario.device, {path: value * (1 + sign * step)}))
        trace = simulate(
            other, uncertain.drive, h, uncertain.start[: model.x.numel()], uncertain.start[model.x.numel() :]
        )
        poses.append(trace.signals["pose"][1:][uncertain.before :])
    slope = (poses[0] - poses[1]) / (2 * step * value)
    # copies of a pattern have columns of their own, path@1 and so on; all of them together are the number that they share
    found = sum(linear.sensitivity["pose"][:, :, k] for k, p in enumerate(columns) if p.partition("@")[0] == path)
    assert np.abs(slope).max() > 0
    np.testing.assert_allclose(found, slope, atol=2e-4 * np.abs(slope).max())


def test_an_actuator_that_loses_strength_has_lost_as_much_when_the_path_begins_as_for_the_solver(tmp_path):
    """The strength falls by 5 % within a second of the start of the path, x = s(t) g u/k: what is known exactly follows the command, the
    sensitivity to a share of g is the displacement, and a finer model that is the same device moves no otherwise."""
    device = user_device(
        "axis",
        parameters={"g": "0.2 N/V", "k": "1 N/um"},
        drive={"a": "1000 V"},
        axes={"x": "100 um"},
        force=lambda u, p: [p.g * u.a],
        restoring_force=lambda d, p: p.k * d.vector,
        effect=[{"kind": "degradation", "at": "a", "rate": "0.1 1/s", "levels_off": "0.5 s"}],
    )
    points = ", ".join(['{ x = "50 um" }'] * 50)
    (tmp_path / "scenario.toml").write_text(
        f'title = "t"\ndevice = "axis"\nsample_rate = "50 Hz"\n[path]\nkind = "poses"\npoints = [{points}]\n'
    )
    (tmp_path / "uncertainty.toml").write_text(
        'title = "u"\n[numbers]\n"mechanism.g" = { sd = "1 %", source = "chosen" }\n'
    )
    scenario = load_scenario(tmp_path, device)
    model = build_model(device)
    solution = solve(scenario, model)
    strength = 1 - 0.05 * -np.expm1(-np.arange(50) * 0.02 / 0.5)
    assert solution.drive[:-1, 0] == pytest.approx(250 / strength[1:], rel=0.01)  # V, held for a sample
    given = load_uncertainties(scenario, model)
    found = budget_of(solution, given, draws=0, finer=load_finer(scenario, model, device))
    assert found.linear.nominal["pose"] == pytest.approx(solution.command, abs=1e-12)
    assert found.combined == pytest.approx(np.full((50, 1), 0.5e-6), rel=1e-6)
    assert found.model_difference.deviation == pytest.approx(np.zeros((50, 1)), abs=1e-12)


def test_a_static_path(tmp_path):
    (tmp_path / "stated.toml").write_text(
        'title = "s"\n[numbers]\n"stage.half_stage_stiffness" = { sd = "5 %", source = "a" }\n'
    )
    found = error_budget(SCENARIOS / "xy_stage_force", tmp_path / "stated.toml", draws=500)
    model, trace = found.solution.model, found.solution.trace
    k = number(found.solution, "stage.half_stage_stiffness")
    other = build_model(changed(model.device, {"stage.half_stage_stiffness": 1.0001 * k}))
    z = trace.z.copy()
    for i in range(len(z)):  # dz = -dg / (dg/dz), one axis at a time
        balance = [
            m.dynamics(trace.x[i], trace.z[i], found.solution.drive[i], [])[1].full().ravel() for m in (model, other)
        ]
        shifted = [other.dynamics(trace.x[i], trace.z[i] + 1e-9, found.solution.drive[i], [])[1].full().ravel()][0]
        z[i] -= 1e-9 * balance[1] / (shifted - balance[1])
    expected = (z - trace.z) / 1e-4 * 0.05
    np.testing.assert_allclose(found.combined, np.abs(expected), atol=1e-3 * np.abs(expected).max())


def test_a_sensor_by_which_drives_were_learnt_counts_with_its_scale_and_zero(circle, tmp_path):
    """0.1 % of 20 um in delta_z and of 10 um in delta_x at its farthest, beside a zero of 5 nm; 1000 draws tell it to 7 %."""
    text = '[sensor]\nscale = { sd = "0.1 %", source = "data sheet" }\n'
    text += '[sensor.zero]\ndelta_x = { sd = "5 nm", source = "drift" }\n'
    found = budget_of(circle, stated(circle, text, tmp_path), draws=1000)
    assert found.combined[:, 5] == pytest.approx(20e-9, rel=1e-6)
    assert found.combined[:, 3].max() == pytest.approx(np.hypot(10, 5) * 1e-9, rel=1e-3)
    assert {line.name for line in found.lines} == {"sensor.scale", "sensor.zero.delta_x"}
    assert found.drawn.pose.std(axis=0)[:, 5] == pytest.approx(20e-9, rel=0.07)
    wrong = (
        '[numbers]\n"actuator.yung" = { sd = "1 %", source = "s" }\n[sensor]\nscale = { sd = "-2 %", source = "s" }\n'
    )
    wrong += 'clock = { sd = "5 nm", source = "s" }\n[sensor.zero]\ndelta_q = { sd = "5 nm", source = "drift" }\n'
    with pytest.raises(InputError, match="is not a channel") as refused:
        stated(circle, wrong, tmp_path)
    where = {fault.where for fault in refused.value.faults}
    assert where == {'numbers."actuator.yung"', "sensor.scale.sd", "sensor.clock.sd", "sensor.zero.delta_q"}
    assert "stated.toml: 4 faults" in str(refused.value)  # of the file that states them, all at once

"""The error budget against devices whose numbers are changed and simulated, one by one and drawn at random."""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import ctrlgen
from conftest import DEVICES, SCENARIOS
from result_files import faults

from ctrlgen import (
    InputError,
    SolverError,
    build_model,
    error_budget,
    load_device,
    load_scenario,
    simulate,
    solve,
    user_device,
)
from ctrlgen.budget import monte_carlo
from ctrlgen.budget.budget_section import budget_section
from ctrlgen.budget.error_budget import agreement, budget_of
from ctrlgen.budget.finer_model import load_finer
from ctrlgen.budget.limits import DrawnLimits, Margins, Slopes, critical_samples, margins, slopes_of_limits
from ctrlgen.budget.linear import drive_deviations, propagate
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.budget.uncertainty import Uncertainties, load_uncertainties
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.player.compression import compress
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.trajectory.solution import Solution
from ctrlgen.verification.scenario_report import write_report

FILE = SCENARIOS / "circle20" / "uncertainty.toml"
TRANSLATIONS = slice(3, 6)


def driven(
    solution: Solution, numbers: dict[str, float], u: np.ndarray | None = None, warmer: float = 0.0
) -> np.ndarray:
    """The pose (n, 6) in the second of two periods of a device with other `numbers` under the drives of the solution, by the simulator,
    minus that of the device as described; `warmer` [K] is what the heaters then cool to."""
    drives = solution.drive if u is None else u
    device, h, n = solution.model.device, solution.scenario.sample_time, len(drives)
    R = dict(device.quantities())["actuator.thermal_resistance"].si
    poses = []
    for model, given in (
        (build_model(changed(device, numbers)), drives + warmer / R),  # R P = T - T_amb: as much as `warmer` heats
        (solution.model, solution.drive),
    ):
        trace = simulate(model, np.vstack([given, given]), h, solution.trace.x[0])
        poses.append(trace.signals["pose"][n : 2 * n])
    return poses[0] - poses[1]


def stated(solution: Solution, text: str, folder: Path) -> Uncertainties:
    """What `text` says is uncertain."""
    (folder / "stated.toml").write_text(f'title = "stated"\n{text}')
    return load_uncertainties(solution.scenario, solution.model, folder / "stated.toml")


def number(solution: Solution, path: str) -> float:
    return dict(solution.model.device.quantities())[path].si


@pytest.fixture(scope="module")
def budget(circle):
    """Of the circle with what is stated beside it."""
    return budget_of(circle, load_uncertainties(circle.scenario, circle.model), seed=1)


@pytest.fixture(scope="module")
def linear(circle):
    path = UncertainPath(circle, load_uncertainties(circle.scenario, circle.model))
    return propagate(path)


def largest_nm(deviation: np.ndarray) -> float:
    """The largest deviation of one of the three translations along the path."""
    return 1e9 * float(np.abs(deviation[:, TRANSLATIONS]).max())


# Figures measured on the circle with the drives of the device as described: the largest deviation of one translation.
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


@pytest.mark.parametrize("bits, known", [(12, 9), (16, 0.46)])
def test_a_converter_is_as_rough_as_measured(circle, tmp_path, bits, known):
    given = stated(circle, f'[drive]\nconverter = {{ bits = {bits}, source = "chosen" }}', tmp_path)
    found = budget_of(circle, given, draws=0)
    (line,) = found.lines
    lsb = circle.model.u_bounds[1] / (2**bits - 1)
    deviation = driven(circle, {}, np.round(circle.drive / lsb) * lsb)
    assert largest_nm(deviation) == pytest.approx(known, rel=0.05)
    assert 1e9 * line.sensitivity["translation"] == pytest.approx(largest_nm(deviation), rel=1e-3)
    # LSB/sqrt(12), independent from sample to sample: the rms along the path of one circle knows it to some per cent, and the drives'
    # neighbours on a slow circle are not quite independent
    rms = np.sqrt(np.mean(found.combined**2)), np.sqrt(np.mean(deviation**2))
    assert rms[0] == pytest.approx(rms[1], rel=0.15)


@pytest.mark.parametrize(
    "path",
    ["actuator.thermal_resistance", "actuator.ambient", "actuator.thickness", "stage.half_stage_stiffness", "hexapod.height",
     "hexapod.wire_diameter", "hexapod.base_angles[3]"],
)  # fmt: skip
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


@pytest.mark.long
def test_jitter_is_that_of_drives_that_change_late(circle, tmp_path, rng):
    sd, parts = 50e-6, 100  # s, steps of the simulation in a sample of 1 ms
    given = stated(circle, f'[drive]\njitter = {{ sd = "{sd} s", source = "chosen" }}', tmp_path)
    found = budget_of(circle, given, draws=0)
    u, n = circle.drive, len(circle.drive)
    late = rng.choice([0, 5, 10], n, p=[0.25, 0.5, 0.25])  # of 10 us: sd 35 us, mean 50 us
    before = np.roll(u, 1, axis=0)
    fine = np.concatenate(
        [np.vstack([np.tile(before[k], (late[k], 1)), np.tile(u[k], (parts - late[k], 1))]) for k in range(n)]
    )
    always = np.concatenate([np.vstack([np.tile(before[k], (5, 1)), np.tile(u[k], (parts - 5, 1))]) for k in range(n)])
    poses = [
        simulate(circle.model, drives, circle.scenario.sample_time / parts, circle.trace.x[0]).signals["pose"][
            : n * parts : parts
        ]
        for drives in (fine, always)
    ]
    rms = np.sqrt(np.mean((poses[0] - poses[1])[100:] ** 2, axis=0)) / np.std(10e-6 * np.array([0, 5, 5, 10]))
    expected = np.sqrt(np.mean(found.combined**2, axis=0)) / sd
    # the mean drive of a sample stands for its late change: exp(-a) a/(1 - exp(-a)) = 0.90 of it at a = h/tau = 0.2
    np.testing.assert_allclose(expected[TRANSLATIONS][:2], rms[TRANSLATIONS][:2], rtol=0.2)
    assert np.all(expected[TRANSLATIONS][:2] > rms[TRANSLATIONS][:2])


def lagging(folder: Path, uncertain: str) -> tuple[Solution, Uncertainties]:
    """Two heaters a and b with a lag of 100 ms, x = g (A + B)/k and y = g (A - B)/k; both powers step from 0 to 10 W in the fifth sample
    of 1 ms and stay, so that each state is 10 W (1 - e^-t/tau)."""
    device = user_device(
        "pair", parameters={"g": "0.2 N/W", "k": "1 N/um", "tau": "100 ms"}, drive={"a": "20 W", "b": "20 W"},
        axes={"x": "50 um", "y": "50 um"}, state={"A": "20 W", "B": "20 W"},
        force=lambda x, p: [p.g * (x.A + x.B), p.g * (x.A - x.B)], restoring_force=lambda d, p: p.k * d.vector,
        rates=lambda u, x, p: [(u.a - x.A) / p.tau, (u.b - x.B) / p.tau],
    )  # fmt: skip
    risen = 10 * -np.expm1(-np.maximum(np.arange(40) - 4, 0) * 1e-3 / 0.1)
    points = ", ".join(f'{{ x = "{0.4 * float(v)!r} um" }}' for v in risen)
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "pair"\nsample_rate = "1 kHz"\n[path]\nkind = "poses"\npoints = [{points}]\n'
    )
    (folder / "uncertainty.toml").write_text(f'title = "u"\n{uncertain}')
    scenario = load_scenario(folder, device)
    solution = solve(scenario, build_model(device))
    return solution, load_uncertainties(scenario, solution.model)


def test_a_step_that_comes_late_leaves_both_heaters_behind_together(tmp_path):
    """Late by dt, a state that rises by V lacks V dt/tau, which decays with tau; x lacks what both do, y nothing, because one clock
    delays both. 1 %: the drive is taken as late by its mean over the sample, h/2 tau. Of 3000 draws the sd is known to 1.3 %."""
    solution, given = lagging(tmp_path, '[drive]\njitter = { sd = "50 us", source = "chosen" }')
    assert solution.drive[[3, 4, 30]] == pytest.approx(np.array([[0, 0], [10, 10], [10, 10]]), abs=1e-6)
    found = budget_of(solution, given, draws=3000)
    since = np.arange(40) - 5  # the first sample that the step reaches
    lacking = np.where(since < 0, 0.0, 2 * 0.2e-6 * 10 * 50e-6 / 0.1 * np.exp(-since * 1e-3 / 0.1))
    assert found.combined[:, 0] == pytest.approx(lacking, rel=0.01, abs=1e-15)
    assert np.abs(found.combined[:, 1]).max() < 1e-6 * lacking.max()
    drawn = found.drawn.pose.std(axis=0)
    assert drawn[:, 0] == pytest.approx(lacking[found.drawn.kept], rel=0.05, abs=1e-15)
    assert drawn[:, 1].max() < 1e-6 * lacking.max()


def pushed(folder: Path, uncertain: str, micrometres=(10.0, 20.0)) -> tuple[Solution, Uncertainties]:
    """One axis in balance, x = g u/k with 0.2 um/V and drives of -1000 to 1000 V, at some separate positions."""
    device = user_device(
        "axis", parameters={"g": "0.2 N/V", "k": "1 N/um"}, drive={"a": "1000 V"}, axes={"x": "100 um"},
        force=lambda u, p: [p.g * u.a], restoring_force=lambda d, p: p.k * d.vector,
    )  # fmt: skip
    points = ", ".join(f'{{ x = "{x} um" }}' for x in micrometres)
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "axis"\n[path]\nkind = "poses"\npoints = [{points}]\n'
    )
    (folder / "uncertainty.toml").write_text(f'title = "u"\n{uncertain}')
    scenario = load_scenario(folder, device)
    solution = solve(scenario, build_model(device))
    return solution, load_uncertainties(scenario, solution.model)


def test_a_converter_of_four_bits_has_sixteen_levels_from_limit_to_limit(tmp_path):
    """-1000 to 1000 V in 15 steps, none of them at 0 V; each drive is taken to the nearest, and the error is uniform over one step. The
    sd of 4000 draws is known to 1 %."""
    solution, given = pushed(
        tmp_path, '[drive]\nconverter = { bits = 4, source = "chosen" }', np.linspace(-90.0, 90.0, 19)
    )
    levels = np.linspace(-1000, 1000, 16)
    path = UncertainPath(solution, given)
    nearest = levels[np.argmin(np.abs(path.drive - levels), axis=1)]
    assert path.rounded()[:, 0] == pytest.approx(nearest) and path.lsb() == pytest.approx(2000 / 15)
    found = budget_of(solution, given, draws=4000)
    step = 0.2e-6 * 2000 / 15
    assert found.combined == pytest.approx(np.full((19, 1), step / np.sqrt(12)))
    off = found.drawn.pose
    assert 0.49 * step < np.abs(off).max() <= 0.5 * step * (1 + 1e-6)
    assert off.std() == pytest.approx(step / np.sqrt(12), rel=0.04)


def test_drives_in_single_precision_are_off_by_what_numpys_are(circle, tmp_path):
    """Root mean square over 6000 drives that follow no binary pattern: their rounding to float32 is known to 1 % of its size."""
    path = UncertainPath(circle, stated(circle, '[drive]\narithmetic = "float"', tmp_path))
    sd, together = drive_deviations(path, "arithmetic")
    rounding = path.drive.astype(np.float32) - path.drive
    assert not together and np.sqrt(np.mean(rounding**2)) == pytest.approx(np.sqrt(np.mean(sd**2)), rel=0.04)


def test_draws_are_correlated_as_stated(tmp_path):
    """x = g u/k, shares of 1 % each with the coefficient -0.6: sqrt(1 + 1 + 2 * 0.6) %. 4000 draws tell it to 1 %."""
    both = "".join(f'"mechanism.{name}" = {{ sd = "1 %", source = "chosen" }}\n' for name in "gk")
    between = '[[correlation]]\nbetween = ["mechanism.g", "mechanism.k"]\ncoefficient = -0.6\nsource = "chosen"\n'
    found = budget_of(*pushed(tmp_path, f"[numbers]\n{both}{between}"), draws=4000)
    expected = np.sqrt(3.2) * 0.01 * np.array([[10e-6], [20e-6]])
    assert found.combined == pytest.approx(expected, rel=1e-6)
    assert found.drawn.pose.std(axis=0) == pytest.approx(expected, rel=0.04)


def test_draws_and_first_order_agree(budget):
    assert len(budget.agreements) == 2 and all(a.passed for a in budget.agreements) and budget.reasons == ()
    for a in budget.agreements:
        assert a.drawn == pytest.approx(a.linear, rel=0.1) and 0 < a.difference < 0.1


def test_replayed_drives_are_within_what_is_counted_for_the_player(circle, tmp_path):
    """The drives that the player's C computes, simulated for two laps; and draws that are uniform within the tolerance."""
    given = stated(circle, "[drive]\nplayer = true", tmp_path)
    found = budget_of(circle, given, draws=2000)
    (line,) = found.lines
    played = compress(circle)[Real.FLOAT].drives(np.arange(len(circle.drive)))
    deviation = driven(circle, {}, played)
    off = {g.name: np.abs(deviation[:, g.channels]) for g in found.groups}
    tolerances = {"translation": 1e-10, "rotation": 1e-8}  # docs/player.md
    for name, a in tolerances.items():
        assert line.sensitivity[name] == pytest.approx(a) and line.peak[name] == pytest.approx(a / 3**0.5)
        assert 0 < off[name].max() < a
        assert np.sqrt(np.mean(off[name] ** 2, axis=0)).max() < line.rms[name]  # a bound
    assert off["translation"].max() > 0.01 * tolerances["translation"]  # the tables are no better than they must be
    drawn = found.drawn.pose[:, :, TRANSLATIONS]
    assert np.abs(drawn).max() < 1.001e-10 + 1e-12 and drawn.std() == pytest.approx(1e-10 / 3**0.5, rel=0.01)
    assert all(s.sd == 0 for s in found.safeties)


def test_a_draw_is_a_simulated_device(circle, budget):
    given = budget.uncertainties
    columns = [(line.kind, p) for line in given.lines for p in line.paths]
    drawn = budget.drawn.columns[3]
    numbers = {p: number(circle, p) + d for (kind, p), d in zip(columns, drawn, strict=True) if kind == "number"}
    gain = 1 + sum(d for (kind, _), d in zip(columns, drawn, strict=True) if kind == "gain")
    gains = gain + np.array([d for (kind, _), d in zip(columns, drawn, strict=True) if kind == "channel gain"])
    (warmer,) = (d for (kind, _), d in zip(columns, drawn, strict=True) if kind == "surroundings")
    R = numbers["actuator.thermal_resistance"]
    u = circle.drive * gains + warmer / R
    deviation = driven(circle, numbers, u)[budget.drawn.kept]
    off = np.abs(budget.drawn.pose[3] - deviation).max(axis=0)
    scatter = np.sqrt(sum(sd**2 for sd in budget.linear.scatter["pose"].values())).max(axis=0)
    # Converter and jitter are drawn anew
    assert np.all(off < 5 * scatter) and np.all(np.abs(deviation).max(axis=0) > 20 * scatter)


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


def two_axes(folder: Path) -> Scenario:
    """Four poses round a circle of 10 um, of a stage of two equal axes whose gains are known to 4 %."""
    stage = user_device(
        "stage", parameters={"g_x": "0.2 N/V", "g_y": "0.2 N/V", "k": "1 N/um"}, drive={"x": "1000 V", "y": "1000 V"},
        axes={"x": "50 um", "y": "50 um"}, force=lambda u, p: [p.g_x * u.x, p.g_y * u.y], restoring_force=lambda d, p: p.k * d.vector,
    )  # fmt: skip
    (folder / "scenario.toml").write_text(
        'title = "round"\ndevice = "stage"\n[path]\nkind = "poses"\n'
        'points = [{ x = "10 um" }, { y = "10 um" }, { x = "-10 um" }, { y = "-10 um" }]\n'
    )
    (folder / "uncertainty.toml").write_text(
        'title = "t"\n[numbers]\n' + "".join(f'"mechanism.g_{a}" = {{ sd = "4 %", source = "s" }}\n' for a in "xy")
    )
    return load_scenario(folder, stage)


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
        "axis", parameters={"k": "1 N/um", "c": "1e12 Pa/m"}, drive={"a": "100 N"}, axes={"x": "50 um"}, force=lambda u: [u.a],
        restoring_force=lambda d, p: p.k * d.vector, limits={"stress": (lambda d, p: p.c * d.x, "22 MPa")},
    )  # fmt: skip
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "axis"\n[path]\nkind = "poses"\npoints = [{ x = "20 um" }]\n'
    )
    (tmp_path / "uncertainty.toml").write_text(
        'title = "u"\n[numbers]\n"mechanism.c" = { sd = "5 %", source = "chosen" }\n'
    )
    scenario = load_scenario(tmp_path, device)
    solution = solve(scenario, build_model(device))
    found = budget_of(solution, load_uncertainties(scenario, solution.model), probability=0.99, draws=4000)
    (stress,) = (s for s in found.safeties if s.limit.name == "stress" and s.side == "upper")
    assert stress.margin == pytest.approx(2e6) and stress.sd == pytest.approx(1e6, rel=1e-6)
    assert stress.probability == pytest.approx(0.97725, abs=1e-5) and stress.kept == pytest.approx(-0.3263e6, rel=1e-3)
    assert found.broken == pytest.approx(0.0228, abs=0.007)
    assert stress.drawn == pytest.approx(stress.kept, abs=0.15e6)  # forty draws lie beyond the quantile


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
    with pytest.raises(SolverError, match="draws ended in no number"):
        budget_of(circle, stated(circle, text, tmp_path), draws=1000)


@pytest.mark.parametrize(
    "name, path, step",
    [("flexure_axis_line", "mechanics.stiffness", 1e-5), ("flexure_axis_line", "mechanics.mass", 1e-5),
     ("lever_circle", "actuator[1].stiffness", 1e-4), ("mirror_spiral", "actuator[0].gain", 1e-4)],
)  # fmt: skip
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
    found = linear.sensitivity["pose"][:, :, columns.index(path)]
    assert np.abs(slope).max() > 0
    np.testing.assert_allclose(found, slope, atol=2e-4 * np.abs(slope).max())


def test_an_actuator_that_loses_strength_has_lost_as_much_when_the_path_begins_as_for_the_solver(tmp_path):
    """The strength falls by 5 % within a second of the start of the path, x = s(t) g u/k: what is known exactly follows the command, the
    sensitivity to a share of g is the displacement, and a finer model that is the same device moves no otherwise."""
    device = user_device(
        "axis", parameters={"g": "0.2 N/V", "k": "1 N/um"}, drive={"a": "1000 V"}, axes={"x": "100 um"},
        force=lambda u, p: [p.g * u.a], restoring_force=lambda d, p: p.k * d.vector,
        effect=[{"kind": "degradation", "at": "a", "rate": "0.1 1/s", "levels_off": "0.5 s"}],
    )  # fmt: skip
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


def test_every_fault_is_named_at_once(circle, tmp_path):
    bad = """
    [numbers]
    "actuator.yung" = { sd = "1 %", source = "a" }
    "actuator.beams" = { sd = "1", source = "a" }
    "actuator.ambient" = { sd = "1 %", source = "a" }
    "actuator.thickness" = { sd = "1 N", source = "a" }
    "actuator.young" = { sd = "-1 %", source = "a" }
    "hexapod.base_angles[*]" = { sd = "1 mrad", source = "a" }
    "hexapod.base_angles[1]" = { sd = "1 mrad", source = "a" }
    [drive]
    jitter = { sd = "1 um", source = "a" }
    gain = { sd = "1 V", source = "a" }
    [[correlation]]
    between = ["actuator.young", "actuator.poison"]
    coefficient = 0.5
    source = "a"
    """
    with pytest.raises(InputError) as caught:
        stated(circle, bad, tmp_path)
    text = str(caught.value)
    for said in (
        "did you mean 'actuator.young'", "is a count", "does not count from a zero of its own", "thickness\".sd: '1 N' has the wrong unit",
        "must be above zero", "states hexapod.base_angles[1] again", "drive.jitter.sd: '1 um'", "drive.gain.sd: '1 V'", "'actuator.poison'",
    ):  # fmt: skip
        assert said in text, said


@pytest.mark.parametrize(
    "scenario, text, said",
    [
        ("circle20", '[numbers]\n"actuator.heater_resistance" = { sd = "1 %", source = "a" }', "acts on neither motion nor limits"),
        ("xy_stage_force", '[drive]\njitter = { sd = "1 us", source = "a" }', "row of equilibria"),
        ("mirror_spiral", '[surroundings]\nsd = "1 K"\nsource = "a"', "act on nothing"),
        ("circle20", "[drive]\nplayer = 3", "drive.player"),
        ("circle20", "[drive]\nplayer = false", "is not stated of anything"),
        ("circle20", "", "is not stated of anything"),
        ("circle20", '[number]\n"a" = 1', "number: is not a key I know; did you mean 'numbers'?"),
        ("circle20", '[drive]\nconverter = { bits = 3, source = "a" }', "drive.converter.bits"),
        ("circle20", '[numbers]\n"actuator.young" = { sd = "1 %" }', "source: is missing"),
    ],
)  # fmt: skip
def test_what_means_nothing_is_refused(tmp_path, scenario, text, said):
    (tmp_path / "stated.toml").write_text(f'title = "t"\n{text}\n')
    with pytest.raises(InputError) as caught:
        error_budget(SCENARIOS / scenario, tmp_path / "stated.toml", draws=0)
    assert said in str(caught.value)


def test_a_share_of_a_negative_number_is_a_standard_deviation_above_zero(tmp_path):
    """5 % of -3 um are 0.15 um: where it stands in a correlation, its sign is that which was stated."""
    device = user_device(
        "axis", parameters={"k": "1 N/um", "rest": "-3 um"}, drive={"a": "100 N"}, axes={"x": "50 um"},
        force=lambda u: [u.a], restoring_force=lambda d, p: [p.k * (d.x - p.rest)],
    )  # fmt: skip
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "axis"\n[path]\nkind = "poses"\npoints = [{ x = "1 um" }]\n'
    )
    (tmp_path / "uncertainty.toml").write_text(
        'title = "u"\n[numbers]\n"mechanism.rest" = { sd = "5 %", source = "chosen" }\n'
    )
    assert load_uncertainties(load_scenario(tmp_path, device), build_model(device)).sds == pytest.approx([0.15e-6])


def test_coefficients_that_no_deviations_have_are_refused(circle, tmp_path):
    names = ("actuator.young", "actuator.thickness", "actuator.beam_width")
    text = "[numbers]\n" + "".join(f'"{name}" = {{ sd = "1 %", source = "a" }}\n' for name in names)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        text += f'[[correlation]]\nbetween = ["{names[i]}", "{names[j]}"]\ncoefficient = -0.9\nsource = "a"\n'
    with pytest.raises(InputError, match="contradict one another"):
        stated(circle, text, tmp_path)


@pytest.mark.parametrize("given", [{"probability": 1.0}, {"probability": 0.1}, {"draws": 3}])
def test_a_probability_or_a_number_of_draws_that_means_nothing(given):
    with pytest.raises(InputError, match=next(iter(given))):
        error_budget(SCENARIOS / "circle20", **given)


def test_the_sds_of_a_device_file_count_and_the_file_replaces_them(tmp_path):
    scenario = load_scenario(SCENARIOS / "flexure_axis_line")
    model = build_model(scenario.device)
    own = {line.name: line.sds[0] for line in load_uncertainties(scenario, model).lines}
    assert own == {path: q.sd for path, q in scenario.device.quantities() if q.sd}
    (tmp_path / "s.toml").write_text('title = "t"\n[numbers]\n"mechanics.mass" = { sd = "1 g", source = "weighed" }\n')
    replaced = {line.name: line.sds[0] for line in load_uncertainties(scenario, model, tmp_path / "s.toml").lines}
    assert replaced == own | {"mechanics.mass": pytest.approx(0.001)}


@pytest.mark.long
def test_the_command_leaves_page_record_and_figures(tmp_path):
    done = ctrlgen(
        "budget",
        SCENARIOS / "circle20",
        "--out",
        tmp_path / "b",
        "--draws",
        "400",
        "--probability",
        "99 %",
        "--seed",
        "3",
    )
    assert done.returncode == 0, done.stderr
    record = json.loads((tmp_path / "b" / "budget.json").read_text())
    assert faults(record, "budget") == [] and record["seed"] == 3 and record["probability"] == pytest.approx(0.99)
    assert (
        "keeps 550 degC with 99 %: margin" in done.stdout
        and "next: halve the sd of actuator.thermal_resistance" in done.stdout
    )
    names = [entry["name"] for entry in record["contributors"]]
    assert set(tomllib.loads(FILE.read_text())["numbers"]) < set(names)
    page = (tmp_path / "b" / "budget.html").read_text()
    assert all(name in page for name in names) and page.count("<svg") == 2
    assert "uncertainty" in record["inputs"]
    again = ctrlgen(
        "budget",
        SCENARIOS / "circle20",
        "--out",
        tmp_path / "c",
        "--draws",
        "400",
        "--probability",
        "0.99",
        "--seed",
        "3",
    )
    assert again.returncode == 0 and json.loads((tmp_path / "c" / "budget.json").read_text()) == record


@pytest.mark.long
def test_the_command_states_the_difference_to_a_finer_model(tmp_path):
    text = (SCENARIOS / "devices" / "mems_hexapod.toml").read_text()
    (tmp_path / "finer.toml").write_text(text.replace('"550 K/W', '"551 K/W'))
    done = ctrlgen(
        "budget", SCENARIOS / "circle20", "--finer", tmp_path / "finer.toml", "--draws", "0", "--out", tmp_path / "b"
    )
    assert done.returncode == 0, done.stderr
    assert "model difference" in done.stdout
    record = json.loads((tmp_path / "b" / "budget.json").read_text())
    assert faults(record, "budget") == [] and "finer" in record["inputs"]
    entry = record["model_difference"]
    z = np.array(entry["deviation"]["delta_z [nm]"])
    # Hotter: it pushes farther
    assert entry["kind"] == "model difference" and len(z) == record["samples"] and z.min() > 0
    assert (
        entry["effects"][0]["peak"] >= z.max()
        and "stands beside the band" in (tmp_path / "b" / "budget.html").read_text()
    )
    other = ctrlgen("budget", SCENARIOS / "circle20", "--finer", SCENARIOS / "devices" / "flexure_axis.toml")
    assert other.returncode == 1 and "describe the same device" in " ".join(other.stderr.split())


def test_the_command_refuses_what_it_cannot_read(tmp_path):
    assert "is not a probability" in ctrlgen("budget", SCENARIOS / "circle20", "--probability", "often").stderr
    assert "does not exist" in ctrlgen("budget", SCENARIOS / "circle20", "--uncertainty", tmp_path / "none.toml").stderr


def test_the_help_shows_the_sections_of_the_file():
    """Square brackets are markup to the library that prints the help."""
    text = ctrlgen("budget", "--help").stdout
    assert all(f"[{name}]" in text for name in ("numbers", "surroundings", "drive"))


@pytest.mark.long
def test_the_report_of_a_solution_holds_the_budget_to_first_order(circle, tmp_path):
    """The numbers are those of the budget by itself, whose own are proved above."""
    section = budget_section(circle)
    whole = budget_of(circle, load_uncertainties(circle.scenario, circle.model), draws=0)
    write_report(tmp_path, circle, None, (), None, {}, section)
    page = " ".join((tmp_path / "report.html").read_text().split())
    for g in whole.groups:
        assert f"± {g.shown(whole.factor * whole.peak(g)):.4g} {g.unit} ({g.name})" in page
    first, hidden = whole.lines[0], whole.lines[-1]
    assert f"<code>{first.name}</code>" in page and f"{1e9 * first.peak['translation']:.3g}" in page
    assert f'<code>{hidden.name}</code></td><td class="n">{hidden.sd}' not in page
    assert "keeps 550 degC with 99.9 %: margin" in page and "<code>ctrlgen budget</code> gives the whole" in page
    assert section.shown()["sources"]["uncertainty"] in page


def test_what_the_budget_cannot_do_is_a_sentence_of_the_report(circle, tmp_path):
    (tmp_path / "uncertainty.toml").write_text(
        'title = "t"\n[numbers]\n"actuator.yung" = { sd = "1 %", source = "a" }\n'
    )
    moved = replace(circle, scenario=replace(circle.scenario, path=tmp_path / "scenario.toml"))
    section = budget_section(moved)
    assert section.budget is None
    write_report(tmp_path / "out", moved, None, (), None, {}, section)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "The error budget is not drawn up: " in page and "did you mean &#39;actuator.young&#39;" in page


def test_a_report_of_what_is_known_exactly_has_no_budget(circle, tmp_path):
    moved = replace(circle, scenario=replace(circle.scenario, path=tmp_path / "scenario.toml"))
    assert budget_section(moved) is None
    write_report(tmp_path / "out", moved, None, (), None, {}, None)
    assert "Error budget" not in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.long
@pytest.mark.parametrize(
    "name, path, share",
    [("circle20", "actuator.thermal_resistance", 0.01), ("circle20", "actuator.time_constant", 0.01),
     ("flexure_axis_line", "mechanics.stiffness", 0.001), ("xy_stage_force", "stage.half_stage_stiffness", 0.01)],
)  # fmt: skip
def test_a_finer_model_of_one_other_number_differs_by_its_sensitivity(circle, tmp_path, name, path, share):
    """A closed path, an open one of a stage with inertia, and a row of equilibria; with its sign, sample by sample."""
    scenario = load_scenario(SCENARIOS / name)
    model = build_model(scenario.device)
    solution = circle if name == "circle20" else solve(scenario, model)
    step = share * number(solution, path)
    other = load_finer(scenario, model, changed(scenario.device, {path: number(solution, path) + step}))
    text = f'[numbers]\n"{path}" = {{ sd = "5 %", source = "chosen" }}'
    (uncertain,) = (line for line in stated(solution, text, tmp_path).lines if line.name == path)
    alone = Uncertainties((uncertain,), np.eye(1), None, 0.0, False, {}, {}, {})
    found = budget_of(solution, alone, draws=0, finer=other)
    expected = step * found.linear.sensitivity["pose"][:, :, 0]
    for g in found.groups:
        largest = np.abs(expected[:, g.channels]).max()
        off = np.abs(found.model_difference.deviation - expected)[:, g.channels].max()
        assert off < 0.01 * largest, g.name  # the second order of a step of one per cent
        assert found.difference_peak(g) == pytest.approx(largest, rel=0.01)
        assert found.difference_rms(g) == pytest.approx(
            np.sqrt(np.mean(expected[:, g.channels] ** 2, axis=0)).max(), rel=0.01
        )
        assert found.peak(g) == pytest.approx(uncertain.sds[0] / step * largest, rel=1e-9)  # not combined


def test_a_finer_model_with_inertia_repeats_on_a_closed_path(tmp_path):
    """The reference is the simulator after so many periods of the held drives that the start is forgotten."""
    points = ", ".join(f'{{ axis = "{5 * math.sin(2 * math.pi * k / 50)!r} um" }}' for k in range(50))
    (tmp_path / "scenario.toml").write_text(
        f'title = "t"\ndevice = "{SCENARIOS / "devices" / "flexure_axis.toml"}"\nsample_rate = "1 kHz"\n'
        f'[path]\nkind = "poses"\nperiodic = true\npoints = [{points}]\n'
    )
    scenario = load_scenario(tmp_path)
    model = build_model(scenario.device)
    solution = solve(scenario, model)
    assert scenario.closed and model.inertial
    finer = load_finer(
        scenario, model, changed(scenario.device, {"mechanics.mass": 1.01 * number(solution, "mechanics.mass")})
    )
    found = budget_of(solution, load_uncertainties(scenario, model), draws=0, finer=finer).model_difference.deviation
    n, periods = len(solution.drive), 200  # 10 s: the mode of 100 Hz decays in less than one
    poses = [
        simulate(m, np.tile(solution.drive, (periods, 1)), scenario.sample_time).signals["pose"][-n - 1 : -1]
        for m in (finer.model, model)
    ]
    np.testing.assert_allclose(found, poses[0] - poses[1], atol=1e-6 * np.abs(found).max())


def test_a_finer_model_of_another_device_is_refused(circle, tmp_path):
    scenario, model = circle.scenario, circle.model
    with pytest.raises(InputError) as caught:
        load_finer(scenario, model, SCENARIOS / "devices" / "flexure_axis.toml")
    assert [fault.where for fault in caught.value.faults] == ["drive", "pose"]
    assert "describe the same device" in str(caught.value) and "flexure_axis.toml: 2 faults" in str(caught.value)

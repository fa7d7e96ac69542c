"""Paths whose limits hold for what is not known exactly: against closed forms of one axis, draws and simulations of devices with other
numbers, and a search over the null motion by scipy."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from command_line import ctrlgen as command
from conftest import SCENARIOS
from result_files import faults
from robust_paths import EXAMPLE, RISK, SD, STROKE, along, axis, without
from scipy.optimize import minimize
from scipy.signal import cont2discrete
from scipy.stats import norm

import ctrlgen
from ctrlgen import Unreachable, build_model, load_scenario, solve
from ctrlgen.budget.chance_constraint import ChanceConstraint
from ctrlgen.budget.error_budget import budget_of
from ctrlgen.budget.limits import Margins
from ctrlgen.budget.uncertainty import load_uncertainties
from ctrlgen.trajectory.scenario_file import Robust


# d = g u/k: to first order a share s of the stiffness makes the same share of the displacement, so y (1 + z s) is all that is kept.
@pytest.mark.parametrize("missing", [-0.01, 0.01])
def test_one_axis_may_go_as_far_as_the_closed_form_says(tmp_path, missing):
    farthest = 1e6 * STROKE / (1 + norm.isf(RISK) * SD)
    scenario = along(tmp_path, [5.0, farthest + missing], axis())
    if missing < 0:
        found = solve(scenario, build_model(scenario.device))
        (stroke,) = (limit for limit in found.model.limits if limit.name == "travel_x")
        # as much as is kept where it goes farthest; the range is symmetrical, and it rests in the middle
        assert stroke.upper == pytest.approx(1e-6 * (farthest + missing), abs=2e-8)
        assert stroke.upper + stroke.reserve[1] == pytest.approx(STROKE, abs=1e-12)
        assert found.scenario.inputs["uncertainty"].path == tmp_path / "uncertainty.toml"
    else:
        with pytest.raises(
            Unreachable, match=r"cannot keep all limits with 99.9 %, in 1 of 2 samples; they are kept with 99.9 %"
        ):
            solve(scenario, build_model(scenario.device))


def test_an_explanation_says_what_is_missing_and_what_could_be_had(tmp_path):
    scenario = along(tmp_path, [5.0, 46.0], axis())
    with pytest.raises(Unreachable) as told:
        solve(scenario, build_model(scenario.device))
    beta, taken = 4.0 / (46 * SD), norm.isf(RISK) * 46 * SD
    text = str(told.value)
    assert f"they are kept with {100 * norm.cdf(beta):.3g} %" in text
    assert "46 um at sample 1 is 4 um below 50 um" in text and f"takes {taken:.4g} um there" in text
    assert f"short by {taken - 4:.4g} um" in text and "scaled to" in text
    assert told.value.infeasibility.samples == (1,) and told.value.infeasibility.worst == 1
    # what it says is true: at a little less than that probability the path is kept, at a little more it is not
    for probability, kept in ((norm.cdf(beta) - 1e-4, True), (norm.cdf(beta) + 1e-4, False)):
        other = along(tmp_path, [5.0, 46.0], axis(), probability=f'"{float(probability)!r}"')
        if kept:
            assert solve(other, build_model(other.device)).model.probability == pytest.approx(probability)
        else:
            with pytest.raises(Unreachable):
                solve(other, build_model(other.device))


def test_a_path_that_may_be_moved_is_where_the_error_is_least(tmp_path):
    # the error is a share of the displacement: it is least at the lower end, where y (1 - z s) meets it
    device = axis(x=("10 um", "50 um"))
    scenario = along(tmp_path, [30.0, 31.0], device, home='home = ["x"]\n')
    found = solve(scenario, build_model(device))
    lowest = 10 / (1 - norm.isf(RISK) * SD)
    # it keeps a hundredth more of the standard uncertainty that it has where it is described
    assert 30 + 1e6 * found.scenario.home["x"] == pytest.approx(lowest, abs=0.02 * 31 * SD)
    assert 30 + 1e6 * found.scenario.home["x"] > lowest
    assert found.command[:, 0] == pytest.approx(np.array([30e-6, 31e-6]) + found.scenario.home["x"])


def test_no_bound_is_moved_past_what_the_path_itself_needs(tmp_path):
    """x = 40 um + g u/k with g known to 37 %: at 0 um, far from where the drive is zero, 45.7 of the 50 um to the end are taken, at 41 um
    1.1 um of 9. The controller's bound comes down to 41 um, where the path goes, not to 4.3 um."""
    device = ctrlgen.user_device(
        "axis",
        parameters={"g": "0.2 N/V", "k": "1 N/um", "rest": "40 um"},
        drive={"a": "1000 V"},
        axes={"x": "50 um"},
        force=lambda u, p: [p.g * u.a],
        restoring_force=lambda d, p: [p.k * (d.x - p.rest)],
    )
    scenario = along(tmp_path, [0.0, 41.0], device)
    (tmp_path / "uncertainty.toml").write_text(
        'title = "u"\n[numbers]\n"mechanism.g" = { sd = "37 %", source = "chosen" }\n'
    )
    found = solve(scenario, build_model(device))
    (stroke,) = (limit for limit in found.model.limits if limit.name == "travel_x")
    assert stroke.upper == pytest.approx(41e-6, abs=1e-9) and stroke.reserve[1] == pytest.approx(9e-6, abs=1e-9)
    assert min(margin.distance for margin in found.margins) > -1e-12


def test_all_limits_together_have_the_probability(tmp_path):
    """Four axes of one risk each share it: 1 - p = 4 (1 - Phi(beta))."""
    device = ctrlgen.user_device(
        "axis",
        parameters={f"k{i}": "1 N/um" for i in range(4)},
        drive={f"u{i}": "1000 N" for i in range(4)},
        axes={f"x{i}": "50 um" for i in range(4)},
        force=lambda u, p: [u.u0, u.u1, u.u2, u.u3],
        restoring_force=lambda d, p: [p.k0 * d.x0, p.k1 * d.x1, p.k2 * d.x2, p.k3 * d.x3],
    )
    for beyond in (-0.01, 0.01):
        far = 1e6 * STROKE / (1 + norm.isf(RISK / 4) * SD) + beyond
        point = ", ".join(f'x{i} = "{float(far)!r} um"' for i in range(4))
        (tmp_path / "scenario.toml").write_text(
            'title = "t"\ndevice = "axis"\nfollow = "displacement"\n[robust]\nprobability = "99.9 %"\n[path]\nkind = "poses"\n'
            f"points = [{{ {point} }}]\n"
        )
        (tmp_path / "uncertainty.toml").write_text(
            'title = "u"\n[numbers]\n'
            + "".join(f'"mechanism.k{i}" = {{ sd = "5 %", source = "s" }}\n' for i in range(4))
        )
        scenario = load_scenario(tmp_path, device)
        if beyond < 0:
            solve(scenario, build_model(device))
        else:
            with pytest.raises(Unreachable, match="cannot keep all limits"):
                solve(scenario, build_model(device))


def test_what_scatters_has_a_tenth_of_the_risk_shared_by_samples_and_limits():
    """Two limits at 50 samples, 90 %: z_s of 0.1 * 0.1/(2 * 50), each lasting risk half of 0.09; just kept and just not, and of draws
    that have just that margin fewer than a tenth break one: a 25th, since z_s u_s is added at every sample (not far too large: 2 %)."""
    n, lasting, scattered = 50, 2.0, 0.5
    edge = norm.isf(0.09 / 2) * lasting + norm.isf(0.01 / 100) * scattered
    ones = np.ones((2, n, 1))
    bounds = np.array([[-1.0], [1.0]])

    def at(margin):
        return ChanceConstraint(Margins(margin * ones, lasting * ones, scattered * ones[0], bounds), 0.9)

    assert at(1.0001 * edge).holds and not at(0.9999 * edge).holds
    assert at(edge).possible == pytest.approx(0.9, abs=1e-9)
    rng = np.random.default_rng(5)
    y = lasting * rng.standard_normal((20_000, 1)) + scattered * rng.standard_normal((20_000, n))
    assert 0.02 < np.mean((np.abs(y) > edge).any(axis=1)) < 0.1


def redundant():
    """Three stacks on two axes, each with a gain of its own."""
    return ctrlgen.user_device(
        "axis",
        parameters={"a": "0.2 N/V", "b": "0.1 N/V", "c": "0.2 N/V", "k": "1 N/um"},
        drive={"u": ("-200 V", "200 V"), "v": ("-200 V", "200 V"), "w": ("-200 V", "200 V")},
        axes={"x": "50 um", "y": "50 um"},
        force=lambda u, p: [p.a * u.u + p.b * u.v, p.c * u.w - p.b * u.v],
        restoring_force=lambda d, p: p.k * d.vector,
    )


def test_a_stage_with_inertia_reserves_what_its_swinging_takes():
    """The move of the flexure axis, shorter than half a period: what mass, damping, stiffness and motor are off by makes it swing. Against
    scipy's exact discretisation of m a + c v + k d = k_f u with each number changed; a difference of 2 % of an sd: to first order."""
    scenario = load_scenario(SCENARIOS / "flexure_axis_line")
    asked = Robust(probability="99.9 %")
    scenario = replace(scenario, file=scenario.file.model_copy(update={"robust": asked, "expect": ()}))
    found = solve(scenario, build_model(scenario.device))
    number = {path: q for path, q in scenario.device.quantities() if q.sd}
    assert len(number) == 4

    def displaced(changes: dict[str, float]) -> np.ndarray:
        m, c, k, g = (
            number[path].si + changes.get(path, 0.0)
            for path in ("mechanics.mass", "mechanics.damping", "mechanics.stiffness", "actuator.force_constant")
        )
        A, B, *_ = cont2discrete(
            (np.array([[0, 1], [-k / m, -c / m]]), np.array([[0], [g / m]]), np.eye(2), np.zeros((2, 1))),
            scenario.sample_time,
        )
        state, rows = np.zeros(2), []
        for u in found.drive[:, 0]:
            rows.append(state[0])
            state = A @ state + B[:, 0] * u
        return np.array(rows)

    step = 0.02
    slopes = [
        (displaced({path: step * q.sd}) - displaced({path: -step * q.sd})) / (2 * step) for path, q in number.items()
    ]
    sd = np.sqrt(np.sum(np.square(slopes), axis=0))
    (stroke,) = (limit for limit in found.model.limits if limit.name == "stroke")
    taken = norm.isf(RISK) * sd
    worst = np.argmin(100e-6 - displaced({}) - taken)
    assert stroke.reserve[1] == pytest.approx(taken[worst], rel=2e-3)
    still = norm.isf(RISK) * 50e-6 * np.hypot(0.05, 0.02)  # of the stiffness and of the motor, in equilibrium
    assert still < 9e-6 and abs(stroke.reserve[1] / still - 1) > 0.1  # which is something else


def test_of_redundant_drives_those_with_the_least_expected_error_are_taken(tmp_path):
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "axis"\n[robust]\nprobability = "99 %"\n[path]\nkind = "poses"\n'
        'points = [{ x = "10 um", y = "-4 um" }]\n'
    )
    sds = {"a": 0.10, "b": 0.01, "c": 0.03}
    (tmp_path / "uncertainty.toml").write_text(
        'title = "u"\n[numbers]\n'
        + "".join(f'"mechanism.{n}" = {{ sd = "{100 * s:g} %", source = "s" }}\n' for n, s in sds.items())
        + '[drive]\nchannel_gain = { sd = "0.5 %", source = "s" }\n'
    )
    scenario = load_scenario(tmp_path, redundant())
    model = build_model(scenario.device)
    found, least = solve(scenario, model), solve(without(scenario), model)
    force = np.array([10.0, -4.0])  # k d
    B = np.array([[0.2, 0.1, 0.0], [0.0, -0.1, 0.2]])
    sd = np.hypot([sds["a"], sds["b"], sds["c"]], 0.005)

    def variance(u):  # of both displacements, in um, by each drive's own force
        return np.sum((B * u * sd) ** 2)

    reference = minimize(
        variance,
        least.drive[0],
        constraints={"type": "eq", "fun": lambda u: B @ u - force},
        method="SLSQP",
        options={"ftol": 1e-14},
    ).x
    assert found.drive[0] == pytest.approx(reference, abs=1e-3)  # V of 200: what SLSQP leaves
    assert variance(found.drive[0]) < 0.5 * variance(least.drive[0])
    stated = load_uncertainties(without(scenario), model)
    errors = [np.sqrt(np.sum(budget_of(s, stated, draws=0).combined[0] ** 2)) for s in (found, least)]
    assert errors[0] == pytest.approx(1e-6 * math.sqrt(variance(reference)), rel=1e-4) and errors[0] < errors[1]


def test_what_an_explanation_offers_can_be_followed(tmp_path):
    scenario = along(tmp_path, [5.0, 46.0], axis())
    with pytest.raises(Unreachable) as told:
        solve(scenario, build_model(scenario.device))
    offered = told.value.infeasibility.alternatives
    assert offered
    for what, command_ in offered.items():
        again = along(tmp_path, [float(v) for v in 1e6 * command_[:, 0]], axis())
        assert solve(again, build_model(again.device)).model.probability == pytest.approx(0.999), what


@pytest.mark.long
@pytest.mark.parametrize(
    ("given", "told"),
    [
        ('probability = "often"', "is not a probability"),
        ('probability = "100 %"', "at least 50 % and below 100 %"),
        ("probability = 99.9", "probability"),
        ('probability = "99.9 %"\nhome = ["delta_q"]', "'delta_q' is no channel of the pose"),
        ('probability = "99.9 %"\nhome = ["delta_z", "delta_z"]', "names a channel twice"),
        ('probability = "99.9 %"\nplace = 1', "place"),
    ],
)
def test_what_cannot_be_asked_for_is_refused_in_words(tmp_path, given, told):
    text = (EXAMPLE / "scenario.toml").read_text().replace("../devices", str(SCENARIOS / "devices"))
    before, after = text.split("[robust]")[0], text[text.index("[path]") :]
    (tmp_path / "scenario.toml").write_text(f"{before}[robust]\n{given}\n{after}")
    (tmp_path / "uncertainty.toml").write_text((EXAMPLE / "uncertainty.toml").read_text())
    done = command("check", tmp_path)
    assert done.returncode == 1 and told in " ".join(done.stderr.split()) and "Traceback" not in done.stderr


def test_a_scenario_of_which_nothing_is_uncertain_is_refused(tmp_path):
    text = (EXAMPLE / "scenario.toml").read_text().replace("../devices", str(SCENARIOS / "devices"))
    (tmp_path / "scenario.toml").write_text(text)
    done = command("check", tmp_path)
    assert done.returncode == 1 and "is not stated of anything" in " ".join(done.stderr.split())


@pytest.mark.long
def test_the_command_line_says_what_is_reserved(tmp_path):
    text = (EXAMPLE / "scenario.toml").read_text().replace("../devices", str(SCENARIOS / "devices"))
    (tmp_path / "scenario.toml").write_text(text.replace('"1 kHz"', '"100 Hz"'))
    (tmp_path / "uncertainty.toml").write_text((EXAMPLE / "uncertainty.toml").read_text())
    done = command("solve", tmp_path, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "all limits hold with 99.9 %" in done.stdout and "reserved" in done.stdout and "delta_z = -" in done.stdout
    record = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert faults(record, "summary") == []
    assert record["robust"]["probability"] == pytest.approx(0.999) and record["robust"]["moved"]["delta_z [um]"] < -5
    assert {"scenario", "device", "uncertainty"} <= set(record["inputs"])
    (stress,) = (m for m in record["margins"] if m["limit"] == "wire_stress")
    assert stress["bound"] == pytest.approx(550) and stress["reserve"] > 10
    assert stress["value"] + stress["margin"] + stress["reserve"] == pytest.approx(550)
    assert "reserved" in (tmp_path / "out" / "report.html").read_text()
    assert "Reserved" in (tmp_path / "out" / "report.html").read_text()

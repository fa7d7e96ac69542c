"""The error budget at the command line and in the report, a finer model, and what is refused."""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from budget_cases import FILE, number, stated
from command_line import ctrlgen
from conftest import SCENARIOS
from result_files import faults

from ctrlgen import InputError, build_model, error_budget, load_scenario, simulate, solve, user_device
from ctrlgen.budget.budget_section import budget_section
from ctrlgen.budget.error_budget import budget_of
from ctrlgen.budget.finer_model import load_finer
from ctrlgen.budget.uncertainty import Uncertainties, load_uncertainties
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.verification.scenario_report import write_report


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
        "did you mean 'actuator.young'",
        "is a count",
        "does not count from a zero of its own",
        "thickness\".sd: '1 N' has the wrong unit",
        "must be above zero",
        "states hexapod.base_angles[1] again",
        "drive.jitter.sd: '1 um'",
        "drive.gain.sd: '1 V'",
        "'actuator.poison'",
    ):
        assert said in text, said


@pytest.mark.parametrize(
    "scenario, text, said",
    [
        (
            "circle20",
            '[numbers]\n"actuator.heater_resistance" = { sd = "1 %", source = "a" }',
            "acts on neither motion nor limits",
        ),
        ("xy_stage_force", '[drive]\njitter = { sd = "1 us", source = "a" }', "row of equilibria"),
        ("mirror_spiral", '[surroundings]\nsd = "1 K"\nsource = "a"', "have no effect"),
        ("circle20", "[drive]\nplayer = 3", "drive.player"),
        ("circle20", "[drive]\nplayer = false", "is not stated of anything"),
        ("circle20", "", "is not stated of anything"),
        ("circle20", '[number]\n"a" = 1', "number: is not a key I know; did you mean 'numbers'?"),
        ("circle20", '[drive]\nconverter = { bits = 3, source = "a" }', "drive.converter.bits"),
        ("circle20", '[numbers]\n"actuator.young" = { sd = "1 %" }', "source: is missing"),
    ],
)
def test_what_means_nothing_is_refused(tmp_path, scenario, text, said):
    (tmp_path / "stated.toml").write_text(f'title = "t"\n{text}\n')
    with pytest.raises(InputError) as caught:
        error_budget(SCENARIOS / scenario, tmp_path / "stated.toml", draws=0)
    assert said in str(caught.value)


def test_a_share_of_a_negative_number_is_a_standard_deviation_above_zero(tmp_path):
    """5 % of -3 um are 0.15 um: where it stands in a correlation, its sign is that which was stated."""
    device = user_device(
        "axis",
        parameters={"k": "1 N/um", "rest": "-3 um"},
        drive={"a": "100 N"},
        axes={"x": "50 um"},
        force=lambda u: [u.a],
        restoring_force=lambda d, p: [p.k * (d.x - p.rest)],
    )
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
        "keeps ≤ 550 degC with 99 %: margin" in done.stdout
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


@pytest.mark.long
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
    screen = page.partition("<h2>Solution")[0]
    assert (
        f"± {whole.groups[0].shown(whole.factor * whole.peak(whole.groups[0])):.4g}" in screen and first.name in screen
    )
    assert f"<code>{first.name}</code>" in page and f"{1e9 * first.peak['translation']:.3g}" in page
    assert f'<code>{hidden.name}</code></td><td class="n">{hidden.sd}' not in page
    assert "keeps ≤ 550 degC with 99.9 %: margin" in page and "<code>ctrlgen budget</code> gives the whole" in page
    assert section.sources["uncertainty"] in page


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
    [
        ("circle20", "actuator.thermal_resistance", 0.01),
        ("circle20", "actuator.time_constant", 0.01),
        ("flexure_axis_line", "mechanics.stiffness", 0.001),
        ("xy_stage_force", "stage.half_stage_stiffness", 0.01),
    ],
)
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


@pytest.mark.parametrize("scenario", ["circle20", "meso_circle", "raster", "rrr_circle"])
def test_the_example_of_the_refusal_is_of_the_device_and_is_accepted(tmp_path, scenario):
    device = load_scenario(SCENARIOS / scenario).device
    (tmp_path / "stated.toml").write_text('title = "t"\n')
    bound = load_scenario(SCENARIOS / scenario)
    with pytest.raises(InputError) as caught:
        load_uncertainties(bound, build_model(device), tmp_path / "stated.toml")
    example = str(caught.value).partition("for example,\n")[2]
    (tmp_path / "stated.toml").write_text(f'title = "t"\n{example}\n')
    read = load_uncertainties(bound, build_model(device), tmp_path / "stated.toml")
    assert tomllib.loads(example)["numbers"].keys() <= {name for name, _ in device.quantities()} and read

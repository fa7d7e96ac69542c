"""Every scenario in the repository does what its file expects, C included."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from conftest import SCENARIOS
from result_files import faults

from ctrlgen import InputError, Unreachable, load_scenario, run
from ctrlgen.trajectory.metrics import expectations, metric

ALL = sorted(path.parent.name for path in SCENARIOS.glob("*/scenario.toml"))


def test_the_scenarios_of_the_papers_are_there():
    assert set(ALL) >= {"circle20", "coupled_dof", "xy_stage_force", "raster", "spiral", "unreachable"}


QUICK = ("parallelogram_line", "unreachable", "xy_stage_force")


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.long) for n in ALL])
def test_scenario_gives_what_it_expects(name, tmp_path, compiler):
    scenario = load_scenario(SCENARIOS / name)
    if scenario.file.outcome == "unreachable":
        with pytest.raises(Unreachable):
            run(scenario, tmp_path / "out")
        assert not (tmp_path / "out").exists()
        return
    assert scenario.file.expect, "a scenario without expectations proves nothing"
    outcome = run(scenario, tmp_path / "out")
    bad = [e for e in outcome.expected if not e.passed] + [r for r in outcome.comparison.rows if not r.passed]
    assert outcome.passed and not bad, bad
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert faults(summary, "summary") == []
    assert summary["passed"] is True and summary["samples"] == len(outcome.solution.command)
    for expected in ("report.html", "trajectory.csv", "figures/forces.svg", "figures/margins.svg", "c/CMakeLists.txt"):
        assert (tmp_path / "out" / expected).stat().st_size > 100, expected


def test_the_trajectory_file_has_its_columns_and_numbers(circle, tmp_path):
    from ctrlgen.verification.scenario_report import write_trajectory

    write_trajectory(circle, tmp_path / "t.csv")
    with open(tmp_path / "t.csv") as file:
        rows = list(csv.reader(file))
    axes = ["1X", "1Y", "2X", "2Y", "3X", "3Y"]
    pose = ["theta_x [rad]", "theta_y [rad]", "theta_z [rad]", "delta_x [um]", "delta_y [um]", "delta_z [um]"]
    units = (("d", "um"), ("F", "N"), ("T", "degC"), ("P", "W"))
    assert rows[0] == ["time [s]", *pose, *(f"{s}_{a} [{u}]" for s, u in units for a in axes)]
    table = np.array(rows[1:], dtype=float)
    assert table.shape == (1000, 31)
    assert table[:, 4] == pytest.approx(10 * np.cos(2 * np.pi * table[:, 0]), abs=1e-5)  # 0.01 nm in um
    assert np.all(table[:, 25:] >= 0) and np.all(table[:, 19:25] <= 550)


def test_the_report_is_one_file_that_refers_to_nothing_outside(circle, tmp_path):
    import re

    from ctrlgen.trajectory.solution_plots import draw_solution
    from ctrlgen.verification.scenario_report import write_report

    write_report(tmp_path, circle, None, expectations(circle), None, draw_solution(circle))
    page = (tmp_path / "report.html").read_text()
    assert page.count("<svg") == 5 and "Not run." in page
    assert not re.search(r'(src|href)="(?!#)', page)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("force.9X.max", "channel"),
        ("colour.1X.max", "signals are"),
        ("force.1X", "CHANNEL.max"),
        ("margin.taste", "limits are"),
        ("force.1X[100000]", "samples"),
        ("force", "write SIGNAL"),
    ],
)
def test_an_expectation_of_something_that_does_not_exist_is_refused(circle, name, says):
    with pytest.raises(ValueError, match=says):
        metric(circle, name)


def test_an_expectation_that_is_missed_is_reported(circle):
    from dataclasses import replace

    from ctrlgen.trajectory.scenario_file import Expectation

    wrong = Expectation(value="force.1X.max", range=("1 N", "2 N"))
    file = circle.scenario.file.model_copy(update={"expect": (wrong,)})
    (result,) = expectations(replace(circle, scenario=replace(circle.scenario, file=file)))
    assert not result.passed and 0.04 < result.measured < 0.06
    bad = Expectation(value="force.1X.max", range=("1 m", "2 m"))
    file = circle.scenario.file.model_copy(update={"expect": (bad,)})
    with pytest.raises(InputError, match="wrong unit"):
        expectations(replace(circle, scenario=replace(circle.scenario, file=file)))

"""Results at a prompt and in a notebook: a line, a small table, a data frame; what cannot be simulated is refused by its shape."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from conftest import AXIS_FILE, SCENARIOS

import ctrlgen
from ctrlgen.core.shown import Shown
from ctrlgen.core.tabular import Drawing, Page


@pytest.fixture(scope="module")
def axis():
    return ctrlgen.build_model(ctrlgen.load_device(AXIS_FILE))


@pytest.fixture(scope="module")
def solution(axis):
    scenario = ctrlgen.load_scenario(SCENARIOS / "flexure_axis_line")
    return ctrlgen.solve(scenario, axis)


def test_every_result_says_what_it_is_in_a_line(axis, solution):
    shown = {
        "Device": (axis.device, "single-axis flexure stage"),
        "Model": (axis, "drives axis"),
        "Scenario": (solution.scenario, "path line"),
        "Solution": (solution, "tightest limit"),
        "Trace": (solution.trace, "samples"),
        "Workspace": (ctrlgen.Workspace(axis), "channels axis"),
    }
    for result, says in shown.values():
        line = repr(result)
        assert says in line and len(line) < 300 and "\n" not in line
        assert "array(" not in line


def test_every_public_result_shows_itself():
    """What holds arrays or models would print thousands of characters."""
    results = [
        ctrlgen.Build, ctrlgen.CFolder, ctrlgen.Calibration, ctrlgen.Comparison, ctrlgen.Device, ctrlgen.Diagnosis, ctrlgen.ErrorBudget,
        ctrlgen.FastestPath, ctrlgen.Learning, ctrlgen.Model, ctrlgen.Outcome, ctrlgen.Record, ctrlgen.Recording, ctrlgen.Scenario,
        ctrlgen.Solution, ctrlgen.Trace, ctrlgen.Workspace,
    ]  # fmt: skip
    for kind in results:
        assert issubclass(kind, Shown) and "facts" in vars(kind) | vars(ctrlgen.Device), kind
        assert kind.__repr__ is Shown.__repr__, kind


def test_a_notebook_shows_a_table_whose_texts_are_escaped():
    class Odd(Shown):
        def facts(self):
            return {"title": "<script>alert(1)</script>", "n": 3}

    table = vars(Shown)["_repr_html_"](Odd())  # as Jupyter finds it
    assert table.startswith("<table>") and "<script>" not in table and "&lt;script&gt;" in table and ">3<" in table


def test_a_trace_is_a_data_frame_with_names_and_units(solution):
    frame = solution.trace.to_pandas()
    assert frame.index.name == "time [s]" and len(frame) == len(solution.trace.time)
    assert np.allclose(frame["pose.axis [um]"], 1e6 * solution.trace.signals["pose"][:, 0], rtol=1e-12)
    assert {"drive.axis [V]", "reading.axis [um]"} <= set(frame.columns)


def test_a_table_is_a_dataset_with_units(solution):
    pytest.importorskip("xarray")
    data = solution.to_xarray()
    assert data["pose.axis"].attrs == {"units": "um"} and data["time"].attrs == {"units": "s"}
    assert np.array_equal(data["pose.axis"].values, solution.to_pandas()["pose.axis [um]"].to_numpy())


def test_without_xarray_it_is_said_what_to_install(solution, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ctrlgen.CtrlgenError, match=r"pip install 'ctrlgen\[xarray\]'.*to_pandas"):
        solution.to_xarray()


def test_a_solution_has_the_commanded_path_in_its_table(solution):
    frame = solution.to_pandas()
    assert np.allclose(frame["command.axis [um]"], frame["pose.axis [um]"], atol=1e-6)


@pytest.mark.long
def test_figures_are_drawn_by_name_and_written(solution, tmp_path):
    every = solution.plot()
    assert {"path", "drives", "margins"} <= set(every.figures) and len(repr(every)) < 200
    (file,) = solution.plot("path").save(tmp_path / "path.svg")
    assert file.read_text().startswith("<svg") and vars(Drawing)["_repr_html_"](solution.plot("path")).startswith(
        "<figure><svg"
    )
    assert len(every.save(tmp_path / "all")) == len(every.figures)
    assert set(solution.trace.plot().figures) == set(solution.trace.described)
    with pytest.raises(ctrlgen.InputError, match="paht: is no figure of this result; there are"):
        solution.plot("paht")
    with pytest.raises(ctrlgen.InputError, match="one file for"):
        every.save(tmp_path / "all.svg")


def test_a_report_is_the_page_in_a_frame(solution, tmp_path):
    page = solution.report
    assert len(repr(page)) < 200 and page.html.startswith("<!doctype html>")
    shown = vars(Page)["_repr_html_"](page)
    assert shown.startswith("<iframe") and "<!doctype" not in shown  # escaped
    assert page.save(tmp_path).read_text() == page.html and (tmp_path / "summary.json").is_file()


def test_a_recording_is_a_table_of_all_its_records():
    device = ctrlgen.load_device(SCENARIOS / "devices" / "xy_lever_stage.toml")
    recording = ctrlgen.load_recordings([SCENARIOS / "lever_runs" / "run_a.toml"], ctrlgen.build_model(device))
    frame = recording.to_pandas()
    assert len(frame) == sum(len(r.time) for r in recording.records) and frame.index.name == "time [s]"
    assert {"record", "role"} <= set(frame) and any(c.startswith("drive.x [") for c in frame)
    first = recording.records[0]
    assert len(recording.plot(first.name).figures) == 1


def test_drawing_keeps_the_backend_that_a_notebook_has_chosen():
    told = "import matplotlib.pyplot as p; b = p.get_backend(); import ctrlgen.reporting.plots; assert p.get_backend() == b"
    done = subprocess.run([sys.executable, "-c", told], env={**os.environ, "MPLBACKEND": "svg"}, capture_output=True)
    assert done.returncode == 0, done.stderr


def test_the_linear_model_has_the_names_of_drives_and_poses(axis):
    system = ctrlgen.linearise(axis, np.array([10e-6]))
    assert system.output_labels == ["axis"] and len(system.input_labels) == 1
    assert abs(system.dcgain() - 10.0 / 0.2e6) < 1e-9 * 50e-6  # k_f/k


@pytest.mark.parametrize(
    ("u", "says"),
    [
        (np.zeros(50), r"has the shape \(50,\); \(n, 1\) is needed: a row a sample, a column a drive \(axis\)"),
        (np.zeros((50, 3)), r"has the shape \(50, 3\)"),
        (np.zeros((0, 1)), r"has the shape \(0, 1\)"),
        (np.full((5, 1), np.nan), "5 numbers that are not finite"),
    ],
)
def test_drives_of_a_wrong_shape_are_refused_with_the_right_one(axis, u, says):
    with pytest.raises(ctrlgen.InputError, match=says):
        ctrlgen.simulate(axis, u, 1e-3)


@pytest.mark.parametrize("sample_time", [0.0, -1.0, np.inf, np.nan])
def test_a_sample_time_is_above_zero(axis, sample_time):
    with pytest.raises(ctrlgen.InputError, match="seconds above zero"):
        ctrlgen.simulate(axis, np.zeros((5, 1)), sample_time)

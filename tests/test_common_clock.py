"""Records of several files on one clock."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import AXIS_FILE
from recording_folders import axis_recording

import ctrlgen
from ctrlgen.recordings.common_clock import Stretch, common_clock

A, B = Stretch("a", 0.0, 0.0, 10.0), Stretch("b", 12.0, 12.0, 20.0)


@pytest.mark.parametrize(
    "stretches, later",
    [
        ((A, B), {"a": 0.0, "b": 12.0}),
        ((B, A), {"a": 0.0, "b": 12.0}),
        # a clock that has run for a while
        ((Stretch("a", 1000.0, 1000.0, 1010.0), Stretch("b", 1010.5, 1010.5, 1030.0)), {"a": 0.0, "b": 10.5}),
        # two stretches of one file
        ((Stretch("a", 0.0, 0.0, 4.0), Stretch("a", 0.0, 6.0, 10.0), B), {"a": 0.0, "b": 12.0}),
        # one file alone has one clock as it is
        ((Stretch("a", 5.0, 5.0, 8.0), Stretch("a", 5.0, 9.0, 10.0)), None),
        # each from its own zero
        ((A, Stretch("b", 0.0, 0.0, 5.0)), None),
        # overlapping
        ((A, Stretch("b", 9.0, 9.0, 20.0)), None),
        # from the first row to the last twice what both took, less and more
        ((A, Stretch("b", 27.9, 27.9, 35.9)), {"a": 0.0, "b": 27.9}),
        ((A, Stretch("b", 28.1, 28.1, 36.1)), None),
        # an hour apart
        ((A, Stretch("b", 3600.0, 3600.0, 3610.0)), None),
    ],
)
def test_files_that_go_on_from_each_other_share_a_clock(stretches, later):
    assert common_clock(stretches) == later


def shifted(folder, by: float, start: str = ""):
    """The recording of an axis whose file to hold out begins `by` [s] later by its own column of time."""
    recording = axis_recording(folder, AXIS_FILE.read_text())
    text = (recording / "recording.toml").read_text()
    rows = np.loadtxt(recording / "hold_out.csv", delimiter=",", skiprows=1)
    rows[:, 0] += by
    np.savetxt(recording / "hold_out.csv", rows, delimiter=",", header="t,u,y", comments="")
    (recording / "recording.toml").write_text(text.replace('role = "hold_out"', f'role = "hold_out"\n{start}'))
    return recording


@pytest.mark.parametrize(
    "by, start, begins, told",
    [(2.0, "", 2.0, True), (0.0, "", 0.0, False), (2.0, 'start = "50 s"', 50.0, False), (1e5, "", 0.0, False)],
)
def test_a_file_that_goes_on_begins_when_its_column_says_and_it_is_told(tmp_path, by, start, begins, told):
    model = ctrlgen.build_model(ctrlgen.load_device(AXIS_FILE))
    recording = ctrlgen.load_recordings([shifted(tmp_path, by, start)], model)
    first = {r.role: r.time[0] for r in recording.records}
    assert first["fit"] == pytest.approx(0.0, abs=1e-9) and first["hold_out"] == pytest.approx(begins, abs=1e-6)
    assert any("taken as one clock" in note for note in recording.notes) is told


def of_day(t: float) -> str:
    return f"{int(t // 3600):02d}:{int(t // 60) % 60:02d}:{t % 60:09.6f}"


@pytest.mark.parametrize(
    "unit, written",
    [
        ("s", lambda t: f"{1000 + t:.6f}"),
        ("s", lambda t: f"{1764241125 + t:.6f}"),
        ("ms", lambda t: f"{1e3 * t:.3f}"),
        ("s", lambda t: f"2026-11-27T{of_day(45000 + t)}"),
        ("s", lambda t: of_day(45000 + t)),
    ],
)
def test_whatever_way_the_time_is_written(tmp_path, unit, written):
    recording = axis_recording(tmp_path, AXIS_FILE.read_text())
    path = recording / "recording.toml"
    path.write_text(path.read_text().replace('column = "t", unit = "s"', f'column = "t", unit = "{unit}"'))
    for role, by in (("fit", 0.0), ("hold_out", 2.0)):
        head, *rows = (recording / f"{role}.csv").read_text().splitlines()
        cells = [row.split(",") for row in rows]
        lines = [head, *(",".join((written(by + float(t)), *rest)) for t, *rest in cells)]
        (recording / f"{role}.csv").write_text("\n".join(lines) + "\n")
    loaded = ctrlgen.load_recordings([recording], ctrlgen.build_model(ctrlgen.load_device(AXIS_FILE)))
    assert [r.time[0] for r in loaded.records] == pytest.approx([0.0, 2.0], abs=2e-6)

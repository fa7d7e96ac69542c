"""ctrlgen simulate: a device under the drives of a file or a step, beside what was measured."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from command_line import ctrlgen
from conftest import AXIS_FILE, DEVICES

from ctrlgen.app.simulated import draw, simulate_device, stepped, table
from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model

STATIC = 50e-6  # m/V of the flexure axis: 10 N/V over 0.2 N/um


def drives(file, volts: np.ndarray, more: str = "", column: np.ndarray | None = None):
    extra = np.zeros(len(volts)) if column is None else column
    lines = [
        f"{k / 1e3:.3f},{v:.6f}" + (f",{e:.6f}" if more else "")
        for k, (v, e) in enumerate(zip(volts, extra, strict=True))
    ]
    file.write_text("\n".join([f"time [s],drive [V]{more}", *lines]) + "\n")
    return file


def test_a_step_settles_where_force_and_stiffness_say():
    result = simulate_device(AXIS_FILE, None, "0.5V", duration=0.8, rate=1000.0)
    reached = result.trace.signals["displacement"][:, 0]
    assert reached[79] == 0.0  # the first tenth is at rest
    assert abs(reached[-1] - 0.5 * STATIC) < 1e-4 * STATIC


def test_a_file_and_a_step_that_are_the_same_give_the_same(tmp_path):
    model = build_model(load_device(AXIS_FILE))
    u = stepped("1V", 0.3, 1000.0, model).u[:, 0]
    of_file = simulate_device(AXIS_FILE, drives(tmp_path / "u.csv", u), None, 0.0, 0.0)
    of_step = simulate_device(AXIS_FILE, None, "1V", 0.3, 1000.0)
    assert np.allclose(of_file.trace.z, of_step.trace.z, rtol=0, atol=1e-12)


def test_what_was_measured_is_compared(tmp_path):
    u = np.zeros(500)
    u[100:] = 1.0
    plain = simulate_device(AXIS_FILE, drives(tmp_path / "u.csv", u), None, 0.0, 0.0)
    read = plain.trace.signals["reading"][:-1, 0] + 3e-6
    file = drives(tmp_path / "uy.csv", u, ",position [um]", 1e6 * read)
    result = simulate_device(AXIS_FILE, file, None, 0.0, 0.0)
    assert abs(result.error("reading.axis") - 3e-6) < 1e-11
    assert b"<svg" in draw(result)


def test_the_table_holds_every_signal_with_its_unit():
    result = simulate_device(AXIS_FILE, None, "1V", duration=0.1, rate=1000.0)
    head, *lines = csv.reader(table(result).splitlines())
    assert head[0] == "time [s]" and {"drive.axis [V]", "reading.axis [um]"} <= set(head)
    column = [float(row[head.index("displacement.axis [um]")]) for row in lines]
    assert np.allclose(column, 1e6 * result.trace.signals["displacement"][:, 0], rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize(
    ("step", "duration", "says"),
    [
        ("1 N", 1.0, "wrong unit"),
        ("2X=1V", 1.0, "is no drive; write axis=1V"),
        ("1V", 1e9, "samples at 1000 Hz; 10 to"),
        ("1,5V", 1.0, "has a decimal comma; write a point"),
        (None, 1.0, "name a file of drives, or give --step"),
    ],
)
def test_what_cannot_be_simulated_is_refused(step, duration, says):
    with pytest.raises(InputError, match=says):
        simulate_device(AXIS_FILE, None, step, duration, 1000.0)


def test_a_file_without_a_drive_says_how_to_name_it(tmp_path):
    (tmp_path / "u.csv").write_text("time [s],force [N]\n" + "\n".join(f"{k / 1e3},{k}" for k in range(50)))
    with pytest.raises(InputError, match=r"no column is it; name one .drive.axis \[V\]"):
        simulate_device(AXIS_FILE, tmp_path / "u.csv", None, 0.0, 0.0)


def test_several_drives_step_by_their_names():
    result = simulate_device(DEVICES / "mems_hexapod.toml", None, "1X=0.1 W, 3Y=0.05 W", duration=0.1, rate=1000.0)
    last = result.trace.signals["drive"][-1]
    assert np.allclose(last, [0.1, 0, 0, 0, 0, 0.05])


def test_the_command_prints_and_writes(tmp_path):
    out = tmp_path / "out"
    done = ctrlgen("simulate", AXIS_FILE, "--step", "1V", "--duration", "0.5", "--out", out)
    assert done.returncode == 0, done.stderr
    assert "displacement.axis" in done.stdout and {"signals.csv", "signals.svg"} <= {p.name for p in out.iterdir()}


@pytest.mark.parametrize(
    "step, beyond", [("1V", ()), ("3V", ("stage displacement",)), ("5V", ("commanded drive", "stage displacement"))]
)
def test_a_motion_beyond_the_stated_limits_is_told(step, beyond):
    """1 V settles at 50 um of 100, 3 V at 150 um; 5 V is more than the amplifier's 4 V."""
    run = ctrlgen("simulate", str(AXIS_FILE), "--step", step, "--duration", "0.3")
    told = [line for line in run.stdout.splitlines() if line.startswith("beyond ")]
    assert len(told) == len(beyond) and all(any(limit in line for line in told) for limit in beyond), run.stdout


@pytest.mark.parametrize("file", sorted(DEVICES.glob("*.toml")), ids=lambda file: file.stem)
def test_a_device_at_rest_is_within_its_limits(file):
    drive = build_model(load_device(file)).signals["drive"]
    step = f"{drive.channels[0]}=0 {drive.units[0]}"
    assert not simulate_device(file, None, step, 0.02, 1000.0).broken


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("bode", AXIS_FILE, "--out", "x.pdf"), "x.pdf: must end in .svg or .png, or in .html"),
        (("check", AXIS_FILE, "--figure", "x.pdf"), "x.pdf: must end in .svg or .png"),
    ],
)
def test_a_picture_of_another_ending_is_refused_with_all_that_the_option_takes(words, told):
    done = ctrlgen(*words)
    assert done.returncode == 1 and done.stderr.rstrip().endswith(told)

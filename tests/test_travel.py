"""A travel that is not the same to both sides of home, in every kind that states one."""

from __future__ import annotations

import re

import numpy as np
import pytest
from command_line import ctrlgen
from conftest import DEVICES, ROOT
from mechanism_files import loaded

from ctrlgen import InputError, build_model
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.trajectory.workspace import Workspace, middle_pose

UM = 1e-6
SERVO = 'kind = "servo"\nname = "s"\ntitle = "t"\nsource = "s"\ntravel = "9 deg"\n'
NOTCH = re.search(r"```toml\n(.*?)```", (ROOT / "docs/howto/matrix_device.md").read_text(), re.DOTALL)[1]
KINDS = {
    "mechanism": ((DEVICES / "parallelogram.toml").read_text(), r'travel = "500 um"', "travel", "um"),
    "meso": ((DEVICES / "meso_hexapod.toml").read_text(), r"\ntravel = \{.*\}", "\ntravel", "um"),
    "axis": ((DEVICES / "flexure_axis.toml").read_text(), r"stroke .*", "stroke", "um"),
    "servo": (SERVO, r'travel = "9 deg"', "travel", "deg"),
    "matrix": (NOTCH, r'travel = "20 um"', "travel", "um"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_both_ends_are_limits_of_the_axis(kind, tmp_path):
    text, old, key, unit = KINDS[kind]
    replaced, count = re.subn(old, f'{key} = ["-10 {unit}", "60 {unit}"]', text)
    assert count == 1
    model = build_model(loaded(tmp_path, replaced))
    size = UM if unit == "um" else np.pi / 180
    low, high = (np.array(b) for b in (model.u_bounds if kind == "servo" else model.z_bounds))
    assert np.allclose(low, -10 * size) and np.allclose(high, 60 * size)
    assert np.allclose(model.signals["displacement"].scale, 60 * size)  # the farther end is the typical size


def test_the_ends_of_a_servo_that_is_driven_by_a_voltage_are_limits_of_its_position(tmp_path):
    volts = SERVO.replace('"9 deg"', '["-10 deg", "60 deg"]') + '[transducer]\ngain = "10 deg/V"\ndrive_limit = "8 V"\n'
    model = build_model(loaded(tmp_path, volts))
    assert np.allclose(np.ravel(model.z_bounds), np.deg2rad([-10, 60])) and np.allclose(
        np.ravel(model.u_bounds), [-8, 8]
    )


def test_a_servo_keeps_within_its_travel_whatever_leads_it(tmp_path):
    """Its drive would reach 80 deg; without a limit of the displacement its C could not be written."""
    volts = '[transducer]\ngain = "10 deg/V"\ndrive_limit = "8 V"\n'
    for text in (SERVO, SERVO + volts):
        model = build_model(loaded(tmp_path, text))
        assert np.allclose(np.ravel(model.z_bounds), np.deg2rad([-9, 9]))
        controller = controller_of(model, "pose", None)
        step = controller.step(controller.rest(), np.array([np.deg2rad(30)]), settle=True)
        assert np.allclose(step.displacement, np.deg2rad(9))


def test_the_workspace_and_the_limiter_end_where_the_travel_does(tmp_path):
    text, old, *_ = KINDS["mechanism"]
    model = build_model(loaded(tmp_path, re.sub(old, 'travel = ["-10 um", "60 um"]', text)))
    assert np.allclose(Workspace(model).ranges(middle_pose(model))[0], (-10 * UM, 60 * UM), atol=1e-3 * UM)
    controller = controller_of(model, "pose", 1e-3)
    for wanted, held in ((-30.0, -10.0), (80.0, 60.0), (30.0, 30.0)):
        step = controller.step(controller.rest(), np.array([wanted * UM]))
        assert np.isclose(step.displacement[0], held * UM, atol=1e-3 * UM)


def test_ends_that_do_not_hold_home_are_refused(tmp_path):
    text, old, *_ = KINDS["mechanism"]
    for ends, says in {
        '["10 um", "60 um"]': "does not hold home",
        '["0 um", "0 um"]': "does not hold home",
        '["-10", "60 um"]': r"travel\[0\]: '-10' has no unit",
        '["-10 um"]': r"travel\[1\]: is missing",
        '"-10 um"': "travel: '-10 um' is out of bounds",
    }.items():
        with pytest.raises(InputError, match=says):
            loaded(tmp_path, re.sub(old, f"travel = {ends}", text))


@pytest.mark.long
def test_the_c_keeps_both_ends(tmp_path):
    text, old, *_ = KINDS["mechanism"]
    (tmp_path / "device.toml").write_text(re.sub(old, 'travel = ["-10 um", "60 um"]', text))
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\nsample_rate = "200 Hz"\nduration = "1 s"\n'
        '[path]\nkind = "line"\nstart = { delta_x = "-9 um" }\nend = { delta_x = "59 um" }\n'
    )
    done = ctrlgen("run", tmp_path, "--out", tmp_path / "out")
    assert done.returncode == 0 and "comparisons within tolerance" in done.stdout, done.stdout + done.stderr
    beyond = (tmp_path / "scenario.toml").read_text().replace("-9 um", "-11 um")
    (tmp_path / "scenario.toml").write_text(beyond)
    refused = ctrlgen("solve", tmp_path, "--out", tmp_path / "none")
    assert refused.returncode != 0 and "be held: delta_x = -10 um" in " ".join(refused.stderr.split())

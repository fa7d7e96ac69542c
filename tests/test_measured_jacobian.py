"""`ctrlgen calibrate --jacobian`: a Jacobian from settled poses, all its numbers or few, and the device that follows it."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import MESO_FILE, SCENARIOS

from ctrlgen.calibration import jacobian_page
from ctrlgen.calibration.measured_jacobian import JacobianNumbers, calibrate_poses
from ctrlgen.controller.linearisation import linearise
from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model

POSES = SCENARIOS / "nist_hexapod"
UM, DEG = 1e-6, np.pi / 180


@pytest.fixture(scope="module")
def every():
    return calibrate_poses(MESO_FILE, [POSES])


@pytest.fixture(scope="module")
def few():
    return calibrate_poses(MESO_FILE, [POSES], JacobianNumbers.FEW)


def test_all_numbers_of_the_jacobian_hold_for_poses_that_were_not_fitted(every):
    held = every.held_out
    assert held.sum() == 30 and every.numbers == 42
    before, after = (np.linalg.norm(e.errors[held, 3:], axis=1).mean() for e in (every.before, every.after))
    assert before > 200 * UM and after < 1.7 * UM  # the paper's 36 numbers, fitted to these poses too, leave 1.565


def test_few_numbers_find_the_drives_that_count_backwards(few):
    gains = {n.name: n.value for n in few.few if n.name.startswith("gain")}
    assert {name for name, gain in gains.items() if gain < 0} == {"gain of 2y", "gain of 3x", "gain of 3y"}
    assert few.numbers == 13 + 6
    held = few.held_out  # 6.8 um of 242: what gains, frame and size cannot say are the stages' sideways motions
    assert (
        np.linalg.norm(few.after.errors[held, 3:], axis=1).mean()
        < 0.1 * np.linalg.norm(few.before.errors[held, 3:], axis=1).mean()
    )


def test_its_folder_holds_a_device_that_follows_it(every, tmp_path):
    jacobian_page.write_jacobian(tmp_path, every)
    device = load_device(tmp_path / "device.calibrated.py")
    model = build_model(device)
    drive = 1e-4 * np.array([1.0, -2.0, 0.5, 0.3, -1.0, 2.0])
    steps = linearise(model, np.zeros(6)).D
    assert (
        np.abs(steps @ drive - every.jacobian @ drive).max() < 1e-8 * np.abs(every.jacobian @ drive).max()
    )  # nine digits
    assert (tmp_path / "jacobian.csv").read_text().startswith("component,1x,2x,2y,3x,3y,1y")
    page = (tmp_path / "calibration.html").read_text()
    assert "42 numbers fitted to 24 poses" in page and "device.calibrated.py" in page


def test_what_are_no_poses_is_refused():
    with pytest.raises(InputError, match="must be settled poses"):
        calibrate_poses(SCENARIOS / "devices" / "mems_hexapod_run_time.toml", [SCENARIOS / "hexapod_specimen"])

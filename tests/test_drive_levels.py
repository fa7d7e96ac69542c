"""Steps of a drive are found by one spectrum over the drive, before any fit; no controller is asked to undo them."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS, NOISE, H, move, record
from conftest import AXIS_FILE
from recovery import fitter_of

from ctrlgen import InputError, build_model, load_device
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.effects import Place
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.model.inverse import invert

CONVERTER = Hypothesis("drive_quantisation", "actuator:axis", "axis")
N = 2500
T = H * np.arange(N)
DRIVE = 1.5 * np.sin(2 * np.pi * 2.3 * T) + 0.3 * np.sin(2 * np.pi * 13.1 * T + 1) + 0.2 * np.sin(2 * np.pi * 41 * T)


def levels(read, told=DRIVE) -> tuple[float, ...]:
    """After which changes of the drive what the axis as described leaves repeats."""
    rng = np.random.default_rng(3)
    y = read(DRIVE) + NOISE * rng.standard_normal(N)
    parts = [record(told, y, role) for role in ("fit", "hold_out")]
    fitter, fit = fitter_of(AXIS, ("reading.axis",), ("um",), (NOISE,), "series", parts).described(AXIS)
    assert "drive_levels" not in Screen(fitter, []).data_hints(fit)(Place.DRIVE, 0).suggested  # no law begins there
    return Screen(fitter, [CONVERTER]).data_hints(fit)(Place.DRIVE, 0).suggested["drive_levels"]


def rounded(u, step):
    return step * np.round(u / step)


@pytest.mark.parametrize("step", [0.25, 0.0625, 0.0156, 0.004])
@pytest.mark.parametrize("to", [np.round, np.floor])
def test_the_step_of_a_drive_is_found_from_one_part_in_a_thousand_of_its_range_to_a_sixteenth(step, to):
    first, *_ = levels(lambda u: move(step * to(u / step)))
    assert first == pytest.approx(
        step, rel=0.05 * step
    )  # a twentieth of a step over the whole range, which is no more than 4 V


def test_a_drive_without_steps_suggests_none():
    assert levels(move) == ()


@pytest.mark.parametrize("q", [0.01, 0.3])
def test_steps_of_the_reading_are_none_of_the_drive(q):
    assert levels(lambda u: rounded(move(u), q * 1e-6)) == ()


STEPS = """
[[effect]]
kind = "drive_quantisation"
at = "axis"
share = "1"
quantum = "0.05 V"
grid = "0"
rounding = "1e-6"
"""


def test_no_controller_undoes_steps_and_a_model_without_a_sample_time_leaves_them_out(tmp_path):
    file = tmp_path / "device.toml"
    file.write_text(AXIS_FILE.read_text() + STEPS)
    device = load_device(file)
    with pytest.raises(InputError, match="drive_quantisation gives a drive in steps and is not inverted"):
        invert(build_model(device, sample_time=H), "pose", H)
    plain, stepped = (build_model(d) for d in (load_device(AXIS_FILE), device))
    assert str(stepped.balance) == str(plain.balance)

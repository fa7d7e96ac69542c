"""Calibration of a specimen with a sensor that is wrong: its scale, a drift, its steps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from recorded_lag import record_lag

from ctrlgen import calibrate
from ctrlgen.calibration.calibrate import Calibration

TRUE = {"actuator.time_constant": 5.7e-3, "actuator.thermal_resistance": 500.0}
READINGS = slice(6, 12)


def calibrated(folder: Path, read: Callable[[np.ndarray], np.ndarray]) -> Calibration:
    """Of a specimen whose readings (n, 6) [urad, nm] are what `read` makes of them."""
    folder.mkdir(parents=True)
    device, records = record_lag(folder, 5.7e-3, 500.0, 1)
    for role in ("fit", "hold_out"):
        file = records / f"{role}.csv"
        head, rows = file.read_text().split("\n", 1)[0], np.loadtxt(file, delimiter=",", skiprows=1)
        rows[:, READINGS] = read(rows[:, READINGS])
        np.savetxt(file, rows, "%.9g", ",", header=head, comments="")
    return calibrate(device, records)


@pytest.mark.long
def test_steps_and_a_drift_of_the_sensor_leave_the_constants_within_what_is_stated(tmp_path):
    """Readings in steps of 20 nm, four times their noise, that drift by 100 nm and by 500 nm through each record of 0.2 s: both constants
    within four of their standard deviations, and a drift is told as what the model lacks."""
    for name, step, drift in (("steps", 20, 0), ("drift", 0, 100), ("both", 100, 500)):

        def read(y: np.ndarray, step: float = step, drift: float = drift) -> np.ndarray:
            y = y + np.array([0, 0, 0, 1, 1, 1]) * drift * np.linspace(0, 1, len(y))[:, None]
            return np.hstack([y[:, :3], step * np.round(y[:, 3:] / step)]) if step else y

        found = calibrated(tmp_path / name, read)
        for row in found.constants:
            assert row.determined and abs(row.value - TRUE[row.constant.path]) < 4 * row.sd, (name, row)
        assert any("differs from the model" in note for note in found.notes) == bool(drift), (name, found.notes)


@pytest.mark.long
def test_the_budget_of_the_sensor_is_what_wrong_scales_make_of_the_constants(tmp_path):
    """All channels read 0.5 % too large: the resistance moves by the budget, to a tenth, for it is one to first order."""
    right = calibrated(tmp_path / "right", lambda y: y)
    assert any("budget of the sensor" in note for note in right.notes)
    wrong = calibrated(tmp_path / "wrong", lambda y: 1.005 * y)
    k = [c.constant.path for c in right.constants].index("actuator.thermal_resistance")
    moved = abs(wrong.constants[k].value - right.constants[k].value)
    assert np.sqrt(right.of_sensor[k, k]) == pytest.approx(moved, rel=0.1) and moved > 100 * right.constants[k].sd

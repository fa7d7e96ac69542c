"""A reading beyond the travel that the device file states is told, and none that keeps it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, record

from ctrlgen import build_model
from ctrlgen.recordings.plausibility import with_plausibility
from ctrlgen.recordings.recording import Recording

STROKE = AXIS.mechanics.stroke.si
T = 1e-3 * np.arange(1200)
GAIN = 5e-5  # m/V, of the axis at rest


def told(device, y, valid=None):
    u = np.clip(y / GAIN, -4, 4)
    made = record(u, y, "fit")
    made = made if valid is None else replace(made, valid=valid[:, None])
    recording = Recording(
        "t",
        device.name,
        "series",
        ("reading.axis",),
        ("um",),
        (None,),
        (made,),
        (),
        drive_units=("V",),
        drives=("drive.axis",),
    )
    return [note for note in with_plausibility(recording, build_model(device)).notes if "beyond the" in note]


@pytest.mark.parametrize("reached, beyond", [(0.5, False), (0.999, False), (1.03, False), (1.05, True), (1.6, True)])
@pytest.mark.parametrize("side", [1, -1])
def test_what_goes_beyond_is_told_with_both_ranges(reached, beyond, side):
    """By 2 % of the range, which is 4 % of the stroke to a side."""
    y = side * reached * STROKE * np.sin(2 * np.pi * 2 * T) * np.where(np.sin(2 * np.pi * 2 * T) > 0, 1.0, 0.5)
    notes = told(AXIS, y)
    assert bool(notes) == beyond
    if beyond:
        assert f"{1e6 * STROKE:g} um" in notes[0] and f"{1e6 * reached * STROKE:.3g}" in notes[0]


def test_samples_that_are_not_used_tell_nothing():
    y = 0.8 * STROKE * np.sin(2 * np.pi * 2 * T)
    y[700] = 1.5 * STROKE
    assert told(AXIS, y) and not told(AXIS, y, valid=np.arange(len(y)) != 700)

"""Columns that are filtered, derived, shifted, scaled and thinned before they are judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import ROOT

import ctrlgen
from ctrlgen.core.errors import InputError
from ctrlgen.devices.limit import Limit
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings import preprocessing
from ctrlgen.recordings.reader import load_recordings

H, N = 1e-3, 4000
T = H * np.arange(N)
FILE = """
title = "t"
device = "emps"
kind = "series"
{top}
[derivatives]
"drive.velocity" = {{ of = "drive.position", order = 1 }}
"drive.acceleration" = {{ of = "drive.position", order = 2 }}
[[record]]
file = "r.csv"
role = "fit"
sample_rate = "1 kHz"
rows = [10, 2000]
[[record]]
file = "r.csv"
role = "hold_out"
sample_rate = "1 kHz"
rows = [10, 4000]
lead_in = 1990
[columns]
"drive.position" = {{ column = "q", unit = "mm" }}
"reading.force" = {{ column = "u", unit = "N", scale = -2.0, later = "1 ms" }}
"""


@pytest.fixture
def loaded(tmp_path):
    """A function: keys on top of the file -> the recording of a 2 Hz sine whose force is minus half of it, 1 ms early."""
    q = 50 * np.sin(2 * np.pi * 2 * T)
    u = -0.5 * 50 * np.sin(2 * np.pi * 2 * (T + 1e-3))
    np.savetxt(tmp_path / "r.csv", np.column_stack([q, u]), delimiter=",", header="q,u", comments="")
    model = build_model(ctrlgen.load_device(ROOT / "scenarios" / "emps" / "device.toml"))

    def load(top: str, model=model):
        (tmp_path / "recording.toml").write_text(FILE.format(top=top))
        return load_recordings([tmp_path / "recording.toml"], model)

    load.model = model
    return load


def test_derivatives_scale_and_shift_give_what_was_meant(loaded):
    fit, held = loaded('low_pass = "100 Hz"\nkeep_every = 4').records
    w = 2 * np.pi * 2
    assert fit.sample_time == pytest.approx(4e-3) and len(fit.time) == 498
    inner = slice(20, -20)  # of the filter's ends
    q, v, a = fit.drive[inner].T
    assert v == pytest.approx(0.05 * w * np.cos(w * fit.time[inner]), abs=1e-4 * 0.05 * w)
    assert a == pytest.approx(-(w**2) * q, abs=1e-3 * 0.05 * w**2)
    assert fit.observed[inner, 0] == pytest.approx(1e3 * q, abs=0.01)  # N, in phase with the position in mm
    assert not held.valid[:495].any() and held.valid[500:].all() and np.isfinite(held.drive).all()


def test_what_was_done_to_the_columns_is_said_in_one_sentence(loaded):
    said = [note for note in loaded("keep_every = 4").notes if note.startswith("Before anything else")]
    assert len(said) == 1 and said[0].endswith("; one row in 4 kept.") and "'reading.force'" not in said[0]


def test_a_record_knows_up_to_which_frequency_it_holds_anything(loaded):
    """The columns hold nothing above it, which a noise taken from their differences must know."""
    assert [r.band for r in loaded('low_pass = "60 Hz"\nkeep_every = 4').records] == [60.0, 60.0]
    assert [r.band for r in loaded("").records] == [None, None]


def test_a_limit_on_one_side_alone_is_kept_to_a_millionth_of_itself(loaded):
    """The position goes to 50 mm; what lies beyond by less is the rounding of the file."""
    model = loaded.model

    def limited(upper: float):
        limit = Limit("travel", "travel", ("position",), "m", model.u[0], None, upper)
        return loaded("", replace(model, limits=(limit,)))

    assert limited(50e-3 * (1 - 0.5e-6)).records
    with pytest.raises(InputError, match="the device allows no limit to"):
        limited(50e-3 * (1 - 4e-6))


def test_a_cut_off_that_the_kept_rows_cannot_hold_is_refused(loaded):
    with pytest.raises(InputError, match="too high for the rows that are kept"):
        loaded('low_pass = "100 Hz"\nkeep_every = 10')


def test_a_low_pass_has_no_phase():
    y = preprocessing.low_passed(np.sin(2 * np.pi * 20 * T), H, 100.0)
    assert y[200:-200] == pytest.approx(np.sin(2 * np.pi * 20 * T)[200:-200], abs=1e-3)

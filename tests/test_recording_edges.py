"""Where a record is cut, and when it repeats another: at the two sides of each rule."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import csv_text, described, samples

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.reader import load_recordings


@pytest.mark.parametrize("shared, refused", [(4, False), (5, False), (6, True)])
def test_held_out_data_of_which_most_was_fitted_are_refused(tmp_path, model, shared, refused):
    """Ten blocks of forty samples, some of them those of the record to fit, number for number."""
    fit, held = samples(400, seed=1), samples(400, seed=2)
    for name in fit:
        if name != "t":
            held[name] = np.concatenate([fit[name][: 40 * shared], held[name][40 * shared :]])
    (tmp_path / "fit.csv").write_text(csv_text(fit))
    (tmp_path / "held.csv").write_text(csv_text(held))
    folder = described(tmp_path, {"file": "fit.csv", "role": "fit"}, {"file": "held.csv", "role": "hold_out"})
    if refused:
        with pytest.raises(InputError, match=r"holds the data of fit\.csv"):
            load_recordings([folder], model)
    else:
        load_recordings([folder], model)


@pytest.mark.parametrize("first, last", [(0, 390), (10, 400)])
def test_one_stretch_is_one_record_of_the_same_name_with_one_note(tmp_path, model, first, last):
    fit = samples(400)
    missing = np.ones(400, bool)
    missing[first:last] = False
    fit["u1X"] = np.where(missing, np.nan, fit["u1X"])
    (tmp_path / "fit.csv").write_text(csv_text(fit))
    (tmp_path / "held.csv").write_text(csv_text(samples(seed=2)))
    folder = described(tmp_path, {"file": "fit.csv", "role": "fit"}, {"file": "held.csv", "role": "hold_out"})
    recording = load_recordings([folder], model)
    (note,) = recording.notes
    assert "missing in 10 samples" in note and recording.records[0].name == "fit.csv"
    assert len(recording.records[0].time) == 390


@pytest.mark.parametrize("ambient, fault", [("23 degC", False), ("23 um", True), ("warm", True)])
def test_surroundings_are_a_temperature(tmp_path, model, ambient, fault):
    for name, seed in (("fit", 1), ("held", 2)):
        (tmp_path / f"{name}.csv").write_text(csv_text(samples(seed=seed)))
    first = {"file": "fit.csv", "role": "fit", "conditions": {"ambient": ambient}}
    folder = described(tmp_path, first, {"file": "held.csv", "role": "hold_out"})
    if fault:
        with pytest.raises(InputError, match=r"conditions\.ambient"):
            load_recordings([folder], model)
    else:
        load_recordings([folder], model)

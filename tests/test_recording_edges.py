"""Where a record is cut, and when it repeats another: at the two sides of each rule."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import COLUMNS, csv_text, described, refused, samples

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


@pytest.mark.parametrize("start", [None, "0 s"])
def test_records_may_share_rows_where_they_read_different_columns(tmp_path, model, start):
    """Official splits keep the readings to fit and those to judge beside each other in one file."""
    fit, other = samples(400, seed=1), samples(400, seed=2)
    (tmp_path / "both.csv").write_text(csv_text({**fit, "y": other["x"]}))
    judged = {"reading.delta_x": {"column": "y", "unit": "um"}}
    rows = {"file": "both.csv", "rows": [0, 300], "start": start}
    held_out = {**rows, "role": "hold_out", "rows": [100, 400], "columns": judged}
    recording = load_recordings([described(tmp_path, {**rows, "role": "fit"}, held_out)], model)
    np.testing.assert_allclose(recording.records[0].observed[:, 0], 1e-6 * fit["x"][:300])
    np.testing.assert_allclose(recording.records[1].observed[:, 0], 1e-6 * other["x"][100:])


def test_records_of_two_files_share_no_reading_of_a_third(tmp_path, model):
    for name in ("fit", "held", "readings"):
        (tmp_path / f"{name}.csv").write_text(csv_text(samples(seed=len(name))))
    columns = {**COLUMNS, "reading.delta_x": {"column": "x", "unit": "um", "file": "readings.csv"}}
    records = {"file": "fit.csv", "role": "fit"}, {"file": "held.csv", "role": "hold_out"}
    faults = refused([described(tmp_path, *records, columns=columns)], model)
    assert "share samples of column 'x' of readings.csv" in faults["record[1].rows"]

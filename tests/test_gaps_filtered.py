"""Rows that are missing before a low-pass: the filter is given smooth columns there, and the readings are not used."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import AXES, csv_text, described, refused, samples

from ctrlgen.recordings.reader import load_recordings

N = 1200


def filtered(folder, columns, **more):
    (folder / "fit.csv").write_text(csv_text(columns))
    (folder / "held.csv").write_text(csv_text(samples(N, seed=2)))
    described(folder, {"file": "fit.csv", "role": "fit", **more}, {"file": "held.csv", "role": "hold_out"})
    text = (folder / "recording.toml").read_text()
    (folder / "recording.toml").write_text('low_pass = "40 Hz"\nkeep_every = 4\n' + text)
    return folder


def test_a_record_that_lacks_rows_is_that_without_gaps_but_for_their_readings(tmp_path, model):
    columns = samples(N)
    whole = load_recordings([filtered(tmp_path, columns)], model).records[0]
    there = np.random.default_rng(3).random(N) >= 0.01
    there[[0, 1, -2, -1]] = True
    recording = load_recordings([filtered(tmp_path, {k: v[there] for k, v in columns.items()})], model)
    record = recording.records[0]
    np.testing.assert_allclose(record.time, whole.time, atol=1e-12)
    np.testing.assert_allclose(record.drive, whole.drive, atol=2e-4)  # of 0.1 W
    lost = ~there[::4]
    assert np.array_equal(~record.valid[:, 0], lost) and 0 < lost.sum() < 10
    off = (record.observed - whole.observed)[~lost, 0]
    assert np.abs(off).max() < 5e-9 and np.std(off) < 1e-9  # a tenth of the noise of 10 nm
    assert f"{(~there).sum()} samples in all" in recording.notes[1] and "before the low-pass" in recording.notes[1]


def test_rows_and_lead_in_are_those_of_the_file(tmp_path, model):
    columns = samples(N)
    there = ~np.isin(np.arange(N), [50, 700, 701])
    folder = filtered(tmp_path, {k: v[there] for k, v in columns.items()}, rows=[100, 900], lead_in=40)
    record = load_recordings([folder], model).records[0]
    assert record.name == "fit.csv[100:900]"
    assert record.time[0] == pytest.approx(0.101) and record.time[-1] == pytest.approx(0.901)
    assert np.flatnonzero(record.valid[:, 0])[0] == 10


def test_a_gap_that_is_long_beside_the_filter_is_refused(tmp_path, model):
    columns = {k: np.delete(v, np.arange(600, 620)) for k, v in samples(N).items()}
    faults = refused([filtered(tmp_path, columns)], model)
    assert "a filter would smear" in str(faults)


def test_single_cells_without_a_number_are_bridged_too(tmp_path, model):
    columns = samples(N)
    columns[f"u{AXES[0]}"][[300, 301]] = np.nan
    columns["x"][[400, 500]] = np.nan
    record = load_recordings([filtered(tmp_path, columns)], model).records[0]
    assert np.flatnonzero(~record.valid[:, 0]).tolist() == [100, 125] and np.isfinite(record.drive).all()

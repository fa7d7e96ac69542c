"""Doubtful samples of a recording are marked and not mended: gaps, spikes, what is frozen or dead."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import AXES, COLUMNS, N, described, samples, two

from ctrlgen.recordings.reader import load_recordings


def test_missing_samples_are_marked_and_not_filled(tmp_path, model):
    fit = samples()
    fit["x"][[5, 90]] = np.nan
    recording = load_recordings([two(tmp_path, fit)], model)
    record = recording.records[0]
    assert np.array_equal(np.flatnonzero(~record.valid[:, 0]), [5, 90]) and np.isnan(record.observed[[5, 90], 0]).all()
    assert recording.notes == ("fit.csv, reading.delta_x: 2 of 400 samples are missing (first at 0.005 s); not used.",)


def test_a_gap_cuts_a_record_where_the_drive_is_not_known(tmp_path, model):
    kept = np.r_[0:150, 200:N]
    recording = load_recordings([two(tmp_path, {k: v[kept] for k, v in samples().items()}, gap="split")], model)
    first, second = recording.records[:2]
    assert len(first.time) == 150 and len(second.time) == 200 and second.time[0] == pytest.approx(0.2)
    assert first.valid.all() and second.valid.all() and "cut before 0.2 s" in recording.notes[0]
    lost = samples()
    lost["u2X"][150:200] = np.nan
    again = load_recordings([two(tmp_path, lost, gap="split")], model).records[:2]
    assert [len(r.time) for r in again] == [150, 200] and np.array_equal(again[1].drive, second.drive)


def test_rows_without_a_drive_at_the_end_are_left_out_with_a_note(tmp_path, model):
    fit = samples()
    fit["u2X"][390:] = np.nan
    recording = load_recordings([two(tmp_path, fit)], model)
    assert len(recording.records[0].time) == 390 and "missing in 10 samples" in recording.notes[0]


def test_a_gap_while_the_drive_rests_is_marked(tmp_path, model):
    fit = samples()
    for axis in AXES:
        fit[f"u{axis}"][140:210] = 0.2
    kept = np.r_[0:150, 200:N]
    recording = load_recordings([two(tmp_path, {k: v[kept] for k, v in fit.items()})], model)
    record = recording.records[0]
    assert len(record.time) == N and np.allclose(record.time, fit["t"], atol=1e-9)
    assert np.array_equal(np.flatnonzero(~record.valid[:, 0]), np.arange(150, 200))
    assert "50 samples are missing after 0.149 s" in recording.notes[0]


def test_spikes_are_marked(tmp_path, model):
    fit = samples()
    fit["x"][100] += 0.3
    fit["x"][200:203] -= 0.3
    recording = load_recordings([two(tmp_path, fit)], model)
    assert np.array_equal(np.flatnonzero(~recording.records[0].valid[:, 0]), [100, 200, 201, 202])
    assert np.isnan(recording.records[0].observed[[100, 200, 201, 202], 0]).all()
    assert "4 of 400 samples are outliers" in recording.notes[0]
    one = samples()
    one["x"][100] += 0.3
    assert "1 of 400 samples is an outlier" in load_recordings([two(tmp_path, one)], model).notes[0]


def test_frozen_stretches_are_marked(tmp_path, model):
    fit = samples()
    fit["x"][60:90] = fit["x"][60]
    recording = load_recordings([two(tmp_path, fit)], model)
    assert np.array_equal(np.flatnonzero(~recording.records[0].valid[:, 0]), np.arange(60, 90))
    assert "30 of 400 samples are in stretches that repeat one value" in recording.notes[0]


def test_a_dead_channel_is_kept_and_named(tmp_path, model):
    dead = samples()
    dead["tilt"][:] = 2e-4
    two(tmp_path, dead)
    columns = {**COLUMNS, "reading.theta_y": {"column": "tilt", "unit": "rad"}}
    described(tmp_path, {"file": "fit.csv", "role": "fit"}, {"file": "held.csv", "role": "hold_out"}, columns=columns)
    recording = load_recordings([tmp_path], model)
    assert recording.notes == ("fit.csv, reading.theta_y: reads 0.0002 rad throughout; the channel may be dead.",)
    assert recording.records[0].valid.all()

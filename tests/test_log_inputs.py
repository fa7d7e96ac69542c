"""Whole recordings of kinds that were once read wrong: each is read to what was measured, or refused with the mend."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ctrlgen import build_model, load_device
from ctrlgen.core.errors import InputError
from ctrlgen.recordings.reader import load_recordings

LOGS = Path(__file__).parent / "logs"
HIGHEST = pytest.approx(60e-6, rel=1e-3)  # of the reading [m] in every one of these logs
READ = {  # folder: what must be said of the reading, sample time [s], highest reading [m]
    "m01_bad_cells_told_as_many_tables": (
        "x: 9 readings are '---' (first in line 21), taken as missing",
        1e-3,
        HIGHEST,
    ),
    "m03_blanks_between_columns": ("", 1e-3, HIGHEST),
    "m04_header_behind_hash": ("", 1e-3, HIGHEST),
    "m05_units_row_under_names": ("line 2 holds units", 1e-3, HIGHEST),
    "m07_lvm_names_lost": ("names in line 9", 1e-3, HIGHEST),
    "m09_dspace_struct_array": ("", 1e-3, HIGHEST),
    "m10_simulink_structure_with_time": ("", 1e-3, HIGHEST),
    "m12_hdf5_compound_table": ("", 1e-3, HIGHEST),
    "m13_iso_time_stamps": ("time is ISO 8601; seconds since 2024-03-31T01:59:58", 1e-3, HIGHEST),
    "s02_unnamed_columns_number_3_gives_4": (
        "column 3, counted from 0, has no name; the one before it is 'capacitive'",
        1e-3,
        78e-6,
    ),
    "s04_overrange_sentinel": ("x: 3 readings are 9.9e+37 (first in line 121), over range; left out", 1e-3, HIGHEST),
    "s06_tdms_time_stamps_read_as_1000_s": ("time is instants; seconds since 2024-01-01T00:00:00", 1e-3, HIGHEST),
    "s07_tdms_wf_increment_ignored": ("reading.axis is read every 0.0005 s from 0.02 s on", 1e-3, HIGHEST),
    "s09_hdf5_scale_factor_ignored": ("x is its numbers times 0.01 plus 0", 1e-3, HIGHEST),
    "s14_milliseconds_given_as_s": ('if the time is in ms, write unit = "ms"', 1.0, HIGHEST),
}
REFUSED = {
    "m14_low_pass_blamed_on_length": {"record[0]: low_pass": "write 25 Hz or more"},
    "s01_stray_quote_drops_rest": {"record[0].file": "opened and not closed in line 262"},
    "s11_json_key_twice": {"record[0].file": "holds the key 'x' twice"},
    "s12_units_in_parentheses_not_compared": {
        "record[0].time": "run.csv says ms, recording.toml says s",
        "record[0].columns.'drive.axis'": "says mV",
        "record[0].columns.'reading.axis'": "says nm",
    },
    "t01_traceback_recording_without_reading": {"record[0].columns": "no reading to compare with"},
}
NEEDS = {"m12": "h5py", "s09": "h5py", "s06": "nptdms", "s07": "nptdms"}


@pytest.fixture(scope="module")
def stage():
    return build_model(load_device(LOGS / "stage.toml"))


def needed(folder: str) -> None:
    if package := NEEDS.get(folder[:3]):
        pytest.importorskip(package, reason=f"{package} is not installed: {folder} was not read")


@pytest.mark.parametrize("folder", READ)
def test_a_log_is_read_and_what_is_interpreted_is_said(folder, stage):
    needed(folder)
    said, sample_time, highest = READ[folder]
    recording = load_recordings([LOGS / folder], stage)
    assert any(said in note for note in recording.notes), recording.notes
    assert all(r.sample_time == pytest.approx(sample_time, rel=1e-6) for r in recording.records)
    with np.errstate(all="ignore"):
        found = np.nanmax(np.concatenate([r.observed[np.isfinite(r.observed)] for r in recording.records]))
    assert found == pytest.approx(highest.expected if hasattr(highest, "expected") else highest, rel=1e-3)


@pytest.mark.parametrize("folder", REFUSED)
def test_a_log_is_refused_with_the_mend(folder, stage):
    with pytest.raises(InputError) as raised:
        load_recordings([LOGS / folder], stage)
    found = {fault.where: fault.what for fault in raised.value.faults}
    assert found.keys() == REFUSED[folder].keys()
    for where, what in REFUSED[folder].items():
        assert what in found[where]


def test_every_folder_is_tried():
    assert {p.name for p in LOGS.iterdir() if p.is_dir()} == READ.keys() | REFUSED.keys()


def test_a_waveform_on_a_clock_of_its_own_is_taken_at_the_times_of_the_drive(stage):
    """200 readings 0.5 ms apart from 20 ms on, of which every second one falls on a sample of the drive."""
    needed("s07")
    recording = load_recordings([LOGS / "s07_tdms_wf_increment_ignored"], stage)
    seen = np.concatenate([np.isfinite(r.observed[:, 0]) for r in recording.records])
    assert np.array_equal(np.flatnonzero(seen), np.arange(20, 120))
    own = load_recordings([LOGS / "s06_tdms_time_stamps_read_as_1000_s"], stage)  # the same numbers, 1 ms apart
    taken, given = (np.concatenate([r.observed[:, 0] for r in rec.records]) for rec in (recording, own))
    np.testing.assert_allclose(taken[20:119], given[0:198:2], rtol=1e-12)

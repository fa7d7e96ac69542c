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


AXIS = """title = "t"
device = "my_stage"
kind = "series"
{layout}
[[record]]
file = "{file}"
role = "fit"
{record}
[columns]
"drive.axis" = {{ column = "u", unit = "V" }}
"reading.axis" = {{ column = "x", unit = "um" }}
"""


def recorded(folder, stage, file: str, content: bytes, record: str, layout: str = ""):
    (folder / file).write_bytes(content)
    (folder / "recording.toml").write_text(AXIS.format(file=file, record=record, layout=layout))
    return load_recordings([folder], stage)


def rows(step: int = 1) -> str:
    return "".join(f"{k * step};{1 + k % 3},{100 + k % 13};{5 + k % 11},{100 + k % 17}\n" for k in range(240))


@pytest.mark.parametrize("where", ["layout of all files", "layout of a record"])
def test_the_answer_stands_in_recording_toml(where, tmp_path, stage):
    content = ("t;u;x\n" + rows()).encode()
    time = 'time = { column = "t", unit = "ms" }'
    with pytest.raises(InputError, match=r"layout = \{ decimal = "):
        recorded(tmp_path, stage, "run.csv", content, time)
    if where == "layout of all files":
        recording = recorded(tmp_path, stage, "run.csv", content, time.replace('t"', 't"'), '[layout]\ndecimal = ","')
    else:
        recording = recorded(tmp_path, stage, "run.csv", content, f'{time}\nlayout = {{ decimal = "," }}')
    assert recording.records[0].drive[0, 0] == 1.1 and "run.csv: decimal comma." in recording.notes


@pytest.mark.parametrize(("rate", "fits"), [("1 kHz", True), ("2 kHz", False)])
def test_a_rate_that_the_file_contradicts_is_refused(rate, fits, tmp_path, stage):
    head = "# SEPARATOR = 59\n# SAMPLE_TIME = 0.001\n# NAME0 = t\n# NAME1 = u\n# NAME2 = x\n# END_HEADER\n"
    content = (head + rows().replace(",", ".")).encode()
    layout = '[layout]\ndecimal = "."'
    if fits:
        assert (
            recorded(tmp_path, stage, "run.dat", content, f'sample_rate = "{rate}"', layout).records[0].sample_time
            == 1e-3
        )
    else:
        with pytest.raises(
            InputError, match=r'is read every 0.001 s, but sample_rate = 2 kHz; write sample_rate = "1000 Hz"'
        ):
            recorded(tmp_path, stage, "run.dat", content, f'sample_rate = "{rate}"', layout)

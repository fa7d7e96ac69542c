"""Times of day that are written as one number, 115559: read as a clock; seconds with pauses stay seconds."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ROOT

from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.clock_numbers import clock_of
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import propose
from ctrlgen.recordings.look.proposed_file import recording_toml
from ctrlgen.recordings.reader import load_recordings

NOON = 11 * 3600 + 55 * 60  # 11:55:00


def written(seconds: np.ndarray) -> np.ndarray:
    """Seconds since midnight as HHMMSS."""
    day = seconds % 86400
    return 10000 * (day // 3600) + 100 * (day // 60 % 60) + day % 60


@pytest.mark.parametrize(
    "begin", [NOON, 1, 8 * 3600 - 90, 86400 - 150], ids=["noon", "after midnight", "at eight", "over midnight"]
)
@pytest.mark.parametrize("step", [1.0, 0.25, 7.0, 30.0])
def test_a_clock_that_is_one_number_is_seconds(begin, step):
    seconds = begin + step * np.arange(600)
    np.testing.assert_allclose(clock_of(written(seconds)), seconds, atol=1e-6)


def test_a_clock_that_is_rounded_loses_rows_or_has_thousandths_or_a_date_is_one_too():
    seconds = NOON + 0.1 * np.arange(3000)
    np.testing.assert_array_equal(clock_of(written(np.floor(seconds))), np.floor(seconds))
    np.testing.assert_allclose(clock_of(np.round(1000 * written(seconds))), seconds, atol=1e-3)
    lost = np.delete(NOON + np.arange(600.0), np.r_[50:65, 200:380])
    np.testing.assert_array_equal(clock_of(written(lost)), lost)
    holes = np.where(np.arange(600) % 50 == 7, np.nan, NOON + np.arange(600.0))
    np.testing.assert_array_equal(clock_of(written(holes)), holes)
    late = 86400 - 5 + np.arange(10.0)  # over the end of a February
    numbers = np.where(late < 86400, 20240229000000.0, 20240301000000.0) + written(late)
    np.testing.assert_array_equal(clock_of(numbers), late)


@pytest.mark.parametrize(
    "seconds",
    [
        np.arange(600.0),
        115500.0 + np.arange(50),
        50.0 * np.arange(100),
        100.0 * np.arange(50),
        np.r_[0:30, 90:130, 155:170].astype(float),
        np.r_[115500:115530, 115700:115730, 115900:115920].astype(float),
        np.cumsum(np.random.default_rng(0).exponential(20.0, 100)),
        np.arange(20),
        -1.0 + np.arange(10),
        np.full(10, np.nan),
        np.sort(np.random.default_rng(1).integers(0, 3, 40)).astype(float),
        1.7e9 + np.arange(100.0),
        20240001000000.0 + np.arange(10),
    ],
)
def test_seconds_stay_seconds(seconds):
    assert clock_of(seconds) is None


def table_of(folder, head: str, seconds: np.ndarray):
    u = np.sin(0.2 * np.arange(len(seconds)))
    rows = "".join(f"{int(t):06d},{a:.5f},{40 * a:.5f}\n" for t, a in zip(written(seconds), u, strict=True))
    (folder / "log.csv").write_text(f"{head},u (V),x (um)\n{rows}")
    return read_table(folder / "log.csv")


def test_a_record_by_such_a_clock_has_no_gaps_and_the_clock_is_told(tmp_path):
    axis = build_model(load_device(ROOT / "tests" / "logs" / "stage.toml"))
    facts = table_facts(table_of(tmp_path, "Time", NOON + np.arange(600)))
    assert (facts.time.step, facts.time.gaps) == (1.0, ()) and "11:55:59" in facts.time.notes[0]
    proposal = propose([facts], axis)
    assert proposal.missing == ()  # seconds are no assumption
    (tmp_path / "recording.toml").write_text(recording_toml(proposal, tmp_path, "log"))
    recording = load_recordings([tmp_path], axis, hold_out=False)
    assert [len(record.time) for record in recording.records] == [600]
    assert any("Time is a clock written as a number" in note for note in recording.notes)
    slow = [note for note in recording.notes if "natural frequency" in note]
    assert len(slow) == 1 and "write unit" not in slow[0]


def test_a_clock_said_to_be_in_another_unit_is_refused(tmp_path):
    table = table_of(tmp_path, "Time", NOON + np.arange(600))
    for unit, scale in (("ms", 1.0), ("s", 0.1)):
        with pytest.raises(InputError, match=r'clock written as numbers .* write unit = "s" without a scale'):
            table.time("Time", unit, scale)
    assert table.time("Time", "s").begin == NOON


@pytest.mark.parametrize(
    "step", [1, 2, 5, 10, 20, 25, 40, 50, 60, 100, 125, 200, 250, 500, 1000, 1250, 2500, 5000, 0.1, 0.25]
)
@pytest.mark.parametrize("lost", [False, True])
def test_numbers_that_are_even_by_themselves_are_no_clock(step, lost):
    """Of few rows none has 60 seconds by chance: milliseconds, say; also where a row is lost."""
    for rows in (5, 12, 26, 200):
        even = step * np.arange(rows, dtype=float)
        assert clock_of(np.delete(even, rows // 2) if lost else even) is None, rows

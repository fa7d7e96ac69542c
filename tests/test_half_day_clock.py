"""Clocks of twelve hours without AM or PM, over noon and midnight, with dates and without."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
import pytest

from ctrlgen.recordings.formats.time_stamps import seconds

BEGINS = {"noon": 12, "one at noon": 13, "midnight": 24, "one at night": 25, "five hours before noon": 7}  # h
STEPS = (0.05, 1.0, 7.3, 61.0)  # s
DATED = {"": "", "%d.%m.%Y ": ".", "%Y-%m-%d ": "-", "%Y/%m/%d ": "/"}


def stamps_of(times: np.ndarray, begin: datetime, date: str, hours: str) -> np.ndarray:
    """Times [s] since `begin` as a logger writes them."""
    instants = [begin + timedelta(seconds=float(t)) for t in times]
    cells = [f"{d.strftime(date)}{int(d.strftime(hours))}:{d.strftime('%M:%S.%f')}" for d in instants]
    return np.array(cells, dtype=object)


@pytest.mark.parametrize("date", DATED)
@pytest.mark.parametrize("at", BEGINS)
@pytest.mark.parametrize("step", STEPS)
def test_time_goes_on_over_noon_and_midnight(date, at, step):
    t = np.round(step * np.arange(500), 6)
    t[300:] += 45 * step  # rows are missing
    begin = datetime(2026, 3, 3) + timedelta(hours=BEGINS[at], seconds=-200.5 * step)
    read = seconds(stamps_of(t, begin, date, "%I"), None)
    np.testing.assert_allclose(read.values, t, atol=1e-6)
    same = seconds(stamps_of(t, begin, date, "%H"), None)
    np.testing.assert_allclose(same.values, t, atol=1e-6)
    assert not any("from 1 to 12" in note for note in same.notes)


@pytest.mark.parametrize("date", DATED)
def test_over_a_day_and_a_half(date):
    t = 600.0 * np.arange(216)
    read = seconds(stamps_of(t, datetime(2026, 3, 3, 15, 5), date, "%I"), None)
    np.testing.assert_allclose(read.values, t, atol=1e-6)
    assert "noon or midnight passes before row" in read.notes[-1]


@pytest.mark.parametrize("date", [date for date in DATED if date])
@pytest.mark.parametrize("begins", [0.5, 9.25, 11.8, 12.5, 14.0, 23.8])  # h
@pytest.mark.parametrize("fraction", [0.0, 0.25])
def test_the_note_says_since_when(date, begins, fraction):
    """Where anything tells the half of the day: a record that goes on over midnight."""
    begin = datetime(2026, 3, 3) + timedelta(hours=begins, seconds=fraction)
    t = 60.0 * np.arange(60 * int(26 - begins))
    read = seconds(stamps_of(t, begin, date, "%I"), None)
    assert f"seconds since {begin.isoformat().removesuffix('0000')}" in read.notes[0]
    assert read.begin == (begin - datetime(1970, 1, 1)).total_seconds()
    np.testing.assert_allclose(read.values, t, atol=1e-6)


@pytest.mark.parametrize("step", [86401.0, 86399.0, 86400 + 1800, 43200.0 + 7, 7 * 86400 + 1, 3 * 3600.0])
@pytest.mark.parametrize("date", [date for date in DATED if date])
def test_rows_of_one_a_day_are_on_a_clock_of_a_whole_day(step, date):
    t = step * np.arange(8)
    begin = datetime(2026, 3, 3, 12) - timedelta(seconds=2 + 3 * (step % 86400))
    read = seconds(stamps_of(t, begin, date, "%H"), None)
    np.testing.assert_allclose(read.values, t, atol=1e-6)
    assert not any("from 1 to 12" in note for note in read.notes)


def test_a_second_run_is_not_the_afternoon():
    for cells in (["10:00:00", "10:00:01", "09:00:00", "09:00:01"], ["12:00:00", "12:00:01", "09:00:00"]):
        assert np.diff(seconds(np.array(cells, dtype=object), None).values).min() < 0

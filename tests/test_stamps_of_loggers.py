"""Time stamps of historians, of syslog, of Python's logging and of spreadsheets that show no hours, over their ends."""

from __future__ import annotations

import datetime

import numpy as np
import pytest

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.column_facts import table_facts

ROWS = 300
BEGIN = datetime.datetime(2024, 2, 28, 23, 59, 30)
BODY = [f"{k % 7}.25,{k % 5}.125" for k in range(ROWS)]


def seconds(folder, text: str) -> np.ndarray:
    (folder / "log.csv").write_text(text)
    table = read_table(folder / "log.csv")
    facts = table_facts(table)
    assert facts.time is not None
    return table.time(facts.time.column, facts.time.unit).values


def at(step: float) -> list[datetime.datetime]:
    return [BEGIN + datetime.timedelta(seconds=step * k) for k in range(ROWS)]


@pytest.mark.parametrize("step", [1, 60, 3600])  # over midnight and to the leap day, of the hours over several months
@pytest.mark.parametrize("upper", [False, True])
def test_two_digits_of_a_year_behind_the_name_of_a_month(tmp_path, step, upper):
    stamps = [f"{t:%d-%b-%y %H:%M:%S}" for t in at(step)]
    stamps = [stamp.upper() for stamp in stamps] if upper else stamps
    text = "Timestamp,u [V],x [um]\n" + "\n".join(f"{s},{b}" for s, b in zip(stamps, BODY, strict=True)) + "\n"
    np.testing.assert_allclose(seconds(tmp_path, text), step * np.arange(ROWS), atol=1e-9)


@pytest.mark.parametrize("step", [1, 3600])
@pytest.mark.parametrize("before", ["", "<13>"])
def test_the_date_of_syslog(tmp_path, step, before):
    lines = (
        f"{before}{t:%b} {t.day:2d} {t:%H:%M:%S} pc stage[812]: u_V={k % 7}.2 x_um={k % 5}.1"
        for k, t in enumerate(at(step))
    )
    np.testing.assert_allclose(seconds(tmp_path, "\n".join(lines) + "\n"), step * np.arange(ROWS), atol=1e-9)


@pytest.mark.parametrize("separator", ["T", " "])
def test_thousandths_behind_the_comma_that_separates_cells(tmp_path, separator):
    lines = [
        f"{t:%Y-%m-%d}{separator}{t:%H:%M:%S},{t.microsecond // 1000:03d},{b}"
        for t, b in zip(at(0.4), BODY, strict=True)
    ]
    text = "\n".join(lines) + "\n"
    np.testing.assert_allclose(seconds(tmp_path, "asctime,u_V,x_um\n" + text), 0.4 * np.arange(ROWS), atol=1e-9)
    # where the thousandths have a name they are a column
    np.testing.assert_allclose(seconds(tmp_path, "Time,ms,u_V,x_um\n" + text), 0.4 * np.arange(ROWS), atol=1e-9)


def test_minutes_and_seconds_go_on_over_the_hour_where_they_do_so_evenly(tmp_path):
    def of(rows) -> np.ndarray:
        lines = (f"{t:%M:%S}.{t.microsecond // 100000},{b}" for t, b in zip(rows, BODY, strict=True))
        return seconds(tmp_path, "time,u [V],x [um]\n" + "\n".join(lines) + "\n")

    np.testing.assert_allclose(of(at(0.5)), 0.5 * np.arange(ROWS), atol=1e-9)
    again = [t for t in at(0.5) if t.minute == 59][-40:]
    later = [datetime.datetime(2024, 2, 29, 0, 0, 7) + datetime.timedelta(seconds=0.5 * k) for k in range(ROWS - 40)]
    assert np.any(np.diff(of(again + later)) < 0)  # another run, perhaps


def test_an_archive_is_refused_with_what_to_do(tmp_path):
    (tmp_path / "log.zip").write_bytes(b"PK\x03\x04" + bytes(200))
    with pytest.raises(InputError, match="is an archive; unpack it"):
        read_table(tmp_path / "log.zip")

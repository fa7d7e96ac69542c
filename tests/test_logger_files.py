"""A file in the style of each of two dozen loggers is read to its numbers, with the units that it states."""

from __future__ import annotations

import numpy as np
import pytest
from logger_files import LOGGERS, T, U, X

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.stated_rate import stated_rate
from ctrlgen.recordings.formats.unit_texts import unit_of
from ctrlgen.recordings.look.column_facts import table_facts

OTHER_UNITS = {"ROS": "ns", "dates of a spreadsheet": "day"}


@pytest.mark.parametrize("logger", LOGGERS)
def test_the_file_of_a_logger_is_read(logger, tmp_path):
    write, ending, (time, drive, reading), units = LOGGERS[logger]
    path = tmp_path / f"run{ending}"
    path.write_bytes(write())
    table = read_table(path)
    np.testing.assert_array_equal(table.numbers(table.find(drive)), U)
    np.testing.assert_array_equal(table.numbers(table.find(reading)), X)
    stated = {name: unit_of(unit) for name, unit in table.units.items()}
    assert units.items() <= stated.items(), stated
    if time is not None:
        name = table.find(time)
        unit = "ms" if stated.get(name) == "ms" or logger == "TwinCAT" else OTHER_UNITS.get(logger, "s")
        sizes = {"s": 1, "ms": 1e-3, "ns": 1e-9, "day": 86400}
        within = 1e-6 if unit == "day" else 1e-9  # a day in double precision
        np.testing.assert_allclose(table.time(name, unit).values * sizes[unit], T, rtol=0, atol=within)


def test_a_gcs_array_states_its_sample_time(tmp_path):
    path = tmp_path / "run.dat"
    path.write_bytes(LOGGERS["Physik Instrumente"][0]())
    assert {clock.step for clock in read_table(path).clocks.values()} == {1e-3}


def test_days_since_1900_are_no_seconds_and_look_takes_them_as_days(tmp_path):
    path = tmp_path / "run.csv"
    path.write_bytes(LOGGERS["dates of a spreadsheet"][0]())
    table = read_table(path)
    with pytest.raises(InputError, match='write unit = "day"'):
        table.time("Date Time", "s")
    time = table_facts(table).time
    assert time is not None and time.unit == "day" and time.step == pytest.approx(1e-3, rel=1e-3)


def test_the_rate_that_a_header_states_is_told_where_no_column_is_a_time():
    """And what is no rate of rows is not."""
    for line, rate in {
        "# dt=0.001 s": 1000,
        "Interval = 1 ms": 1000,
        "Sampling;1 ms": 1000,
        "Sample rate\t1000 Hz": 1000,
        "Sample Rate (kHz): 20": 20_000,
        "Log Rate,1000": 1000,
        "CH1,CH2,t0 =-3.0e-2s, tInc =1.0e-3,": 1000,
        "Abtastrate: 2,5 kHz": 2500,
    }.items():
        found = stated_rate(["x", line])
        assert found is not None and found[1] == pytest.approx(rate), line
    for line in ("samples=60", "Sample 12", "edit = 5", "Samples: 60", "Width 5 s", "dt = 0"):
        assert stated_rate([line]) is None, line


def test_cells_of_several_units_stay_as_they_are(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("t,u\n" + "".join(f"{t},{'1.5 mV' if k == 9 else '1.5 V'}\n" for k, t in enumerate(T)))
    with pytest.raises(InputError, match="numbers stand alone"):
        read_table(path).numbers("u")

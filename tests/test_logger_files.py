"""A file in the style of each of two dozen loggers is read to its numbers, with the units that it states."""

from __future__ import annotations

import numpy as np
import pytest
from logger_files import LOGGERS, T, U, X

from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.unit_texts import unit_of


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
        unit = "ms" if stated.get(name) == "ms" or logger == "TwinCAT" else "s"
        np.testing.assert_allclose(table.time(name, unit).values * {"s": 1, "ms": 1e-3}[unit], T, rtol=0, atol=1e-9)


def test_a_gcs_array_states_its_sample_time(tmp_path):
    path = tmp_path / "run.dat"
    path.write_bytes(LOGGERS["Physik Instrumente"][0]())
    assert {clock.step for clock in read_table(path).clocks.values()} == {1e-3}

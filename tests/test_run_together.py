"""Columns of fixed width in which one number runs into the next."""

from __future__ import annotations

import numpy as np
import pytest

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.run_together import parted
from ctrlgen.recordings.look.column_facts import table_facts

N = 200
RNG = np.random.default_rng(3)


@pytest.mark.parametrize("form", ["{:9.4f}", "{:+9.4f}", "{:+013.6f}", "{:12.4E}", "{:8.3f}"])
@pytest.mark.parametrize("mark", [".", ","])
@pytest.mark.parametrize("head", ["", "time u x y\n", "# a scan of 17.3.2024\n"])
@pytest.mark.parametrize("columns", [2, 4])
def test_numbers_are_parted_before_their_signs(tmp_path, form, mark, head, columns):
    y = -RNG.uniform(100, 999, (N, columns))
    y[:, 0] = 0.01 * np.arange(N)
    y[::3, 1:] *= 0.01  # some rows have blanks
    lines = ["".join(form.format(v) for v in row).replace(".", mark) for row in y]
    (tmp_path / "a.txt").write_text(head + "\n".join(lines) + "\n")
    table = read_table(tmp_path / "a.txt")
    read = np.column_stack([table.numbers(name) for name in table.columns])
    written = [[float(form.format(v)) for v in row] for row in y]
    np.testing.assert_allclose(read, written, rtol=1e-12)
    together = any(" " not in line.strip() or len(line.split()) < columns for line in lines)
    assert any("run into one another" in note for note in table.notes) == together


@pytest.mark.parametrize(
    "line",
    [
        "0.5 2024-03-05 1.25",
        "2024-03-05T10:00:00.5+01:00 1.5",
        "1.5-104 2.5",  # an exponent of Fortran
        "1.5+2.5j 3.0",
        "05.03.2024-12.30.15 1.5",
        "192.168.1.1 0.5",
        "1.5e-3 -2.5E+10",
        "x-1.5-2.5 3",
        "10.5-20.5mm 3",
    ],
)
def test_other_texts_stay_as_they_are(line):
    assert parted([line] * 5) == ([line] * 5, [])


@pytest.mark.parametrize("mark", [".", ","])
def test_rows_in_which_nothing_parts_two_numbers_are_named(tmp_path, mark):
    y = RNG.uniform(1, 9, (N, 3))
    y[40::9, 1] *= 1000
    rows = "".join("".join(f"{v:8.3f}" for v in row).replace(".", mark) + "\n" for row in y)
    (tmp_path / "a.txt").write_text(rows)
    with pytest.raises(InputError, match="line 41: two numbers run into one another in '"):
        read_table(tmp_path / "a.txt")


def test_whole_numbers_with_signs_alone_are_asked(tmp_path):
    rows = "".join("".join(f"{v:+07.0f}" for v in row) + "\n" for row in RNG.uniform(1e3, 1e5, (N, 3)))
    (tmp_path / "a.txt").write_text(rows)
    (column,) = table_facts(read_table(tmp_path / "a.txt")).columns
    assert "numbers that run into one another" in column.question.what

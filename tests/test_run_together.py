"""Columns of fixed width in which one number runs into the next."""

from __future__ import annotations

import numpy as np
import pytest

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.run_together import parted
from ctrlgen.recordings.formats.written_layout import Layout
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
    assert parted([line] * 5, Layout()) == ([line] * 5, [])


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


TEXTS = ("0.5-1.5", "12.03-2024.5", "-.5+1.5", "1.5+0.1", "0.5-1.5-2.5")


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("separator", ["\t", ";", "|", ",", " ; ", " , ", "\t ", " | "])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_text_between_separators_stays_whole(tmp_path, text, separator, place):
    cells = [[f"{0.1 * k:.1f}", f"{k - 7.25:.2f}", f"{0.2 * k:.3f}"] for k in range(N)]
    for row in cells:
        row.insert(place, text)
    names = ["t", "x", "y"]
    names.insert(place, "band")
    (tmp_path / "a.txt").write_text("\n".join(separator.join(row) for row in [names, *cells]) + "\n")
    table = read_table(tmp_path / "a.txt")
    assert list(table.columns) == names and set(map(str.strip, table.columns["band"])) == {text}
    np.testing.assert_allclose(table.numbers("x"), np.arange(N) - 7.25)
    assert not any("run into" in note for note in table.notes)


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("separator", ["\t", ";", "|", ",", "  "])
@pytest.mark.parametrize("above", ["", "# Butterworth {} Hz\n", "band {} of\n", "% {} {}\n"])
@pytest.mark.parametrize("together", [False, True])
def test_names_and_remarks_stay_whole(tmp_path, text, separator, above, together):
    """Whether numbers run into one another in the rows below, as columns of blanks may, or not."""
    together = together and separator == "  "
    apart = "" if together else separator
    rows = [f"{0.1 * k:.1f}{separator}{-1 - 0.1 * k:.4f}{apart}{-2 - 0.1 * k:.4f}" for k in range(N)]
    names = separator.join(["time(s)", f"{text}kHz", "y(um)"])
    (tmp_path / "a.txt").write_text(above.format(text, text) + names + "\n" + "\n".join(rows) + "\n")
    table = read_table(tmp_path / "a.txt")
    assert list(table.columns) == ["time(s)", f"{text}kHz", "y(um)"]
    np.testing.assert_allclose(table.numbers("y(um)"), -2 - 0.1 * np.arange(N), atol=1e-9)
    assert any("run into" in note and "in line 1" not in note for note in table.notes) == together


@pytest.mark.parametrize("names", ["t 0.5-1.5 1.5-2.5", "x 1.5-2.5+3.5 y", "# 0.5-1.5 1.5-2.5 2.5-3.5"])
def test_bands_are_names(tmp_path, names):
    rows = [f"{k}.5 -{k}.25 {k}.125" if k % 5 else f"{k}.5-{k}.25 {k}.125" for k in range(1, N)]
    (tmp_path / "a.txt").write_text(names + "\n" + "\n".join(rows) + "\n")
    table = read_table(tmp_path / "a.txt")
    assert list(table.columns) == names.removeprefix("# ").split()
    np.testing.assert_allclose(table.numbers(names.split()[-1]), np.arange(1, N) + 0.125)


def test_what_has_one_name_above_it_is_one_cell(tmp_path):
    (tmp_path / "a.txt").write_text("time u y\n" + "".join(f"{k}.5 {k}.25+0.01 {k}.125\n" for k in range(N)))
    table = read_table(tmp_path / "a.txt")
    assert list(table.columns) == ["time", "u", "y"] and table.numbers("y")[3] == 3.125
    with pytest.raises(InputError, match=r"column 'u' holds text that is no number in 200 of 200 rows"):
        table.numbers("u")

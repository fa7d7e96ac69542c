"""Matrices as MATLAB and Octave print them, with one factor in a line of its own above all columns; and the unit of a time that is odd."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ROOT
from logger_files import N, T, U, X

from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import long_text_file, read_table
from ctrlgen.recordings.formats.common_factor import factor_lines
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import propose
from ctrlgen.recordings.reader import load_recordings

NUMBERS = np.column_stack([T, U, X])


def printed(factor: float, columns: np.ndarray = NUMBERS) -> str:
    return "".join(" ".join(f"{value / factor:10.7f}" for value in row) + "\n" for row in columns)


def table_of(folder, text: str):
    (folder / "diary.txt").write_text(text)
    return read_table(folder / "diary.txt")


@pytest.mark.parametrize(
    ("line", "factor"),
    [("   1.0e+03 *", 1e3), ("   1.0e-06 *", 1e-6), ("  1.0000e+03  *", 1e3), ("1.0D+03 *", 1e3), ("x 10^3", 1e3)],
)
@pytest.mark.parametrize("columns", [2, 3])
def test_the_factor_above_a_matrix_multiplies_every_column(tmp_path, line, factor, columns):
    """Of two columns its line has as many words as a row, and is no row of names."""
    table = table_of(tmp_path, f"data =\n\n{line}\n\n{printed(factor, NUMBERS[:, :columns])}")
    assert list(table.columns) == [str(k) for k in range(columns)] and table.lines[0] == 5
    for k, column in enumerate(NUMBERS.T[:columns]):
        np.testing.assert_allclose(table.numbers(str(k)), column, atol=1e-6 * factor)
    told = f"line 3 states a factor for every column: all numbers below it are read times {factor:g}"
    assert table.notes == (told,)
    assert told in table_facts(table).table.notes


def test_a_matrix_without_a_factor_and_a_reading_beside_a_star_are_as_they_were(tmp_path):
    assert table_of(tmp_path, "data =\n\n" + printed(1.0)).notes == ()
    assert not factor_lines(["1.0e+03", "*", "a 1.0e+03 *", "1.0e+03 * V", "1.5 *", "", "x 10"])


def test_the_factor_of_another_matrix_multiplies_nothing_else(tmp_path):
    table = table_of(tmp_path, f"a =\n\n   1.0e+03 *\n\n 0.1 0.2 0.3\n\nb =\n\n{printed(1.0)}")
    np.testing.assert_allclose(table.numbers(table.find(2)), X, atol=1e-6)
    two = f"a =\n\n   1.0e+03 *\n\n{printed(1e3)}\nb =\n\n   1.0e-02 *\n\n{printed(1e-2)}\n"
    (tmp_path / "two.txt").write_text(two)
    for which in (1, 2):
        np.testing.assert_allclose(read_table(tmp_path / "two.txt", which).numbers("2"), X, atol=1e-3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (printed(1.0) + "\n   1.0e+03 *\n\n" + printed(1e3), "states a factor in line 62, between rows"),
        (
            "   1.0e+03 *\n" + printed(1e3).replace(f"{X[3] / 1e3:.7f}", "a", 1),
            "states the factor 1000 in line 1 for every",
        ),
        ("   1.0e+03 *\n\n Columns 1 through 2:\n\n" + printed(1e3), "broken into blocks"),
        ("   1.0e+03 *\n\n         column 1 to 2\n\n" + printed(1e3), "broken into blocks"),
    ],
)
def test_a_factor_that_cannot_multiply_is_refused_with_the_reason(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        table_of(tmp_path, text)


def test_the_factor_of_a_long_file_multiplies_it_to_its_end(tmp_path, monkeypatch):
    monkeypatch.setattr(long_text_file, "LONG", 1000)
    table = table_of(tmp_path, "data =\n\n   1.0e+03 *\n\n" + printed(1e3, np.tile(NUMBERS, (100, 1))))
    np.testing.assert_allclose(table.numbers("2"), np.tile(X, 100), atol=1e-3)
    assert len(table.numbers("2")) == 100 * N and "times 1000" in table.notes[0]


def test_the_advised_unit_of_time_is_another_than_the_written_one(tmp_path):
    """Steps a thousand times too short are usual of a recorder all the same: the record is what is too short."""
    axis = build_model(load_device(ROOT / "tests" / "logs" / "stage.toml"))
    t = 1e-6 * np.arange(240)
    u = np.sin(0.2 * np.arange(240))
    (tmp_path / "log.csv").write_text(
        "t (s),u (V),x (um)\n" + "".join(f"{a:.9g},{b:.6f},{40 * b:.6f}\n" for a, b in zip(t, u, strict=True))
    )
    proposal = propose([table_facts(read_table(tmp_path / "log.csv"))], axis)
    assert proposal.tables[0].time.unit == "s"
    (tmp_path / "recording.toml").write_text(
        'title = "a"\ndevice = "my_stage"\nkind = "series"\n[[record]]\nfile = "log.csv"\nrole = "fit"\n'
        'time = { column = "t (s)", unit = "s" }\n[columns]\n'
        '"drive.axis" = { column = "u (V)", unit = "V" }\n"reading.axis" = { column = "x (um)", unit = "um" }\n'
    )
    said = [
        note for note in load_recordings([tmp_path], axis, hold_out=False).notes if "natural frequency takes" in note
    ]
    assert len(said) == 1 and said[0].endswith("is the unit of its time right?")

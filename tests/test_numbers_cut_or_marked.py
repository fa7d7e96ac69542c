"""Numbers that are no readings by the way they are written: marks among numbers of so many digits, a last number that was cut."""

from __future__ import annotations

import numpy as np
import pytest

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.written_layout import Layout

N = 200
Y = 8 + 3 * np.sin(0.2 * np.arange(N))  # never near a mark
MARKED = (17, 18, 77, 150)


def table_of(folder, cells, layout=None, end: str = "\n", separator: str = ","):
    lines = ["t (s),x (um)".replace(",", separator), *(f"{0.01 * k:.3f}{separator}{c}" for k, c in enumerate(cells))]
    (folder / "log.csv").write_text("\n".join(lines) + end)
    return read_table(folder / "log.csv", None, layout)


def marked(digits: int, mark: str, way: str = "f") -> list[str]:
    return [mark if k in MARKED else f"{y:.{digits}{way}}" for k, y in enumerate(Y)]


@pytest.mark.parametrize("mark", ["0", "-1", "-1.0E-30", "6999", "888888", "1e-300", "-5", "20"])
@pytest.mark.parametrize("digits", [2, 3, 6])
def test_a_mark_that_is_written_otherwise_is_asked_and_answered(tmp_path, mark, digits):
    with pytest.raises(InputError, match=r"4 times, (written without the digits|beyond all) .*missing = \["):
        table_of(tmp_path, marked(digits, mark)).numbers("x (um)")
    left = table_of(tmp_path, marked(digits, mark), Layout(missing=(float(mark),))).numbers("x (um)")
    assert np.flatnonzero(np.isnan(left)).tolist() == list(MARKED)
    kept = table_of(tmp_path, marked(digits, mark), Layout(missing=())).numbers("x (um)")
    assert kept[MARKED[0]] == float(mark) and np.isfinite(kept).all()


@pytest.mark.parametrize("mark", ["1e9", "-1e9", "1000000", "9.999E9", "-99990000", "-999.9"])
def test_a_mark_far_from_all_others_is_left_out(tmp_path, mark):
    cells = [mark if k in MARKED else f"{1e-3 * y:.7f}" for k, y in enumerate(Y)]
    table = table_of(tmp_path, cells)
    assert np.flatnonzero(np.isnan(table.numbers("x (um)"))).tolist() == list(MARKED)
    assert "a mark for none; left out" in table.reading("x (um)").notes[0]


def test_whole_numbers_that_are_readings_are_not_asked(tmp_path):
    through = [f"{y:.3f}" if abs(y) > 0.01 else "0" for y in 0.02 * (np.arange(N) - 100) % 1.5 - 0.5]  # a slow motion
    rests = [f"{y:.3f}" if k % 40 < 20 else "0" for k, y in enumerate(Y)]  # of a drive that is off
    general = [f"{y:.4g}" for y in np.round(Y, 2)]  # without zeros at the end, as many programs write
    once = ["0" if k == 90 else f"{y:.3f}" for k, y in enumerate(Y)]
    for cells in (through, rests, general, once, marked(3, "0.000"), [f"{y:.0f}" for y in Y]):
        assert np.isfinite(table_of(tmp_path, cells).numbers("x (um)")).all()


@pytest.mark.parametrize("way", ["{:.4f}", "{:.6f}", "{:.5E}", "{:.3e}"])
@pytest.mark.parametrize("lost", [1, 2, 3])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_last_number_that_was_not_written_to_its_end_is_left_out(tmp_path, way, lost, separator):
    cells = [way.format(y) for y in Y]
    whole = table_of(tmp_path, cells, end="", separator=separator)
    assert len(whole.numbers("x (um)")) == N and not whole.notes  # many programs end no last line
    cut = table_of(tmp_path, [*cells[:-1], cells[-1][:-lost]], end="", separator=separator)
    assert len(cut.numbers("x (um)")) == N - 1
    assert f"line {N + 1}, the last, ends before its last cell does; left out" in cut.notes


def test_a_last_number_of_fewer_digits_is_kept_where_others_have_fewer_too_or_the_line_ends(tmp_path):
    assert len(table_of(tmp_path, [*(f"{y:.4g}" for y in Y[:-1]), "8.1"], end="").numbers("x (um)")) == N
    assert len(table_of(tmp_path, [*(f"{y:.4f}" for y in Y[:-1]), "8.1"]).numbers("x (um)")) == N
    assert len(table_of(tmp_path, [*(f"{y:.4f}" for y in Y[:-1]), "OVL"], end="").numbers("x (um)")) == N

"""Drives of which rows state some alone: written in turn, at lower rates, with marks of an instrument among them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import record
from conftest import DEVICE
from recorded import described, refused

import ctrlgen
from ctrlgen.recordings import gaps
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.sparse_rows import gathered
from ctrlgen.recordings.look.column_facts import slow_clock
from ctrlgen.recordings.recording import Record

N = 400
ROW = np.arange(N)
A, B = 75 + 50 * np.sin(ROW / 20), 75 + 50 * np.cos(ROW / 20)  # V
COLUMNS = {
    "drive.x": {"column": "a", "unit": "V"},
    "drive.y": {"column": "b", "unit": "V"},
    "reading.delta_x": {"column": "x", "unit": "um"},
}
LEVER = "xy_lever_stage"


@pytest.fixture(scope="module")
def lever():
    return ctrlgen.build_model(ctrlgen.load_device(DEVICE.parent / f"{LEVER}.toml"))


def stated(u: np.ndarray, rows: np.ndarray) -> np.ndarray:
    return np.where(rows, u, np.nan)


def with_drives(*drives: np.ndarray) -> Record:
    one = record(drives[0], ROW, "fit")
    return replace(one, drive=np.column_stack(drives))


def written(folder, name: str, mark: str, nothing: str = "", **columns: np.ndarray) -> None:
    """A log; `mark` stands in one filled cell of every column with gaps, and `nothing` in those that are not filled."""
    lines = [",".join(["t", *columns])]
    for k in range(N):
        cells = [nothing if np.isnan(c[k]) else f"{c[k]:.4f}" for c in columns.values()]
        marked = (mark and np.isnan(c).any() and k == np.flatnonzero(np.isfinite(c))[9] for c in columns.values())
        lines.append(",".join([f"{1e-3 * k:.3f}", *(mark if m else c for c, m in zip(cells, marked, strict=True))]))
    (folder / name).write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("gap", [None, "held", "linear", "split"])
@pytest.mark.parametrize("mark", ["", "OL", "lost"])
def test_drives_that_are_written_in_turn_are_refused_by_name(tmp_path, lever, gap, mark):
    written(tmp_path, "a.csv", mark, a=stated(A, ROW % 2 == 0), b=stated(B, ROW % 2 == 1), x=np.sin(ROW / 20 - 0.1))
    folder = described(tmp_path, {"file": "a.csv", "role": "fit", "gap": gap}, columns=COLUMNS, device=LEVER)
    said = " ".join(refused([folder], lever).values())
    assert "fills a in 200 rows and b in 200, hardly ever the same" in said and "write gap" not in said


@pytest.mark.parametrize("gap", [None, "held", "linear", "split"])
def test_that_no_row_states_every_drive_is_said_where_nothing_else_is(tmp_path, lever, gap):
    """Signs alone for a cell that is not filled, and drives in two files."""
    written(tmp_path, "a.csv", "", "---", a=stated(A, ROW % 2 == 0), x=np.sin(ROW / 20 - 0.1))
    written(tmp_path, "b.csv", "", "---", b=stated(B, ROW % 2 == 1))
    columns = COLUMNS | {"drive.y": {**COLUMNS["drive.y"], "file": "b.csv"}}
    folder = described(tmp_path, {"file": "a.csv", "role": "fit", "gap": gap}, columns=columns, device=LEVER)
    said = " ".join(refused([folder], lever).values())
    assert "no row states every drive" in said and "write gap" not in said


def test_split_is_no_answer_that_is_proposed_again(tmp_path, lever):
    slow = ROW % 10 == 0
    written(tmp_path, "a.csv", "", a=stated(A, slow), b=stated(B, slow), x=np.sin(ROW / 20 - 0.1))
    record_of = {"file": "a.csv", "role": "fit", "gap": "split"}
    said = refused([described(tmp_path, record_of, columns=COLUMNS, device=LEVER)], lever)["record[0]"]
    assert said.startswith("a.csv: the drive is not known") and 'in place of "split"' in said


def test_a_mark_of_an_instrument_is_a_cell_that_was_filled(tmp_path):
    """Two sensors that hand over to each other: each reads OL where the other reads."""
    rows = "".join(f"{k},{'OL' if k < 50 else k},{k if k < 50 else 'OL'}\n" for k in range(100))
    (tmp_path / "a.csv").write_text("t,near,far\n" + rows)
    table = read_table(tmp_path / "a.csv")
    assert not table.differing_times(["t", "near", "far"])
    dashes = (tmp_path / "a.csv").read_text().replace("OL", "---")
    (tmp_path / "a.csv").write_text(dashes)
    assert "hardly ever the same" in read_table(tmp_path / "a.csv").differing_times(["t", "near", "far"])


def test_rows_of_one_instant_are_one_whatever_stands_in_the_cells_that_are_not_filled(tmp_path):
    rows = "".join(f"{k},{k}.5,---\n{k},---,{-k}.5\n" for k in range(100))
    (tmp_path / "a.csv").write_text("t,a,b\n" + rows)
    table = read_table(tmp_path / "a.csv")
    assert table is gathered(table) and len(table.columns["t"]) == 100
    np.testing.assert_array_equal(table.numbers("b")[1:], -0.5 - np.arange(1, 100))


@pytest.mark.parametrize(
    "a, b, every",
    [
        (ROW % 10 == 0, ROW % 10 == 0, 10),
        (ROW % 10 == 0, ROW % 10 == 5, 1),
        (ROW >= 0, ROW % 10 == 3, 10),
        (ROW % 10 == 0, ROW % 5 == 0, 10),
        (ROW % 2 == 0, ROW % 3 == 0, 6),
        (ROW >= 0, ROW >= 0, 1),
        (ROW % 7 != 0, ROW >= 0, 1),
        (ROW % 10 == 0, (ROW % 10 == 0) & (ROW != 50), 1),
    ],
)
@pytest.mark.parametrize("gap", ["held", "linear"])
def test_a_lower_rate_is_proposed_where_it_can_be_bridged_and_by_what_each_drive_states(a, b, every, gap):
    drives = stated(A, a), stated(B, b)
    assert slow_clock(np.column_stack(drives)) == every
    if every == 1:
        return
    (bridged,), _ = gaps.stretches(with_drives(*drives), gap)
    rows = np.round(bridged.time / 1e-3).astype(int)
    for read, u, filled in zip(bridged.drive.T, (A, B), (a, b), strict=True):
        known = np.flatnonzero(filled)
        wanted = u[known[np.searchsorted(known, rows, "right") - 1]]
        wanted = np.interp(rows, known, u[known]) if gap == "linear" else wanted
        np.testing.assert_allclose(read, wanted, atol=1e-12)

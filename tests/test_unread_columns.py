"""Columns whose cells are no plain numbers: the first cell and the reason are named where such a column is chosen as a signal."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ROOT
from logger_files import T, U

from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.answers import Answers
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import propose


def refused(path) -> str:
    """What is said where its column x is named as the reading."""
    axis = build_model(load_device(ROOT / "tests" / "logs" / "stage.toml"))
    answers = Answers(columns={"reading.axis": "x"})
    with pytest.raises(InputError) as error:
        propose([table_facts(read_table(path), answers)], axis, answers)
    return error.value.faults[0].what


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        ([f"0x{k:04X}" for k in range(60)], ("line 2 '0x0000'", "hexadecimal numbers")),
        ([f"{k}.5 mV" if k < 30 else f"0.{k} V" for k in range(60)], ("line 2 '0.5 mV'", "in several units (mV, V)")),
        ([f"=B{k}*2" for k in range(60)], ("line 2 '=B0*2'", "a formula that was never calculated")),
        (["7"] * 60, ("holds no numbers that differ: 7 in every row",)),
        (["nan"] * 60, ("holds no number in any row",)),
    ],
)
def test_the_cell_and_the_reason_are_named(tmp_path, cells, said):
    text = "".join(f"{t},{u},{x}\n" for t, u, x in zip(T, U, cells, strict=True))
    (tmp_path / "log.csv").write_text("t (s),u (V),x\n" + text)
    told = refused(tmp_path / "log.csv")
    assert all(part in told for part in said), told


def test_a_formula_of_a_workbook_without_its_value_is_named_and_calculated_ones_are_read(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["t (s)", "u (V)", "x"])
    for k, (t, u) in enumerate(zip(T, U, strict=True)):
        book.active.append([float(t), float(u), f"=40*B{k + 2}"])
    book.save(tmp_path / "log.xlsx")
    table = read_table(tmp_path / "log.xlsx")
    np.testing.assert_allclose(table.numbers("u (V)"), U)
    told = refused(tmp_path / "log.xlsx")
    assert "line 2 '=40*B2'" in told and "a formula that was never calculated" in told


def test_negative_numbers_in_brackets_are_named_and_not_offered_as_missing(tmp_path):
    cells = [f"{k / 8}" if k % 3 else f"({(k + 1) / 8})" for k in range(1, 61)]
    text = "".join(f"{t},{u},{x}\n" for t, u, x in zip(T, U, cells, strict=True))
    (tmp_path / "log.csv").write_text("t (s),u (V),x\n" + text)
    said, told = "in brackets, as accountants", refused(tmp_path / "log.csv")
    assert said in told and "missing = [" not in told
    asked = [c.question for c in table_facts(read_table(tmp_path / "log.csv")).columns if c.question is not None]
    assert len(asked) == 1 and said in str(asked[0])  # look says so unasked


def test_every_text_is_offered_as_missing_or_the_others_are_counted(tmp_path):
    for count, more in ((12, ""), (25, "with 5 more texts of the column ")):
        cells = [f"FAULT {k}" if 0 < k <= count else f"{k}" for k in range(60)]
        text = "".join(f"{t},{u},{x}\n" for t, u, x in zip(T, U, cells, strict=True))
        (tmp_path / "log.csv").write_text("t (s),u (V),x\n" + text)
        told = refused(tmp_path / "log.csv")
        assert told.count("FAULT") == 5 + min(count, 20), told
        assert f"]' {more}if that means a missing reading" in told

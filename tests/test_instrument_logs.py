"""Logs as instruments of a laboratory export them: numbers, units and time that were read wrong unasked, or asked without need."""

from __future__ import annotations

import numpy as np
import pytest
from logger_files import N, T, U, X, rows

from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import propose


@pytest.fixture(scope="module")
def axis():
    return build_model(load_device("tests/logs/stage.toml"))


@pytest.fixture
def facts(tmp_path):
    def read(content: str, name: str = "log.csv", encoding: str = "utf-8"):
        (tmp_path / name).write_bytes(content.encode(encoding))
        return table_facts(read_table(tmp_path / name))

    return read


def cells(mark: str, *columns) -> str:
    return "".join(mark.join(map(str, row)) + "\n" for row in zip(*columns, strict=True))


def test_a_time_in_long_steps_without_a_unit_is_asked_and_a_header_that_states_the_rate_answers(facts, axis):
    ms = 1e3 * T + 0.25
    asked = propose([facts("time,u [V],x [um]\n" + rows(",", ms, U, X))], axis).asked
    assert any("--unit time=s" in question for question in asked)
    for head, clock in (("Sample rate: 1000 Hz", ms), ("# dt = 1 ms", T), ("Sample interval,0.001", 1e3 * T)):
        seen = facts(f"{head}\ntime,u [V],x [um]\n" + rows(",", clock, U, X))
        assert seen.time.step == pytest.approx(1e-3) and not propose([seen], axis).asked, head
    asked = propose([facts("Sample rate: 7 Hz\ntime,u [V],x [um]\n" + rows(",", ms, U, X))], axis).asked
    assert any("but the file says 'Sample rate: 7 Hz' (--rate 7Hz)" in question for question in asked)
    assert not propose([facts("time,u [V],x [um]\n" + rows(",", T, U, X))], axis).asked


def test_units_behind_names_count_in_every_format(tmp_path, axis):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    pandas.DataFrame({"Time (ms)": 1e3 * T + 0.25, "u (mV)": 1e3 * U, "x (nm)": 1e3 * X}).to_parquet(tmp_path / "log.parquet")
    seen = table_facts(read_table(tmp_path / "log.parquet"))
    assert seen.time.step == pytest.approx(1e-3) and [c.unit for c in seen.columns] == ["ms", "mV", "nm"]
    assert propose([seen], axis).certain


def test_points_between_thousands_are_asked_whatever_separates_the_cells(facts):
    whole = [f"{1000 * k + 682:,}".replace(",", ".") if k else "682" for k in range(N)]
    for mark in "\t;|":
        with pytest.raises(InputError, match=r"whether that is \d+\.682 or"):
            facts(cells(mark, ["t"], ["x"]) + cells(mark, range(N), whole))
    decimals = [f"{k + 0.682:.3f}" for k in range(N)]
    assert facts(cells("\t", ["t"], ["x"]) + cells("\t", range(N), decimals)).columns[1].values[1] == 1.682


def test_numbers_that_programs_write_otherwise_are_read_and_told(facts):
    forms = {"1.5-": -1.5, "\u20131.5": -1.5, "- 1.5": -1.5, "1.5*10^-3": 1.5e-3, "1.5 E-03": 1.5e-3, "1.5\u00d710^2": 150.0}
    for form, number in forms.items():
        column = facts(f"t;x\n0;0\n1;{form}\n2;1\n").columns[1]
        assert column.values.tolist() == [0, number, 1], form
        assert any(f"numbers such as {form!r}" in note for note in column.notes), form


def test_displays_without_a_reading_are_missing_and_told(facts):
    for word in ("-", "#####", "*", "-----.--", ">>>>", "OVR", "Over", "-OL-", "No Data", "NotANumber", "n.a."):
        column = facts(f"t,x\n0,0\n1,{word}\n2,1\n3,2\n").columns[1]
        assert column.missing == 1 and any(repr(word) in note for note in column.notes), word
    question = facts(cells(",", ["t"], ["x"]) + cells(",", range(N), [f"{k + 1}_000.5" if k else "1.5" for k in range(N)])).columns[1].question
    assert "marks that are not known" in str(question) and "missing" not in str(question)


def test_the_present_position_is_no_electric_current_and_words_are_seen_in_one(facts, axis):
    head = "Time [s],Target Position,Current Position,Control Voltage [V]\n"
    found = propose([facts(head + rows(",", T, X, X, U))], axis).matches
    assert [m.column for m in found] == ["Control Voltage [V]", "Current Position"]
    found = propose([facts("Time [s],ActPos,VoltCmd\n" + rows(",", T, X, U))], axis).matches
    assert [m.column for m in found] == ["VoltCmd", "ActPos"]


def test_a_question_lists_free_columns_with_their_units_and_why_text_is_none(facts, axis):
    asked = propose([facts("t [s],u [V],sensor (V)\n" + rows(",", T, U, U))], axis).asked
    assert any("which is it? Free are sensor (V) (--column" in question for question in asked)
    text = "t [s];u [V];x [um]\n" + cells(";", T, U, [f"{x} um of 5" for x in X])
    asked = propose([facts(text)], axis).asked
    assert any("Free are none; column 'x [um]' holds text that is no number in 60 of 60 rows" in q for q in asked)

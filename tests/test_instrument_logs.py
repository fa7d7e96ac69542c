"""Logs as instruments of a laboratory export them: numbers, units and time that were read wrong unasked, or asked without need."""

from __future__ import annotations

import json

import numpy as np
import pytest
from logger_files import N, T, U, X, rows

from ctrlgen.app.look_console import print_table
from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.stated_rate import rate_of, stated_rate
from ctrlgen.recordings.formats.unit_texts import split_name
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.oddities import table_oddities
from ctrlgen.recordings.look.proposal import propose
from ctrlgen.recordings.look.proposed_file import recording_toml


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
    for head, clock in (("Sample rate: 1000 Hz", ms), ("Sample interval,0.001", 1e3 * T)):
        seen = facts(f"{head}\ntime,u [V],x [um]\n" + rows(",", clock, U, X))
        (asked,) = propose([seen], axis).asked
        assert f"ms is assumed, as {head!r} says, 0.001 s from row to row (--unit time=ms)" in asked
    assert not propose([facts("# dt = 1 s\ntime,u [V],x [um]\n" + rows(",", 1e3 * T, U, X))], axis).asked
    asked = propose([facts("Sample rate: 7 Hz\ntime,u [V],x [um]\n" + rows(",", ms, U, X))], axis).asked
    assert any("but the file says 'Sample rate: 7 Hz' (--rate 7Hz)" in question for question in asked)
    assert not propose([facts("time,u [V],x [um]\n" + rows(",", T, U, X))], axis).asked


def test_units_behind_names_count_in_every_format(tmp_path, axis):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    pandas.DataFrame({"Time (ms)": 1e3 * T + 0.25, "u (mV)": 1e3 * U, "x (nm)": 1e3 * X}).to_parquet(
        tmp_path / "log.parquet"
    )
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
    forms = {
        "1.5-": -1.5,
        "\u20131.5": -1.5,
        "- 1.5": -1.5,
        "1.5*10^-3": 1.5e-3,
        "1.5 E-03": 1.5e-3,
        "1.5\u00d710^2": 150.0,
    }
    for form, number in forms.items():
        column = facts(f"t;x\n0;0\n1;{form}\n2;1\n").columns[1]
        assert column.values.tolist() == [0, number, 1], form
        assert any(f"numbers such as {form!r}" in note for note in column.notes), form


def test_displays_without_a_reading_are_missing_and_told(facts):
    for word in ("-", "#####", "*", "-----.--", ">>>>", "OVR", "Over", "-OL-", "No Data", "NotANumber", "n.a."):
        column = facts(f"t,x\n0,0\n1,{word}\n2,1\n3,2\n").columns[1]
        assert column.missing == 1 and any(repr(word) in note for note in column.notes), word
    question = (
        facts(cells(",", ["t"], ["x"]) + cells(",", range(N), [f"{k + 1}_000.5" if k else "1.5" for k in range(N)]))
        .columns[1]
        .question
    )
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


def test_units_stand_after_marks_and_in_cyrillic_and_one_byte_of_msdos_is_no_sign_of_chinese(facts):
    for head in ("time, ms;drive, V;x, um", "time - ms;drive - V;x - um", "time:ms;drive:V;x:um"):
        assert [c.unit for c in facts(head + "\n" + rows(";", 1e3 * T + 0.25, U, X)).columns] == ["ms", "V", "um"], head
    cyrillic = "\u0412\u0440\u0435\u043c\u044f, \u043c\u0441;U (\u0412);x \u0434\u0430\u0442\u0447\u0438\u043a\u0430 (\u043c\u043a\u043c)\n"
    seen = facts(cyrillic + rows(";", 1e3 * T, U, X), encoding="cp1251")
    assert [c.unit for c in seen.columns] == ["ms", "V", "um"] and seen.time.step == pytest.approx(1e-3)
    for encoding in ("cp437", "cp850"):
        assert facts("t [s];u [V];x [µm]\n" + rows(";", T, U, X), encoding=encoding).columns[2].unit == "um"
    assert [split_name(name)[1] for name in ("phase, A", "x, y", "a - b", "V(out),1")] == [None] * 4


def test_what_an_oscilloscope_states_above_the_names_gives_the_units_and_no_other_line_does(facts, axis):
    head = "Model,MSO54\nSample Interval,1e-3,\nVertical Units,V,um\nVertical Offset,0,0\nLabel,,\nTIME,CH1,CH2\n"
    seen = facts(head + rows(",", T, U, X))
    assert [c.unit for c in seen.columns] == [None, "V", "um"] and [c.name for c in seen.columns] == [
        "TIME",
        "CH1",
        "CH2",
    ]
    head = "Vertical Units,CH1:V,CH2:um\nSource,CH1,CH2\nSecond,Volt,um\n"
    assert [c.unit for c in facts(head + rows(",", T, U, X)).columns] == ["s", "V", "um"]
    seen = facts("Time(s),CH1(V),CH2(um),t0 =-3e-1, tInc = 1e-3,\n" + rows(",", T, U, X))
    assert propose([seen], axis).certain and seen.time.step == pytest.approx(1e-3)
    assert [c.name for c in facts("'t [s]','u [V]'\n" + rows(",", T, U)).columns] == ["t [s]", "u [V]"]
    head = "Name,u,x\nUnit,V,um\n" + "".join(f"Setting {k},{k},{k}\n" for k in range(9)) + "\n"
    notes = facts(head + rows(",", T, U, X)).table.notes
    assert any(note.endswith("hold neither names nor units") for note in notes) and len(notes) < 5


def test_a_stated_rate_is_that_of_its_unit_and_none_where_the_unit_is_not_known():
    rates = {
        "Sampling rate: 1 kS/s": 1e3, "Sample rate: 1000 S/s": 1e3, "Fs = 5 kHz": 5e3, "Abtastrate;1000;Hz": 1e3, "# rate 50 Hz": 50.0,
        '"SampleRate",1000,1000': 1e3, "Sampling cycle,1000us": 1e3, "GatheringPeriod\t0.001": 1e3, "Abtastzeit: 1,0 ms": 1e3,
        "SampleTime[ms]\t1\tSampleTime[ms]\t1": 1e3, "sample rate 2 MSa/s": 2e6, "Sample Rate: 1000 samples/sec": 1e3,
    }  # fmt: skip
    for text, rate in rates.items():
        assert stated_rate([text])[1] == pytest.approx(rate), text
    for text in ("Sample rate: 5 furlongs", "rate 5", "refresh rate 60 Hz", "FS = 10 V", "baud rate: 9600"):
        assert stated_rate([text]) is None, text
    for name, value in (("Fs", 1000.0), ("dt", 1e-3), ("Tinterval", 1e-3), ("sample_rate_hz", 1000), ("rate", "1 kHz")):
        assert rate_of([("title", "a"), (name, value)])[1] == pytest.approx(1e3), name


def test_rates_beside_columns_are_offered_and_clocks_of_waveforms_are_no_question(tmp_path, facts, axis, capsys):
    seen = facts(json.dumps({"dt": 1e-3, "u": U.tolist(), "x": X.tolist()}), "log.json")
    assert any("the file says 'dt = 0.001' (--rate 1000Hz" in question for question in propose([seen], axis).asked)
    channels = {"time": ("ms", 1e3 * T + 0.25), "drive": ("V", U), "position": ("um", X)}
    content = {name: {"unit": unit, "values": values.tolist()} for name, (unit, values) in channels.items()}
    seen = facts(json.dumps(content), "log.json")
    assert seen.time.step == pytest.approx(1e-3) and propose([seen], axis).certain
    nptdms = pytest.importorskip("nptdms")
    stated = {"wf_increment": 1e-3, "wf_start_offset": 0.0, "wf_samples": N}
    with nptdms.TdmsWriter(tmp_path / "log.tdms") as file:
        file.write_segment(
            [
                nptdms.ChannelObject("g", n, v, {**stated, "unit_string": u})
                for n, v, u in (("u", U, "V"), ("x", X, "um"))
            ]
        )
    seen = table_facts(read_table(tmp_path / "log.tdms"))
    print_table(seen)
    assert "60 rows, 1000 Hz, 0.06 s, as the file states of its channels" in capsys.readouterr().out
    proposal = propose([seen], axis)
    assert proposal.certain and 'sample_rate = "1000 Hz"\n' in recording_toml(proposal, tmp_path, "t")


@pytest.mark.parametrize(
    ("begin", "step", "size"), [(59.98, 1e-3, 60), (970, 1, 1000), (2**24 - 3e4, 1000, 2**24), (3599.98, 1e-3, 3600)]
)
def test_a_clock_goes_on_where_it_begins_again_and_a_second_run_does_not(facts, begin, step, size):
    clock = np.round((begin + step * np.arange(N)) % size, 6)
    time = facts("t (s),x\n" + rows(",", clock, X)).time
    assert time.step == pytest.approx(step) and not time.backward and any("begins again" in note for note in time.notes)
    twice = np.concatenate([T[: N // 2], T[: N // 2]])
    assert facts("t (s),x\n" + rows(",", twice, X)).time.backward


def test_a_column_that_rises_evenly_is_no_drive_and_offered_as_the_time(facts, axis):
    proposal = propose([facts(rows(",", T, U, X))], axis)
    assert [m.column for m in proposal.matches] == ["1", "2"] and any(
        "--time 0," in question for question in proposal.asked
    )
    ramp = propose([facts("drive,x\n" + rows(",", T, X))], axis)  # a drive may rise evenly
    assert [m.column for m in ramp.matches] == ["drive", "x"]


def test_stamps_that_are_too_coarse_are_told(facts):
    stamps = [f"2024-03-05 10:00:{k // 30:02d}" for k in range(N)]
    odd = table_oddities(facts("time,u,x\n" + cells(",", stamps, U, X)))
    assert any("stands still in 58 of 59 rows" in remark for remark in odd)
    over = [f"{k / N:.6f}" for k in range(N)]
    seen = facts("Time,Fractional Seconds,x\n" + cells(",", ["10:00:00"] * N, over, X))
    assert seen.time.step == pytest.approx(1 / N, rel=1e-4)


def test_many_columns_are_counted_and_not_listed(facts, axis, capsys):
    names = ["t [s]", "u [V]", "x [um]", *(f"aux{k} [K]" for k in range(200))]
    seen = facts(",".join(names) + "\n" + rows(",", T, U, X, *(X + k for k in range(1, 201))))
    print_table(seen)
    assert "and 163 more columns, aux37 [K] to aux199 [K]" in capsys.readouterr().out
    text = recording_toml(propose([seen], axis), seen.table.path.parent, "t")
    assert "aux19 [K], 180 more" in text

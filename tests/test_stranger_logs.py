"""Logs whose lines name their numbers, that fill some columns a row, or that hold no readings: read to their numbers, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from logger_files import N, T, U, X
from stranger_logs import READ, REFUSED, UNITS, lines

from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.foreign_text import CAN, foreign
from ctrlgen.recordings.formats.named_lines import are_named
from ctrlgen.recordings.formats.unit_texts import split_name, unit_of
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import propose
from ctrlgen.recordings.reader import load_recordings


def table_of(folder, text: str, name: str = "log.csv"):
    (folder / name).write_text(text)
    return read_table(folder / name)


def test_what_programs_write_is_read_to_its_numbers(tmp_path):
    for program, text in READ.items():
        table = table_of(tmp_path, text)
        scale = 1e-6 if program == "circuit simulator" else 1.0
        wanted = (1, 2) if program == "Arduino's monitor" else ("u", "x")
        names = [table.find(name) for name in wanted]
        np.testing.assert_allclose(table.numbers(names[0]), U, rtol=1e-5, err_msg=program)
        np.testing.assert_allclose(table.numbers(names[1]), scale * X, rtol=1e-5, atol=1e-12, err_msg=program)
        if program in UNITS:
            assert tuple(unit_of(table.unit(name) or "") for name in names) == UNITS[program], program
        time = table_facts(table).time
        if program != "long rows of Zurich Instruments":  # ticks
            assert time is not None and time.step == pytest.approx(1e-3, rel=1e-2) and not time.backward, program


def test_what_holds_no_readings_is_refused_with_the_reason(tmp_path):
    for program, (text, said) in REFUSED.items():
        with pytest.raises(InputError) as refused:
            table_of(tmp_path, text)
        assert said in str(refused.value), (program, str(refused.value))


def test_words_of_a_bus_in_names_and_comments_make_no_trace_of_it():
    for head in (
        "t [s],x extended [um],length [um],data",
        "# Measurement identifier: 4711, data of stage B\nt [s],u,x",
    ):
        assert not foreign([*head.split("\n"), *(f"{t},{u},{x},1" for t, u, x in zip(T, U, X, strict=True))])
    assert foreign(["time;identifier;flags;data bytes", *(f"{t};291;0;41 0A" for t in T)]) == CAN


def test_lines_of_other_texts_are_none_that_name_their_numbers():
    header = [f"Key{k}=5" for k in range(9)] + ["t,u"] + ["0,1"] * 3
    assert not are_named(header) and not are_named(["t,u", *["10:00:00,1"] * 9]) and not are_named(["a: 5"] * 2)
    assert are_named(["t=1 u=2"] * 3) and not are_named(["t=1 u=2"] * 2)


def test_what_was_left_out_of_lines_is_told(tmp_path):
    notes = table_of(tmp_path, READ["logging of Python"]).notes
    assert notes == (
        "each line names its numbers (x, u): read as columns, the time before them as 'time'",
        "1 line names no number and is left out",
    )
    told = table_of(tmp_path, READ["PlotJuggler"]).notes
    assert told == (f"{2 * N} rows fill some columns each: those of one __time are read as one row, {N} in all",)
    told = table_of(tmp_path, READ["circuit simulator"]).notes
    assert told == (
        "u (V): its cells end in m, read as prefixes of SI",
        "x (m): its cells end in u, read as prefixes of SI",
    )


def test_an_m_in_every_cell_is_thousandths_where_the_name_has_another_unit(tmp_path):
    text = lines("t,{}\n", lambda k: f"{T[k]},{k}m")
    np.testing.assert_allclose(table_of(tmp_path, text.format("u (V)")).numbers("u (V)"), 1e-3 * np.arange(N))
    with pytest.raises(InputError, match="metres, or thousandths"):
        table_of(tmp_path, text.format("u")).numbers("u")


def test_ranges_that_change_from_row_to_row_are_told(tmp_path):
    text = lines("t,x,x unit,gain\n", lambda k: f"{T[k]},{X[k]},{'um' if k % 2 else 'mm'},{1 + k % 2}")
    notes = table_of(tmp_path, text).notes
    assert "x unit: states units that differ from row to row (mm, um), not applied: write one" in notes
    assert "gain: goes from 1 to 2 and is not applied, should numbers beside it lack it" in notes


def test_what_a_glass_scale_reads_is_no_factor_of_another_column(tmp_path):
    text = lines("t,command,scale\n", lambda k: f"{T[k]},{X[k]},{X[k] + 0.25}")
    assert not table_of(tmp_path, text).notes


def test_the_unit_after_a_word():
    assert split_name("C1 in V") == ("C1", "V") and split_name("in s") == ("in s", "s")
    assert split_name("built in x") == ("built in x", None) and split_name("Weg in") == ("Weg in", None)


@pytest.fixture(scope="module")
def axis():
    return build_model(load_device("tests/logs/stage.toml"))


def test_columns_that_are_hardly_ever_filled_together_are_refused(tmp_path, axis):
    text = lines("t,u,x\n", lambda k: f"{T[k]:.6f},{U[k]},\n{T[k] + 3e-4:.6f},,{X[k]}")
    facts = table_facts(table_of(tmp_path, text))
    with pytest.raises(InputError, match="fills u in 60 rows and x in 60, hardly ever the same"):
        propose([facts], axis)


def test_numbers_of_rows_and_other_times_are_no_signals_and_ticks_are_asked(tmp_path, axis):
    text = lines("Scan,t,stamp,u,x\n", lambda k: f"{k},{T[k]},{1709632800000 + k},{U[k]},{X[k]}")
    proposal = propose([table_facts(table_of(tmp_path, text))], axis)
    assert [m.column for m in proposal.matches] == ["u", "x"] and not any("time is column" in q for q in proposal.asked)
    proposal = propose([table_facts(table_of(tmp_path, READ["long rows of Zurich Instruments"]))], axis)
    assert any("s is assumed, 60 s from row to row (--unit timestamp=s)" in question for question in proposal.asked)


def test_channels_of_several_rasters_of_mdf_are_read_each_on_its_clock(tmp_path, axis):
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed: MDF was not read")
    slow = T[::2]
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(U, T, name="u", unit="V")])
        file.append([asammdf.Signal(X[::2], slow, name="x", unit="um")])
        file.save(tmp_path / "log.mf4")
    (tmp_path / "recording.toml").write_text(
        'title = "a"\ndevice = "my_stage"\nkind = "series"\n[[record]]\nfile = "log.mf4"\nrole = "fit"\n'
        'table = "all rasters, each channel on its own clock"\nsample_rate = "1 kHz"\n'
        '[columns]\n"drive.axis" = { column = "u", unit = "V" }\n"reading.axis" = { column = "x", unit = "um" }\n'
    )
    recording = load_recordings([tmp_path], axis, hold_out=False)
    seen = np.concatenate([record.observed[:, 0] for record in recording.records])
    np.testing.assert_allclose(1e6 * seen[: 2 * len(slow) - 1 : 2], X[::2], rtol=1e-9)
    assert any("reading.axis is read every 0.002 s" in note for note in recording.notes)

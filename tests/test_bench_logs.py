"""Logs of the bench are read to their numbers, units and time, or what is doubtful is told; no one is read otherwise in silence."""

from __future__ import annotations

import numpy as np
import pytest
from bench_logs import BENCH, HEAD, T, U, X, csv, rows

from ctrlgen.core.errors import InputError
from ctrlgen.core.units import to_si
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import long_text_file, read_table
from ctrlgen.recordings.look.answers import read_answers
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.oddities import table_oddities
from ctrlgen.recordings.look.proposal import propose
from ctrlgen.recordings.look.proposed_file import recording_toml
from ctrlgen.recordings.reader import load_recordings


@pytest.fixture(scope="module")
def axis():
    return build_model(load_device("tests/logs/stage.toml"))


def found_in(facts, proposal):
    """The signals' numbers in SI by name, and the time since the first row."""
    numbers = {
        m.signal: facts.table.numbers(m.column) * m.scale * (to_si(1.0, m.unit) - to_si(0.0, m.unit))
        for m in proposal.matches
    }
    if facts.time is not None:
        scale = facts.column(facts.time.column).scale
        numbers["time"] = (
            facts.table.time(facts.time.column, facts.time.unit, scale).values * scale * to_si(1.0, facts.time.unit)
        )
    return numbers


@pytest.mark.parametrize("name", BENCH)
def test_a_log_of_the_bench_is_read_rightly_or_told(name, tmp_path, axis):
    log = BENCH[name]
    path = tmp_path / "log.csv"
    path.write_bytes(log.text.encode(log.encoding))
    said: list[str] = []
    try:
        facts = table_facts(read_table(path))
        proposal = propose([facts], axis)
        said += [*facts.table.notes, *table_oddities(facts), *proposal.asked, *proposal.remarks]
        said += [note for column in facts.columns for note in column.notes]
        assert not log.refused or proposal.certain, said
        if proposal.certain:
            (tmp_path / "recording.toml").write_text(recording_toml(proposal, tmp_path, "a"))
            said += load_recordings([tmp_path], axis, hold_out=False).notes
    except InputError as error:
        said += [fault.what for fault in error.faults]
        assert log.refused, said
    else:
        assert not log.refused and (log.open_ or proposal.certain), said
        numbers = found_in(facts, proposal)
        true = {"time": T if log.t is None else log.t, "drive.axis": U if log.u is None else log.u}
        true["reading.axis"] = 1e-6 * (X if log.x is None else log.x)
        if proposal.certain:
            for signal, within in {"time": log.within, "drive.axis": 1e-9, "reading.axis": 1e-12}.items():
                if signal == "time" and signal not in numbers:  # a clock that the format states
                    assert facts.clock_step == T[1]
                    continue
                np.testing.assert_allclose(
                    numbers[signal], true[signal] - (true[signal][0] if signal == "time" else 0), rtol=1e-9, atol=within
                )
    for words in log.told:
        assert any(words in line for line in said), (words, said)


def facts_of(folder, text, answers=None):
    (folder / "log.csv").write_text(text)
    table = read_table(folder / "log.csv")
    return table_facts(table) if answers is None else table_facts(table, answers)


def answered(*columns, units=(), time=None, rate=None):
    return read_answers(None, None, columns, units, time, rate, False)


def test_a_reading_in_volts_is_asked_for_what_one_is_and_read_with_the_answer(tmp_path, axis):
    text = csv("t (s),u (V),probe (V)\n", x=X / 10)
    chosen = answered("reading.axis=probe (V)")
    with pytest.raises(InputError, match=r"where one V is so much of it, say how much: --unit reading.axis=10um"):
        propose([facts_of(tmp_path, text, chosen)], axis, chosen)
    chosen = answered("reading.axis=probe (V)", units=("reading.axis=10um",))
    proposal = propose([facts_of(tmp_path, text, chosen)], axis, chosen)
    np.testing.assert_allclose(found_in(proposal.tables[0], proposal)["reading.axis"], 1e-6 * X, atol=1e-12)


def test_the_answer_that_is_proposed_for_lost_rows_places_them(tmp_path, axis):
    log = BENCH["rows lost, told by their number"]
    chosen = answered(time="seq", units=("seq=1ms",))
    facts = facts_of(tmp_path, log.text, chosen)
    proposal = propose([facts], axis, chosen)
    assert proposal.certain and facts.time.gaps == ((49, 3),)
    np.testing.assert_allclose(found_in(facts, proposal)["time"], np.delete(T, [50, 51, 52]), atol=1e-9)


def test_the_word_for_an_actual_value_makes_a_column_the_reading(tmp_path, axis):
    text = "t (s),aux (um),Istwert (um),Spannung (V)\n" + rows(",", T, 0.5 * X, X, U)
    assert [m.column for m in propose([facts_of(tmp_path, text)], axis).matches] == ["Spannung (V)", "Istwert (um)"]


def test_what_ordinary_logs_hold_is_none_of_this(tmp_path):
    """Few fractions, rounded instants, a state in turn, a clock by its own step, a remark with a star among rows."""
    few = "".join(f"{k},{0.1 * k:.2f}\n" for k in range(1, 9)) + "9,1.5\n"
    assert not facts_of(tmp_path, "t (s),x\n" + few).table.notes
    beats = "t (s),alive,x\n" + rows(",", T, np.arange(len(T)) % 2, X)
    assert "alive" in facts_of(tmp_path, beats).table.columns
    lost = "t (s),u (V),x (um)\n" + rows(",", T, U, ["*****" if k == 5 else f"{v}" for k, v in enumerate(X)])
    assert facts_of(tmp_path, lost).columns[2].missing == 1
    one_day = "Date,Time,x\n" + "".join(f"2024-03-05,10:00:00.{k:03d},{v}\n" for k, v in enumerate(X))
    assert list(facts_of(tmp_path, one_day).table.columns) == ["Date", "Time", "x"]
    assert "another run" not in " ".join(facts_of(tmp_path, csv(HEAD) + csv("", T + T[-1] + T[1])).table.notes)


def test_flags_of_a_long_file_are_counted_in_all_of_its_rows(tmp_path, monkeypatch):
    monkeypatch.setattr(long_text_file, "LONG", 1 << 18)
    rows_of = "".join(f"{0.001 * k:.3f},{np.sin(k / 50):.6f},{int(k % 100 != 7)}\n" for k in range(40_000))
    table = facts_of(tmp_path, "t (s),x (um),x valid\n" + rows_of).table
    assert isinstance(table.lines, range)  # read piece by piece
    assert [note for note in table.notes if "not applied" in note] == [
        "x valid: is 0 in 400 rows and 1 in all others, not applied: empty the readings of these rows where it says that they are none"
    ]

"""Logs of the bench are read to their numbers, units and time, or what is doubtful is told; no one is read otherwise in silence."""

from __future__ import annotations

import numpy as np
import pytest
from bench_logs import BENCH, T, U, X

from ctrlgen.core.errors import InputError
from ctrlgen.core.units import to_si
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
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

"""Files whose newest row stands first: said so, and what to do; no poses are proposed for them."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ROOT
from logger_files import T, U, X, rows

from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.answers import NOTHING, Answers
from ctrlgen.recordings.look.column_facts import NEWEST_FIRST, table_facts
from ctrlgen.recordings.look.proposal import propose
from ctrlgen.recordings.look.proposed_file import recording_toml

STAMPS = [f"2024-03-05T10:00:{k:02d}" for k in range(len(T))]


def facts_of(folder, head: str, time, answers: Answers = NOTHING):
    cells = (f"{t},{u},{x}\n" for t, u, x in zip(time, U, X, strict=True))
    (folder / "log.csv").write_text(f"{head},u (V),x (um)\n" + "".join(cells))
    return table_facts(read_table(folder / "log.csv"), answers)


@pytest.mark.parametrize(
    ("head", "time"),
    [("t (s)", T[::-1]), ("time", T[::-1]), ("k (ms)", 1e3 * T[::-1]), ("when", STAMPS[::-1]), ("t (s)", -T)],
)
def test_a_time_that_falls_is_told_with_what_to_do(tmp_path, head, time):
    facts = facts_of(tmp_path, head, time)
    assert facts.time is None and facts.falls == head
    proposal = propose([facts], build_model(load_device(ROOT / "tests" / "logs" / "stage.toml")))
    assert proposal.kind == "series" and not proposal.certain
    assert proposal.missing == (f"time is column {head!r}, which {NEWEST_FIRST}",)
    assert {m.column for m in proposal.matches} == {"u (V)", "x (um)"}
    text = recording_toml(proposal, tmp_path, "log")
    assert 'kind   = "series"\n' in text and f'time = {{ column = "{head}"' in text and "sample_rate" not in text
    with pytest.raises(InputError, match="newest row first: reverse the rows"):
        facts_of(tmp_path, head, time, Answers(time=head))


def test_what_falls_and_is_no_time_is_none(tmp_path):
    assert facts_of(tmp_path, "load (N)", T[::-1]).falls == ""
    assert facts_of(tmp_path, "T (K)", T[::-1]).falls == ""
    assert facts_of(tmp_path, "t (s)", T).falls == ""
    assert facts_of(tmp_path, "t (s)", np.where(T > 0.03, T, 0.06 - T)).falls == ""
    assert facts_of(tmp_path, "T", T[::-1], Answers(rate="1 kHz")).falls == ""  # a temperature, it may be
    assert facts_of(tmp_path, "t (s)", T[::-1], Answers(rate="1 kHz")).falls == "t (s)"
    poses = facts_of(tmp_path, "t (s)", T[::-1], Answers(poses=True))
    assert poses.falls == ""
    (tmp_path / "log.csv").write_text("a,b\n" + rows(",", U, X))
    assert table_facts(read_table(tmp_path / "log.csv")).falls == ""

"""Logs in which texts look like numbers are read right or refused with a message; no name is lost and no number made up."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import DEVICES
from logs_with_texts import STEP, Written, log_with_texts
from recorded import described

import ctrlgen
from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.answers import read_answers
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.oddities import table_oddities
from ctrlgen.recordings.look.proposal import propose
from ctrlgen.recordings.look.proposed_file import recording_toml
from ctrlgen.recordings.reader import load_recordings

COUNT, LOADED = 300, 60
LEVER = "xy_lever_stage"


@pytest.fixture(scope="module")
def lever():
    return ctrlgen.build_model(ctrlgen.load_device(DEVICES / f"{LEVER}.toml"))


def compared(log: Written, path) -> None:
    """Raises InputError where it is refused."""
    table = read_table(path)
    assert tuple(table.columns) == log.names, log.described
    for name, truth in log.columns.items():
        np.testing.assert_array_equal(table.numbers(table.find(name)), truth, err_msg=log.described)


def test_names_and_numbers_are_those_that_were_written(tmp_path):
    path, read = tmp_path / "a.txt", 0
    for seed in range(COUNT):
        log = log_with_texts(seed)
        path.write_text(log.text)
        try:
            compared(log, path)
            read += 1
        except InputError as error:
            assert log.merged and "a.txt" in str(error), (log.described, str(error))
    assert read > 0.9 * COUNT


@pytest.mark.parametrize("gap", [None, "held", "split"])
def test_what_becomes_a_record_is_what_was_written(tmp_path, lever, gap):
    """Of what was written at each time; across gaps that are said to be held, the last that was."""
    outcomes = {"read": 0, "refused": 0}
    for seed in range(LOADED):
        log = log_with_texts(seed)
        (tmp_path / "a.txt").write_text(log.text)
        signals = {"a": ("drive.x", "V"), "b": ("drive.y", "V"), "x": ("reading.delta_x", "um")}
        columns = {
            signals[name[0]][0]: {"column": name, "unit": signals[name[0]][1]} for name in log.columns if name != "t"
        }
        folder = described(tmp_path, {"file": "a.txt", "role": "fit", "gap": gap}, columns=columns, device=LEVER)
        try:
            records = load_recordings([folder], lever, hold_out=False).records
        except InputError as error:
            assert len(str(error)) > 40, log.described
            outcomes["refused"] += 1
            continue
        outcomes["read"] += 1
        for record in records:
            rows = np.round(record.time / STEP).astype(int)
            for k, name in enumerate("ab"):
                u, stated = record.drive[:, k], log.columns[name]
                known = np.isfinite(stated[rows])
                np.testing.assert_allclose(u[known], stated[rows][known], rtol=1e-9, err_msg=log.described)
                if gap == "held":
                    last = np.maximum.accumulate(np.where(np.isfinite(stated), np.arange(len(stated)), 0))
                    np.testing.assert_allclose(u, stated[last][rows], rtol=1e-9, err_msg=log.described)
            truth, valid = log.columns[next(n for n in log.columns if n[0] == "x")][rows], record.valid[:, 0]
            np.testing.assert_allclose(1e6 * record.observed[valid, 0], truth[valid], rtol=1e-9, err_msg=log.described)
    assert min(outcomes.values()) > 0.1 * LOADED, outcomes


def test_a_gap_that_look_proposes_is_bridged(tmp_path, lever):
    """Of drives at a lower rate; those that are written in turn are refused by look already."""
    bridged = 0
    for seed in range(LOADED):
        log = log_with_texts(seed)
        (tmp_path / "a.txt").write_text(log.text)
        reading = next(name for name in log.columns if name[0] == "x")
        columns = ["drive.x=a", "drive.y=b", f"reading.delta_x={reading}"]
        answers = read_answers(None, None, columns, [], None, None, False)
        try:
            facts = table_facts(read_table(tmp_path / "a.txt"), answers)
            table_oddities(facts)
            text = recording_toml(propose([facts], lever, answers), tmp_path, "r")
        except InputError as error:
            assert "in turn" in log.described or " apart " in log.described or log.merged, (log.described, str(error))
            continue
        if "gap = " in text:
            (tmp_path / "recording.toml").write_text(text)
            (record,) = load_recordings([tmp_path / "recording.toml"], lever, hold_out=False).records
            assert np.isfinite(record.drive).all() and len(record.time) > 50
            bridged += 1
    assert bridged > 0.05 * LOADED

"""Tables in a terminal and in a log: everything stands there, whatever the width."""

from __future__ import annotations

import re
import time

import pytest

from ctrlgen.app import console

COLUMNS = (("what was found", "left"), ("place", "left"), ("value", "right"), ("bound", "right"))
ROWS = (
    (
        "parameter of the mechanism",
        "mechanism:platform_angles[0]",
        "-1.234567e-05 N*s/um",
        "22 degC",
        "or coupling at stage:2y",
    ),
    ("asymmetric_viscous, the friction of one direction", "stage:axis", "23.45 nm", "550 MPa", "<- tightest"),
)


@pytest.mark.parametrize("width", [20, 60, 80, 110, 300])
def test_a_table_loses_no_text_and_breaks_no_number_at_any_width(monkeypatch, capsys, width):
    monkeypatch.setattr(console.out, "width", width)
    table = console.table_of(*COLUMNS)
    for row in ROWS:
        table.add_row(*row)
    console.show_table(table)
    printed = capsys.readouterr().out
    assert "…" not in printed
    for row in ROWS:
        assert row[2] in printed and row[3] in printed  # a number and its unit on one line
        for word in " ".join(row).split():
            assert word in printed, word
    if width == 300:
        assert len(printed.splitlines()) == 1 + len(ROWS)


def test_a_table_in_a_log_wraps_at_its_width(capsys):
    table = console.table_of(("what", "left"))
    table.add_row("many words in a row " * 20)
    console.show_table(table)
    printed = capsys.readouterr().out
    assert len(re.findall("words", printed)) == 20
    assert max(map(len, printed.splitlines())) <= 110


def test_a_warning_is_shown_once_by_each_command(capsys):
    for _ in range(2):
        show = console.shows_warnings()
        for text in ("a", "b", "a"):
            show(UserWarning(text), UserWarning, "file.py", 3)
        assert capsys.readouterr().err.split() == ["warning:", "a", "warning:", "b"]


def test_long_work_says_in_a_pipe_what_it_does_and_how_long_it_takes(monkeypatch, capsys):
    monkeypatch.setattr(console.Lines.__init__, "__defaults__", (None, 0.05))
    with console.counted("diagnosing") as told:
        told(1, 4)
        time.sleep(0.12)
    said = capsys.readouterr().err.splitlines()
    assert said and all(re.fullmatch(r"\d+ s: diagnosing, 1 of 4 done, about \d+ s to go", line) for line in said)
    with console.progress(3) as advance:
        advance("symbolic model")
        advance("fit of creep")
        time.sleep(0.08)
    assert re.search(r"\d+ s: fit of creep, 1 of 3 done, about \d+ s to go", capsys.readouterr().err)
    with console.progress() as advance:
        advance("noise")
        time.sleep(0.08)
    assert re.search(r"^\d+ s: noise$", capsys.readouterr().err, re.MULTILINE)
    with console.progress() as advance:
        advance("quick")
    assert capsys.readouterr().err == ""

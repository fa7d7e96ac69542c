"""Tables in a terminal and in a log: everything stands there, whatever the width."""

from __future__ import annotations

import re
import time

import pytest

from ctrlgen.app import console
from ctrlgen.app.diagnosis_console import findings_table
from ctrlgen.diagnosis.selection.attribution import ShareEntry
from ctrlgen.diagnosis.selection.findings import Estimate, Finding
from ctrlgen.estimation.hypothesis import Hypothesis

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


def test_an_estimate_and_its_interval_stand_on_one_line(monkeypatch, capsys):
    monkeypatch.setattr(console.out, "width", 110)
    periodic, late = Hypothesis("cyclic_from_home", "sensor:axis", "axis"), Hypothesis("delay", "sensor:axis", "axis")
    share = ShareEntry(value=0.992, ci95=(0.98, 0.996))
    estimates = {
        "amplitude": Estimate(8.19, (7.95, 8.43), "deg"),
        "period": Estimate(90.8, (90.0, 91.6), "deg"),
    }
    lag = Hypothesis("low_pass", "sensor:axis", "axis")
    console.show_table(
        findings_table(
            [
                Finding("cyclic_from_home", "sensor:axis", estimates, (), share, {}, "", periodic),
                Finding("delay", "sensor:axis", {"delay": Estimate(34, (27, 41), "ms")}, (lag,), None, {}, "", late),
            ]
        )
    )
    printed = capsys.readouterr().out
    assert re.findall(r"(\w+) +(\S+) (\w+) \((\S+) \.\.\. (\S+) \w+\)", printed) == [
        ("amplitude", "8.19", "deg", "7.95", "8.43"),
        ("period", "90.8", "deg", "90", "91.6"),
        ("delay", "34", "ms", "27", "41"),
    ]


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

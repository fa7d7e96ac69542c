"""`ctrlgen diagnose` at the command line: what it leaves, prints, refuses, and keeps when it is interrupted."""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path

import pytest
from conftest import AXIS_FILE, MESO_FILE, SCENARIOS
from creeping_axis import LAWS, creeping_recording
from recording_folders import axis_recording
from result_files import faults

from ctrlgen.app.commands.cli import execute
from ctrlgen.diagnosis.diagnosis_folder import diagnose_into, unfinished
from ctrlgen.diagnosis.selection.verdict import Verdict


@pytest.fixture(scope="module")
def creeping(tmp_path_factory) -> Path:
    return creeping_recording(tmp_path_factory.mktemp("creeping"))


def command(*words: object) -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["ctrlgen", *map(str, words)])
        patch.setattr(warnings, "showwarning", warnings.showwarning)  # put back what the command changes
        return execute()


@pytest.mark.long
def test_the_command_leaves_three_files_and_prints_the_answer(creeping, tmp_path, capsys):
    out = tmp_path / "out"
    assert command("diagnose", AXIS_FILE, creeping, "--out", out, "--seed", 3, "--laws", ",".join(LAWS)) == 0
    assert {p.name for p in out.iterdir()} == {"report.html", "diagnosis.json", "device.next.toml", ".ctrlgen"}
    printed = capsys.readouterr().out
    told = json.loads((out / "diagnosis.json").read_text())
    assert faults(told, "diagnosis") == [] and told["seed"] == 3
    assert set(told["inputs"]) >= {AXIS_FILE.name} and len(told["inputs"]) == 4  # device, recording.toml, two tables
    assert "Explained: a flexure" in printed and "stage:axis" in printed and str(out / "report.html") in printed
    page_text = (out / "report.html").read_text()
    assert "seed 3" in page_text and "/fit.csv" in page_text and "/recording.toml" in page_text
    assert (
        command("diagnose", out / "device.next.toml", creeping, "--out", tmp_path / "next", "--laws", ",".join(LAWS))
        == 0
    )
    assert json.loads((tmp_path / "next" / "diagnosis.json").read_text())["verdict"] == Verdict.CONSISTENT


@pytest.mark.long
def test_the_command_explains_one_law(creeping, tmp_path, capsys):
    words = ("--out", tmp_path / "out", "--laws", ",".join(LAWS), "--explain", "creep")
    assert command("diagnose", AXIS_FILE, creeping, *words) == 0
    assert "creep at stage:axis is in the answer.\n" in capsys.readouterr().out


def test_an_unknown_law_to_explain_is_refused_before_the_diagnosis(creeping, tmp_path, capsys):
    assert command("diagnose", AXIS_FILE, creeping, "--out", tmp_path / "out", "--explain", "crep") == 2
    assert "did you mean 'creep'" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_a_place_for_replicates_that_nobody_asked_for_is_refused(creeping, tmp_path, capsys):
    where = "--scheduler", "tcp://nowhere:1"
    assert command("diagnose", AXIS_FILE, creeping, "--out", tmp_path / "out", *where) == 2
    assert "--bootstrap" in capsys.readouterr().err and not (tmp_path / "out").exists()


def without_values(folder: Path) -> Path:
    """The same recording with nothing in its reading."""
    for name in ("fit.csv", "hold_out.csv"):
        lines = (folder / name).read_text().splitlines()
        (folder / name).write_text("\n".join([lines[0], *(line.rpartition(",")[0] + ",nan" for line in lines[1:])]))
    return folder


@pytest.mark.parametrize(
    ("spoil", "device", "says"),
    [
        (lambda f: f, MESO_FILE, "'flexure_axis' is not 'meso_hexapod'"),
        (lambda f: f / "none", AXIS_FILE, "does not exist"),
        (lambda f: f, SCENARIOS / "none.toml", "does not exist"),
        (without_values, AXIS_FILE, "reading.axis"),
    ],
    ids=["device of another recording", "no recording", "no device file", "empty channel"],
)
def test_bad_input_is_refused_with_status_2_and_nothing_is_written(tmp_path, capsys, spoil, device, says):
    folder = spoil(axis_recording(tmp_path / "given", AXIS_FILE.read_text()))
    assert command("diagnose", device, folder, "--out", tmp_path / "out") == 2
    told = capsys.readouterr()
    assert says in told.err and "fault" in told.err and told.out == ""
    assert [p.name for p in tmp_path.iterdir()] == ["given"]


def test_a_foreign_folder_is_refused(creeping, tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("precious")
    assert command("diagnose", AXIS_FILE, creeping, "--out", tmp_path) == 2
    assert "did not make" in capsys.readouterr().err and [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.long
@pytest.mark.parametrize(
    "at", [pytest.param("noise", marks=pytest.mark.long), pytest.param("screening", marks=pytest.mark.long), "report"]
)
def test_an_interruption_keeps_the_earlier_result(creeping, tmp_path, at):
    def stop(step: str) -> None:
        if step.startswith(at):
            raise KeyboardInterrupt

    out = tmp_path / "out"
    diagnose_into(AXIS_FILE, [creeping], out, laws=LAWS)
    before = {p.name: p.read_bytes() for p in out.iterdir()}
    with pytest.raises(KeyboardInterrupt):
        diagnose_into(AXIS_FILE, [creeping], out, progress=stop, laws=LAWS)
    assert {p.name: p.read_bytes() for p in out.iterdir()} == before
    assert set(tmp_path.iterdir()) <= {out, unfinished(out)}  # the fits, for when it is asked again


def test_check_says_what_the_gate_lets_through(creeping, capsys):
    assert command("check", creeping, "--device", AXIS_FILE) == 0
    printed = capsys.readouterr().out
    assert "creeping axis" in printed and "hold_out" in printed and "0 of 1200" in printed
    assert command("check", creeping) == 1
    assert "--device" in capsys.readouterr().err

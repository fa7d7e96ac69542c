"""The examples that the commands' help prints work as they are printed, with files that `ctrlgen example` gives."""

from __future__ import annotations

import inspect
import re
import shlex
import shutil
import subprocess
import tomllib

import pytest
from command_line import ctrlgen
from conftest import SCENARIOS

from ctrlgen.app.commands.cli import app
from ctrlgen.app.shipped_examples import examples

EXAMPLE = re.compile(r"Example:  (ctrlgen .*)")
COMMANDS = {command.callback.__name__: command.help for command in app.registered_commands} | {
    f"{group.name} {command.callback.__name__}": command.help
    for group in app.registered_groups
    for command in group.typer_instance.registered_commands
}
QUICK = {"check", "example", "laws", "look", "new device", "new recording", "new scenario", "schema", "simulate"}
WRITING = {"run", "solve", "fmu", "workspace", "bode", "diagnose", "batch"}  # without --out
ELSEWHERE = {"verify"}  # .ci/run runs it as printed
ENDLESS = {"view"}  # test_view_server.py runs it as printed, and ends it


def mark_of(name: str) -> tuple[pytest.MarkDecorator, ...]:
    return () if name in QUICK else (pytest.mark.exhaustive if name in ELSEWHERE else pytest.mark.long,)


MATCHES = [
    pytest.param(name, line, marks=mark_of(name), id=name)
    for name, told in sorted(COMMANDS.items())
    for line in EXAMPLE.findall(told or "")
    if name not in ENDLESS
]


def test_every_command_prints_an_example():
    assert {name for name, told in COMMANDS.items() if EXAMPLE.search(told or "")} == set(COMMANDS)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_the_help_of_a_command_shows_every_word_in_unbroken_paragraphs(name, monkeypatch, capsys):
    """Words in brackets are not taken for styles, and no line of the source begins a line of the terminal, but where it is indented."""
    monkeypatch.setenv("COLUMNS", "2000")
    app([*name.split(), "--help"], standalone_mode=False)
    shown = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    groups = {f"{group.name} ": group.typer_instance for group in app.registered_groups}
    known = {c.callback.__name__: c for c in app.registered_commands}
    known |= {f"{n}{c.callback.__name__}": c for n, group in groups.items() for c in group.registered_commands}
    for paragraph in inspect.getdoc(known[name].callback).split("\n\n"):
        lines = paragraph.strip("\b\n").splitlines() if paragraph.startswith("\b") else [paragraph]
        lines = [" ".join(line.split()) for line in lines]
        assert lines == [line for line in shown if line in lines]


def needed(line: str) -> set[str]:
    """The shipped examples that hold the files of a line: folders of that name, and one that comes with a named device."""
    folders = set(re.findall(r"scenarios/(\w+)", line)) - {"devices"}
    stems = re.findall(r"scenarios/devices/(\w+)\.toml", line)
    return folders | {next(e.name for e in examples() if e.device.stem == stem) for stem in stems}


@pytest.mark.long
@pytest.mark.parametrize(("name", "line"), MATCHES)
def test_the_example_of_a_command_works_as_its_help_prints_it(name, line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if name != "example":
        for example in needed(line):
            assert ctrlgen("example", example, "--to", "scenarios").returncode == 0
    first, *then = line.split(" && ")
    done = ctrlgen(*shlex.split(first)[1:])
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr
    if out := re.search(r"(?:--out|-o|--to) (\S+)", first):
        assert (tmp_path / out[1]).exists()
    elif name in WRITING:  # where its help says
        assert any(tmp_path.glob(f"out/*{'' if name == 'run' else f'_{name}'}")) or name == "bode"
    for more in then if shutil.which("cmake") else ():
        subprocess.run(shlex.split(more), check=True, capture_output=True)


def test_the_runs_that_come_with_it_are_of_the_lever_stage():
    for name in ("run_a", "run_b"):
        assert tomllib.loads((SCENARIOS / "lever_runs" / f"{name}.toml").read_text())["device"] == "xy_lever_stage"

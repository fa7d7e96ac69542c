"""Every command on every shipped file of its kind, and on files of other kinds: it works, or refuses with the reason."""

from __future__ import annotations

import re
import tomllib
import warnings
from pathlib import Path
from typing import Any

import pytest
import tomlkit
import typer
from conftest import DEVICES, SCENARIOS

from ctrlgen.app.commands.cli import app
from ctrlgen.app.commands.result_folder import name_of, note_source, out_of
from ctrlgen.app.shipped_examples import examples
from ctrlgen.core.errors import CtrlgenError, InputError

FEW = 24  # samples of a path, so that every scenario can be tried: rates are lowered to it
TABLES = {path: tomllib.loads(path.read_text()) for path in sorted(SCENARIOS.rglob("*.toml"))}
PATHS = [path for path, table in TABLES.items() if "path" in table]
RECORDED = [path for path, table in TABLES.items() if "record" in table]
DESCRIBED = [
    *(path for path, table in TABLES.items() if "kind" in table and "record" not in table),
    DEVICES / "tilt_platform.py",
]
COMMANDS = sorted(command.callback.__name__ for command in app.registered_commands)
QUICK_PATHS = {
    "flexure_axis_line",
    "lever_circle",
    "parallelogram_line",
    "tripod_tilt",
    "rrr_circle",
    "unreachable",
    "xy_stage_force",
}
QUICK = {path for path in PATHS if path.parent.name in QUICK_PATHS} | set(
    {path.parent: path for path in RECORDED[::-1]}.values()
)


def slow(paths: list[Path], quick: set[Path]) -> list[Any]:
    """The paths as parameters of a test, of which those that are not `quick` are long."""
    return [path if path in quick else pytest.param(path, marks=pytest.mark.long) for path in paths]


def tried(*words: object) -> str:
    """The command line in this process: '' where it works, else the reason with which it refuses. Anything else is raised."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            status = app([str(word) for word in words], standalone_mode=False)
    except CtrlgenError as error:
        return str(error)
    except Exception as error:
        if not hasattr(error, "format_message"):  # those of wrong words, as the command line tells them from faults
            raise
        return str(error) or "usage"
    return "" if not status else f"status {status}"


def of_device(path: Path) -> Path:
    """The device file of a recording."""
    return next(e.device for e in examples() if e.file.parent == path.parent.resolve())


def named(path: Path) -> str:
    return f"{path.parent.name}-{path.stem}"


@pytest.mark.long
@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_refuses_files_of_other_kinds_in_words(command, tmp_path, capsys):
    (tmp_path / "empty.toml").touch()
    kinds = {
        "device": DEVICES / "flexure_axis.toml",
        "scenario": SCENARIOS / "parallelogram_line" / "scenario.toml",
        "recording": SCENARIOS / "lever_runs" / "run_a.toml",
        "jobs": SCENARIOS / "lever_runs" / "jobs.toml",
        "uncertainty": SCENARIOS / "circle20" / "uncertainty.toml",
        "log": SCENARIOS / "lever_runs" / "run_a.csv",
        "empty": tmp_path / "empty.toml",
        "folder": tmp_path,
        "nothing": tmp_path / "nothing",
    }
    fitting = {"check": {"device", "scenario"}, "bode": {"device"}, "workspace": {"device"}, "batch": {"jobs"}}
    fitting |= {"look": {"log"}, "simulate": {"device"}, "view": {"folder"}}
    takes_two = {"learn", "diagnose", "calibrate"}
    out = (
        []
        if command in ("check", "compare", "example", "reproduce", "look", "laws", "view")
        else ["--out", tmp_path / "out.svg"]
    )
    for kind, file in kinds.items():
        if kind in fitting.get(command, {"scenario"}):
            continue
        second = [kinds["device"]] if command in takes_two else []
        reason = tried(command, file, *second, *out)
        assert reason or capsys.readouterr().err, (kind, reason)
    assert not list(tmp_path.glob("out*"))


def test_whatever_writes_a_folder_needs_no_name_for_it_and_takes_a_short_option():
    found = {}
    for name, command in typer.main.get_command(app).commands.items():  # type: ignore[attr-defined]
        for option in command.params:
            if "--out" in option.opts:
                assert "-o" in option.opts and not option.required, name
                found[name] = option.show_default or "nothing is written"
    assert len(found) == 15
    folders = {name: told for name, told in found.items() if "out/" in told}
    assert set(folders) == {"run", "solve", "generate", "verify", "fmu", "workspace", "diagnose", "batch"}
    for name, told in folders.items():
        assert told.startswith(str(out_of(None, Path("some/NAME"), "" if name == "run" else name)))


def test_the_name_of_a_folder_is_that_of_what_it_is_of(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {
        "a/circle": "circle",
        "a/circle/scenario.toml": "circle",
        "b/stage.toml": "stage",
        "stage.v2.py": "stage.v2",
    }
    assert {file: name_of(Path(file)) for file in names} == names
    Path("radius_1.5um").mkdir()
    assert name_of(Path("radius_1.5um")) == "radius_1.5um"
    assert name_of(Path()) == name_of(Path("scenario.toml")) == tmp_path.name
    assert out_of(Path("x"), Path("b/stage.toml"), "workspace") == Path("x")


def test_another_device_has_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario, devices = Path("circle.toml"), [Path("a/stage.next.toml"), Path("b/stage.next.toml")]
    folders = [out_of(None, scenario, "solve", device) for device in (None, *devices)]
    assert folders == [Path("out/circle_solve"), *[Path("out/circle_solve_on_stage.next")] * 2]
    for folder, device in zip(folders, (None, devices[0]), strict=False):
        folder.mkdir(parents=True)
        note_source(folder, scenario, device)
        note_source(folder, scenario, device)  # done again
        assert out_of(None, scenario, "solve", device) == folder
    with pytest.raises(InputError, match=r"circle.toml on .*a/stage.next.toml"):
        out_of(None, scenario, "solve", devices[1])


def test_a_folder_that_nobody_named_is_told_and_replaces_nothing_of_somebody_else(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = "workspace", DEVICES / "flexure_axis.toml"
    folder = Path("out", "flexure_axis_workspace")
    assert tried(*words) == "" and (folder / "workspace.html").is_file()
    assert capsys.readouterr().out.splitlines()[-1] == f"{folder}/workspace.html"
    assert tried(*words) == ""  # over a result of its own
    (folder / "notes.txt").touch()
    assert "notes.txt, which ctrlgen did not make" in tried(*words)
    assert tried(*words, "-o", "elsewhere") == "" and Path("elsewhere", "workspace.html").is_file()


def test_a_folder_that_nobody_named_keeps_the_result_of_another_file_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (DEVICES / "flexure_axis.toml").read_text()
    for place in ("a", "b"):
        Path(place).mkdir()
        Path(place, "stage.toml").write_text(text)
    made = Path("out", "stage_workspace", "workspace.json")
    assert tried("workspace", "a/stage.toml") == ""
    before = made.stat().st_ino
    reason = tried("workspace", "b/stage.toml")
    assert f"holds the result of {tmp_path / 'a' / 'stage.toml'}; name another folder with -o" in reason
    assert made.stat().st_ino == before
    assert (
        tried("workspace", "b/stage.toml", "-o", made.parent) == ""
    )  # replaced where it is named, and is b's from then on
    assert tried("workspace", "b/stage.toml") == "" and tried("workspace", "a/stage.toml")


@pytest.mark.parametrize("path", slow(PATHS, QUICK), ids=named)
def test_check_of_every_scenario(path):
    assert tried("check", path.parent) == ""


@pytest.mark.long
@pytest.mark.parametrize("path", DESCRIBED, ids=named)
def test_check_of_every_device(path):
    assert tried("check", path) == ""


@pytest.mark.long
@pytest.mark.parametrize("path", slow(RECORDED, QUICK), ids=named)
def test_check_of_every_recording(path):
    """Those whose data may not be copied are refused where the data are not there."""
    reason = tried("check", path, "--device", of_device(path))
    there = all((path.parent / record["file"]).is_file() for record in TABLES[path]["record"])
    assert not reason if there else "is not here" in reason


@pytest.mark.long
@pytest.mark.parametrize("path", slow(RECORDED, QUICK), ids=named)
def test_calibration_of_every_device_without_constants_of_its_own_is_refused(path):
    device = of_device(path)
    if device.suffix == ".toml" and "run_time" not in TABLES[device]:
        assert "run_time" in tried("calibrate", device, path)


# Why a command may refuse a scenario, a copy of it with few samples included
REASONS = {
    "budget": "is not stated of anything",
    "fastest": "without delay|is too low: the fastest motion|is missing: the fastest path is|lists samples|asks for limits that hold|"
    "no inertia, for which the fastest path is not computed",
    "fmu": "is missing: FMI co-simulation advances by samples",
    "player": "is missing: a player replays drives in time",
    "unreachable": "cannot follow",
    "dynamic_circle": "the simulated motion is not finite",
}
MUST_WORK = {
    "budget": {"circle20", "flexure_axis_line", "lever_circle", "parallelogram_line"},
    "fastest": {"circle20", "flexure_axis_line", "raster", "tripod_tilt"},
}


@pytest.fixture
def small(tmp_path):
    """A copy of a scenario with few samples, beside its device."""

    def copied(path: Path, rated: bool = False) -> Path:
        document = tomlkit.parse(path.read_text())
        document["device"] = str((path.parent / document["device"]).resolve())
        document.pop("expect", None)
        if "duration" in document and not rated:
            lasts = float(document["duration"].split()[0]) * (1e-3 if "ms" in document["duration"] else 1.0)
            document["sample_rate"] = f"{FEW / lasts:.9g} Hz"
        elif "points" in document:
            document["points"] = 3
        folder = tmp_path / path.parent.name
        folder.mkdir(exist_ok=True)
        for other in path.parent.glob("*"):
            if other.is_file() and other.name != path.name:
                (folder / other.name).write_bytes(other.read_bytes())
        (folder / path.name).write_text(tomlkit.dumps(document))
        return folder

    return copied


def tried_by(command: str, path: Path) -> Any:
    """A command on a scenario as parameters of a test."""
    long = command in ("solve", "generate", "budget") or (command == "fastest" and path.parent.name != "dynamic_circle")
    mark = pytest.mark.long if long else pytest.mark.exhaustive
    return pytest.param(command, path, marks=mark, id=f"{command}-{named(path)}")


ON_SCENARIOS = ("solve", "generate", "budget", "fastest", "player", "fmu", "compare", "run", "verify")


@pytest.mark.parametrize(("command", "path"), [tried_by(command, path) for command in ON_SCENARIOS for path in PATHS])
def test_every_command_on_every_scenario(command, path, small, tmp_path):
    folder, out = small(path, rated=command == "fastest"), tmp_path / "out"
    words = {
        "player": ("generate", folder, "--player", "--out", out),
        "budget": ("budget", folder, "--draws", 0, "--out", out),
        "verify": ("verify", folder, "--quick", "--out", out),
        "fastest": ("fastest", folder),
        "compare": ("compare", folder),
    }
    reason = tried(*words.get(command, (command, folder, "--out", out)))
    name = path.parent.name
    if reason:
        assert re.search("|".join(REASONS[key] for key in (command, name) if key in REASONS) or "^$", reason), reason
        assert name not in MUST_WORK.get(command, ())
    assert command in ("fastest", "compare") or out.exists() == (not reason)

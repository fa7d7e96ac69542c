"""Nothing foreign comes out of a name or a text: it is refused where it is read, or stands as itself in all that is written."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tomlkit
from command_line import ctrlgen
from conftest import ROOT, SCENARIOS
from hostile_texts import FOREIGN, READ, SHOWN, UNSEEN, leaves, replaced, skeleton
from package_programs import STRICT

import ctrlgen.firmware.fmi.fmu as fmu
from ctrlgen import InputError, build_model, load_device, load_scenario, solve, user_device
from ctrlgen.app.batch import BatchFile
from ctrlgen.core.errors import Fault, ToolError
from ctrlgen.core.escaping import c_comment, c_format, csv_cell, kconfig, markdown, markdown_code, toml
from ctrlgen.core.file_limits import DEEPEST, LARGEST_TEXT, LARGEST_TOML, LONGEST_CHAIN, LONGEST_KEY, LONGEST_TEXT
from ctrlgen.core.files import read_toml, validate
from ctrlgen.core.names import LONGEST_NAME
from ctrlgen.core.units import LARGEST_POWER, LONGEST_UNIT, MOST_FACTORS
from ctrlgen.devices import Device
from ctrlgen.firmware.folder import generate
from ctrlgen.recordings.schema import RecordingFile
from ctrlgen.trajectory.scenario_file import MOST_SAMPLES, ScenarioFile
from ctrlgen.trajectory.solution_plots import draw_solution
from ctrlgen.verification.scenario_report import write_report

FILES = sorted(SCENARIOS.rglob("*.toml"))
ALL = "\n".join(SHOWN)
PLAIN = "a plain text"


def schema_of(table: dict[str, Any]) -> type[Any]:
    """The schema of a shipped file that is a device, a scenario, a recording or a list of jobs."""
    if "job" in table:
        return BatchFile
    return RecordingFile if "record" in table else ScenarioFile if "path" in table else Device.library[table["kind"]]


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_characters_that_are_not_shown_are_refused_in_every_text_of_every_shipped_file(path):
    table = tomllib.loads(path.read_text())
    for k, (place, _) in enumerate(leaves(table)):
        with pytest.raises(InputError, match=r"is not shown|has 3000 characters") as refused:
            validate(ScenarioFile, replaced(table, place, UNSEEN[k % len(UNSEEN)]), path)
        assert str(place[-1]) in str(refused.value)


@pytest.mark.parametrize("text", UNSEEN, ids=ascii)
def test_characters_that_are_not_shown_are_refused_in_keys_too(text, tmp_path):
    file = tmp_path / "a.toml"
    file.write_text(f"{tomlkit.string(text).as_string()} = 1\n")
    with pytest.raises(InputError, match=r"the key: has (a character that is not shown|3000 characters; a key)"):
        read_toml(file)


@pytest.mark.parametrize(
    "path", [p for p in FILES if p.stem != "uncertainty"], ids=lambda p: f"{p.parent.name}-{p.stem}"
)
def test_only_titles_and_sources_may_be_any_text(path):
    """A name, a quantity, a word of ours that holds foreign text is refused by the schema, or by the device's own checks."""
    table = tomllib.loads(path.read_text())
    schema = schema_of(table)
    alike = {tuple(key for key in place if isinstance(key, str)): place for place, _ in leaves(table)}
    for k, place in enumerate(alike.values()):
        free = place[-1] in READ or place[-1] in ("file", "device", "column")  # these are looked for, and not found
        try:
            read = validate(schema, replaced(table, place, SHOWN[k % len(SHOWN)]), path)
            if not free and isinstance(read, Device):
                build_model(read)
        except InputError:
            assert not free
        else:
            assert free or schema in (ScenarioFile, RecordingFile, BatchFile), place


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x" * (LARGEST_TOML + 1), f"a description has at most {LARGEST_TOML}"),
        ("a" + ".a" * 5000 + " = 1", "line 1: has a key of more than 32 words"),
        ("a" + " . a" * 40 + " = 1", "line 1: has a key of more than 32 words"),
        (f"a = {'[' * 110}{']' * 110}", f"stand more than {DEEPEST} deep"),
        (f"a = {'9' * 5000}", "has a whole number of thousands of digits"),
    ],
    ids=["large", "dotted", "spaced", "deep", "digits"],
)
def test_a_file_that_would_take_long_is_refused_before_it_is_parsed(text, says, tmp_path):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(InputError, match=says):
        read_toml(tmp_path / "a.toml")


def test_what_is_no_regular_file_is_not_waited_for():
    with pytest.raises(InputError, match="is no regular file"):
        read_toml("/dev/zero")


def test_an_ordinary_long_text_passes(tmp_path):
    texts = ["e.g. 1.5 um, i.e. 2.5 um. " * 20, "x" * LONGEST_TEXT, "two\nlines, \u03bcm, \u0627\u0644"]
    (tmp_path / "a.toml").write_text(tomlkit.dumps({"texts": texts, "numbers": [0.5] * 900}))
    assert read_toml(tmp_path / "a.toml")["texts"] == texts


def test_a_long_name_is_refused(tmp_path):
    folder = tmp_path / ("n" * (LONGEST_NAME + 1))
    shutil.copytree(SCENARIOS / "flexure_axis_line", folder)
    shutil.copytree(SCENARIOS / "devices", tmp_path / "devices")
    with pytest.raises(InputError, match=f"has {LONGEST_NAME + 1} letters; a name has at most {LONGEST_NAME}"):
        load_scenario(folder)


def test_each_notation_has_its_escape():
    assert c_comment("a */ b /* c ??/") == "a * / b / * c ? ?/"
    assert c_comment("*\\\n/") == "*\\ /"
    assert c_format('5 %d "\\') == '5 %%d \\"\\\\'
    assert kconfig("$(shell,x)\ny") == "$ (shell,x) y"
    assert markdown("<b> `c` | [d](e)\nf") == "\\<b\\> \\`c\\` \\| \\[d\\](e) f"
    assert markdown_code("a`|b") == "`a'\\|b`"
    assert [csv_cell(text) for text in ("=1", "a=1")] == ["'=1", "a=1"]
    for text in (*SHOWN, ALL, "\N{GRINNING FACE}"):
        assert tomllib.loads(f"a = {toml(text)}")["a"] == text
    assert len(tomllib.loads(f"a = {toml('x' * 9999)}")["a"]) == LONGEST_TEXT


def test_the_limits_that_are_stated_are_those_that_are_kept():
    told = (ROOT / "SECURITY.md").read_text()
    for number in (LARGEST_TOML, LONGEST_TEXT, MOST_SAMPLES):
        assert f"{number:,}" in told
    for words in (
        f"tables {DEEPEST} deep, keys of {LONGEST_CHAIN} words",
        f"and {LONGEST_KEY} characters",
        f"{LARGEST_TEXT / 1e6:.0f} MB",
        f"{LONGEST_UNIT} letters, {MOST_FACTORS} factors, powers up to {LARGEST_POWER:g}",
        f"most {LONGEST_NAME} of them",
    ):
        assert words in told


def with_texts(folder: Path, text: str, *files: Path) -> None:
    """Copies of files of `scenarios/` in which every title and source is `text`."""
    for file in files:
        document = tomlkit.parse(file.read_text())
        for place, _ in leaves(document.unwrap()):
            if place[-1] in READ:
                node: Any = document
                for key in place[:-1]:
                    node = node[key]
                node[place[-1]] = text
        copy = folder / file.relative_to(SCENARIOS)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(document.as_string())


def same_but_for_texts(tmp_path: Path, make: Callable[[Path, Path], None], *files: Path) -> Path:
    """What `make` writes from copies of `files` with plain texts and with hostile ones is the same, the texts apart, which are shown
    somewhere; the second one."""
    for name, text in (("plain", PLAIN), ("hostile", ALL)):
        with_texts(tmp_path / name, text, *files)
        make(tmp_path / name, tmp_path / f"{name}_out")
    plain, hostile = (
        {str(p.relative_to(folder)): p for p in sorted(folder.rglob("*")) if p.is_file() and p.name != ".ctrlgen"}
        for folder in (tmp_path / "plain_out", tmp_path / "hostile_out")
    )
    assert plain.keys() == hostile.keys()
    told = 0
    for name in plain:
        if "/device/" in f"/{name}":  # copies of the inputs
            continue
        content = hostile[name].read_bytes()
        told += FOREIGN.encode() in content
        assert skeleton(name, content, ALL) == skeleton(name, plain[name].read_bytes(), PLAIN), name
    assert told
    return tmp_path / "hostile_out"


DEVICE = SCENARIOS / "devices" / "parallelogram.toml"
SPIRAL = [SCENARIOS / "mirror_spiral" / "scenario.toml", SCENARIOS / "devices" / "tip_tilt_mirror.toml"]


def write_all(folder: Path, out: Path) -> None:
    """The C, its package, figures and the report of the scenario in `folder`; of motion in time also the units for co-simulation."""
    scenario = load_scenario(folder)
    solution = solve(scenario, build_model(scenario.device))
    drawn = draw_solution(solution)
    c = generate(scenario, solution.model, out / "c", solution, drawn)
    write_report(out, solution, None, (), c, drawn, None)
    for version in (2, 3) if scenario.sample_time else ():
        fmu.write_fmus(scenario, out / f"fmu{version}", version)


def check_c(out: Path, compiler: str) -> None:
    """The C still compiles strictly, with the trigraphs of old compilers."""
    words = [compiler, "-std=c99", *STRICT, "-trigraphs", "-fsyntax-only", *sorted((out / "c").glob("*.c"))]
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.long
def test_nothing_foreign_is_in_the_c_its_package_and_the_report(tmp_path, compiler):
    def make(folder: Path, out: Path) -> None:
        title = tomllib.loads((folder / "devices" / DEVICE.name).read_text())["title"]
        (folder / "line").mkdir()
        (folder / "line" / "scenario.toml").write_text(
            f'title = {toml(title)}\ndevice = "../devices/{DEVICE.name}"\npoints = 3\n'
            '[path]\nkind = "line"\nend = { delta_x = "5 um" }\n'
        )
        write_all(folder / "line", out)

    check_c(same_but_for_texts(tmp_path, make, DEVICE), compiler)


def test_a_file_of_any_name_is_named_as_code_and_read_again(tmp_path):
    odd = "d `|$(injected) <b>'.toml"
    shutil.copy(DEVICE, tmp_path / odd)
    (tmp_path / "a line").mkdir()
    (tmp_path / "a line" / "scenario.toml").write_text(
        f'title = "t"\ndevice = {toml("../" + odd)}\npoints = 2\n[path]\nkind = "line"\nend = {{ delta_x = "5 um" }}\n'
    )
    scenario = load_scenario(tmp_path / "a line")
    c = generate(scenario, build_model(scenario.device), tmp_path / "out")
    rows = [line for line in (c.path / "README.md").read_text().splitlines() if "injected" in line]
    assert [re.fullmatch(r"\| `[^`]*` \| `[0-9a-f]{64}` \|", row) is not None for row in rows] == [True]
    assert load_scenario(c.path / "device" / "a line").device == scenario.device


@pytest.mark.long
def test_nothing_foreign_is_in_the_player_and_the_units_for_co_simulation(tmp_path, compiler, monkeypatch):
    def no_compiler() -> dict[str, str]:
        raise ToolError("none")

    monkeypatch.setattr(fmu, "find_compilers", no_compiler)  # their sources are what is looked at
    check_c(
        same_but_for_texts(tmp_path, lambda folder, out: write_all(folder / "mirror_spiral", out), *SPIRAL), compiler
    )


RUNS = "lever_runs/run_a.toml lever_runs/run_b.toml"


@pytest.mark.long
@pytest.mark.parametrize(
    "words",
    [
        "run lever_circle",
        "fastest lever_circle --sample-rate 20kHz",
        "workspace devices/xy_lever_stage.toml",
        "budget lever_circle --draws 0",
        "calibrate devices/mems_hexapod_run_time.toml hexapod_specimen",
        f"learn lever_circle {RUNS}",
        f"diagnose devices/xy_lever_stage.toml {RUNS} --laws creep,backlash",
        pytest.param("batch lever_runs/jobs.toml", marks=pytest.mark.exhaustive),
    ],
    ids=lambda words: words.split()[0],
)
def test_nothing_foreign_is_in_any_result_of_a_command(words, tmp_path):
    command, *given = words.split()
    folders = {SCENARIOS / word.split("/")[0] for word in given if (SCENARIOS / word).exists()} | {
        SCENARIOS / "devices"
    }

    def make(folder: Path, out: Path) -> None:
        for table in (table for data in folders for table in data.glob("*.csv")):
            shutil.copy(table, folder / table.relative_to(SCENARIOS))
        done = ctrlgen(
            command, *(folder / word if (SCENARIOS / word).exists() else word for word in given), "--out", out
        )
        assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr

    same_but_for_texts(
        tmp_path,
        make,
        *(file for data in folders for file in sorted(data.glob("*.toml"))),
    )


def test_a_device_in_python_has_no_hostile_names_either():
    laws = {"force": lambda u, p: p.k * u[0], "restoring_force": lambda d, p: p.k * d[0], "parameters": {"k": "1 N/m"}}
    for name in ("*/ int injected; /*", "ümlaut", "a b", "n" * 41, ""):
        with pytest.raises(InputError, match="must be names with their largest size"):
            user_device("stage", **laws, axes={name: "1 um"}, drive={"u": "1 m"})
        with pytest.raises(InputError, match=r"name: .*(is no C identifier|has 41 letters)"):
            user_device(name, **laws, axes={"x": "1 um"}, drive={"u": "1 m"})


def test_a_device_of_hostile_names_is_refused_with_each(tmp_path):
    table = tomllib.loads((SCENARIOS / "devices" / "mems_hexapod.toml").read_text())
    table["axes"] = ["a */ int injected; /*", *table["axes"][1:]]
    (tmp_path / "device.toml").write_text(tomlkit.dumps(table))
    with pytest.raises(InputError, match=r"axes\[0\]: .* is no name of an axis: write letters, digits and _"):
        load_device(tmp_path / "device.toml")


def test_a_message_obeys_no_file_and_can_be_read():
    error = InputError("a\x1b[2Jb", [Fault(f"key[{k}]", "\u202e" if k else "x" * 9999) for k in range(1000)])
    assert str(error).startswith("a\\x1b[2Jb: 1000 faults\n  - key[0]: xxx")
    assert "\\u202e" in str(error) and str(error).endswith("\n  - and 960 more") and len(str(error)) < 4000
    assert len(error.faults) == 1000

"""What comes with the package can be listed, copied and used, from a checkout and from a wheel."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

import pytest
from command_line import ctrlgen
from conftest import ROOT, SCENARIOS

from ctrlgen import InputError, load_device, load_scenario
from ctrlgen.app.shipped_examples import copy_examples, examples
from ctrlgen.core.errors import CtrlgenError
from ctrlgen.core.shipped_files import shipped_package
from ctrlgen.version import program

FOLDERS = {path.parent.name for kind in ("scenario", "recording", "run_a") for path in SCENARIOS.glob(f"*/{kind}.toml")}


def test_every_scenario_and_every_recording_is_an_example():
    assert {example.name for example in examples()} == FOLDERS
    assert {example.name for example in examples() if not example.recorded} == {
        path.parent.name for path in SCENARIOS.glob("*/scenario.toml")
    }


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(FOLDERS))
def test_a_copy_holds_all_that_its_command_reads(tmp_path, name):
    (example,) = (example for example in examples() if example.name == name)
    written = copy_examples([name], tmp_path)
    assert {path.relative_to(tmp_path) for path in written} == {
        path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()
    }
    words = example.command(tmp_path).split()
    assert all(path.exists() for path in map(Path, words[2 : words.index("--out")]))
    if words[1] == "run":
        assert load_scenario(words[2]).device.name == example.device.stem
    else:
        assert load_device(words[2]).name == tomllib.loads(Path(words[3]).read_text())["device"]


def test_a_copy_overwrites_nothing(tmp_path):
    copy_examples(["circle20"], tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match="circle20: exists"):
        copy_examples(["raster", "circle20"], tmp_path)
    device = tmp_path / "devices" / "mems_hexapod.toml"
    device.write_text("mine")
    with pytest.raises(InputError, match=r"mems_hexapod\.toml: exists and is not the example's"):
        copy_examples(["raster"], tmp_path)
    device.write_bytes(before[device])
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
    copy_examples(["raster"], tmp_path)  # beside an unchanged device of the same name


def test_the_examples_are_listed_one_a_line_and_a_wrong_use_says_what_is_right(tmp_path):
    listed = ctrlgen("example")
    assert listed.returncode == 0
    assert {line.split()[0] for line in listed.stdout.splitlines()} >= FOLDERS
    for words, says in (
        (("example", "circl20", "--to", tmp_path), "did you mean 'circle20'?"),
        (("example", "circle20"), "needs a folder"),
        (("example", "--to", tmp_path), "ctrlgen example lists them"),
    ):
        done = ctrlgen(*words)
        assert done.returncode == 1 and says in done.stderr, done.stderr
    assert not list(tmp_path.iterdir())


def test_a_folder_that_comes_with_clone_and_wheel_alone_is_missed_in_words():
    with pytest.raises(
        CtrlgenError, match="absent is missing: absent comes with a clone of ctrlgen and with its wheel"
    ):
        shipped_package("absent")


@pytest.mark.long
def test_a_wheel_in_a_clean_environment_runs_an_example_and_reproduces(tmp_path):
    def run(*words: object, **more: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            list(map(str, words)), cwd=tmp_path, capture_output=True, text=True, env=os.environ | more
        )

    pip = (sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check")
    built = run(*pip, "wheel", "--no-deps", "--wheel-dir", tmp_path, ROOT)
    assert built.returncode == 0, built.stderr
    venv.create(tmp_path / "clean", with_pip=False)
    scripts = tmp_path / "clean" / ("Scripts" if os.name == "nt" else "bin")
    (wheel,) = tmp_path.glob("*.whl")
    installed = run(*pip, "--python", scripts / "python", "install", wheel)
    assert installed.returncode == 0, installed.stderr

    assert run(scripts / "ctrlgen", "--version").stdout.strip() == program()  # the commit it was built from
    assert "circle20" in run(scripts / "ctrlgen", "example").stdout
    copied = run(scripts / "ctrlgen", "example", "circle20", "nist_hexapod", "--to", "scenarios")
    assert copied.returncode == 0, copied.stderr
    for line in copied.stdout.splitlines():
        command = line.removeprefix("try it:  ")
        if command.startswith("ctrlgen run"):
            done = run(scripts / "ctrlgen", *command.split()[1:])
            assert done.returncode == 0 and "comparisons within tolerance" in done.stdout, done.stderr
    assert (tmp_path / "out" / "circle20" / "report.html").is_file()
    device = ("--device", "scenarios/devices/meso_hexapod.toml")
    assert run(scripts / "ctrlgen", "check", "scenarios/nist_hexapod", *device).returncode == 0
    account = f"import runpy; runpy.run_path({str(SCENARIOS / 'nist_hexapod' / 'account.py')!r})"
    assert (read := run(scripts / "python", "-c", account)).returncode == 0, read.stderr
    reproduced = run(scripts / "ctrlgen", "reproduce", "--out", "page.html")
    assert reproduced.returncode == 0, reproduced.stderr
    assert "S0, meso-scale hexapod" in reproduced.stdout and (tmp_path / "page.html").is_file()
    assert "pip install 'ctrlgen[reference]'" in reproduced.stderr.splitlines()[-1]

"""The command line as a new user meets it: help, wrong input, interruption; never a half result."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import ctrlgen
from conftest import DEVICE, DEVICES, SCENARIOS

COMMANDS = (
    "run",
    "solve",
    "generate",
    "compare",
    "verify",
    "fmu",
    "check",
    "bode",
    "workspace",
    "reproduce",
    "budget",
    "fastest",
    "learn",
    "example",
    "new",
    "simulate",
    "look",
    "diagnose",
    "calibrate",
    "batch",
    "view",
)


@pytest.mark.parametrize(
    "command", [*(command for command in COMMANDS if command != "new"), "new device", "new scenario"]
)
def test_every_command_has_a_help_with_an_example(command):
    done = ctrlgen(*command.split(), "--help")
    assert done.returncode == 0 and f"ctrlgen {command} " in done.stdout and "Example" in done.stdout


def test_no_command_at_all_shows_the_help():
    done = ctrlgen()
    assert "Start with" in done.stdout and "error:" not in done.stdout + done.stderr


def test_help_names_every_command_and_a_first_step():
    done = ctrlgen("--help")
    assert all(re.search(rf"\b{command}\b", done.stdout) for command in COMMANDS)
    assert "ctrlgen example circle20 --to scenarios" in done.stdout
    assert re.search(r"then:\s+ctrlgen run scenarios/circle20\s", done.stdout)


READERS = {"pandas", "charset_normalizer", "h5py", "nptdms", "asammdf", "openpyxl", "pyarrow"}  # of measurement files


@pytest.mark.parametrize(
    "words, left_out",
    [
        (["--help"], {"numpy", "scipy", "casadi", "pint", "matplotlib", "ctrlgen.devices"} | READERS),
        (["run", "--help"], {"numpy", "scipy", "casadi", "pint", "matplotlib", "ctrlgen.devices"} | READERS),
        (
            ["check", str(DEVICE)],
            {"scipy.optimize", "matplotlib", "ctrlgen.reporting", "ctrlgen.diagnosis", "pandas", "h5py"},
        ),
    ],
)
def test_a_command_starts_without_what_it_does_not_use(words, left_out):
    """Importing all of it takes seconds."""
    program = "import sys; from ctrlgen.app.commands.cli import execute; status = execute(); print(*sys.modules); sys.exit(status)"
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.splitlines()[-1].split())
    assert "ctrlgen.app.commands.cli" in loaded and not loaded & left_out


def test_a_misspelt_command_or_option_is_answered_with_the_right_one():
    assert "Did you mean 'run'" in ctrlgen("rum").stderr
    done = ctrlgen("run")
    assert done.returncode == 2 and "'scenario'" in done.stderr and "--help" in done.stderr


@pytest.fixture
def scenario(tmp_path) -> Path:
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "{DEVICE}"\n[path]\nkind = "poses"\nfile = "poses.csv"\n'
    )
    (folder / "poses.csv").write_text("delta_z [um]\n20\n21\n")
    return folder


def refused(done: subprocess.CompletedProcess[str], *says: str) -> None:
    """One clear message, a non-zero status, no traceback."""
    assert done.returncode == 1, done
    assert "Traceback" not in done.stderr and done.stdout == ""
    for words in says:
        assert words in done.stderr, done.stderr


def test_malformed_toml_names_the_file_and_line(scenario, tmp_path):
    (scenario / "scenario.toml").write_text('title = "t"\ndevice = \n')
    refused(ctrlgen("run", scenario, "--out", tmp_path / "out"), "scenario.toml", "line 2", "toml.io")
    assert not (tmp_path / "out").exists()


def test_a_wrong_unit_names_the_key_and_the_remedy(scenario, tmp_path):
    device = tmp_path / "device.toml"
    device.write_text(DEVICE.read_text().replace('"4.127 mm"', '"4.127 mN"'))
    text = (scenario / "scenario.toml").read_text().replace(str(DEVICE), str(device))
    (scenario / "scenario.toml").write_text(text)
    refused(ctrlgen("run", scenario, "--out", tmp_path / "out"), "hexapod.height", "um is needed")


def test_a_cell_that_is_not_a_number_names_its_line(scenario, tmp_path):
    (scenario / "poses.csv").write_text("delta_z [um]\n20\nNaN\n")
    refused(ctrlgen("solve", scenario, "--out", tmp_path / "out"), "poses.csv", "line 3", "'NaN'")
    assert not (tmp_path / "out").exists()


def test_a_missing_compiler_is_named_before_any_work(scenario, tmp_path):
    refused(
        ctrlgen("run", scenario, "--out", tmp_path / "out", PATH=str(tmp_path)), "no C compiler", "apt-get install gcc"
    )


@pytest.mark.long
def test_generate_needs_no_compiler(scenario, tmp_path):
    done = ctrlgen("generate", scenario, "--out", tmp_path / "c", PATH=str(tmp_path))
    assert done.returncode == 0 and (tmp_path / "c" / "mems_hexapod_online_f32.c").exists()


def test_an_unwritable_folder_is_refused(scenario, tmp_path):
    (tmp_path / "file").write_text("mine")
    refused(ctrlgen("run", scenario, "--out", tmp_path / "file"), "is a file")
    refused(ctrlgen("run", scenario, "--out", tmp_path / "file" / "below"), "cannot be written")
    refused(ctrlgen("run", scenario, "--out", "/proc/ctrlgen/out"), "cannot be written")
    assert (tmp_path / "file").read_text() == "mine"


def test_a_folder_with_other_peoples_files_is_not_replaced(scenario, tmp_path):
    out = tmp_path / "thesis"
    out.mkdir()
    (out / "chapter1.tex").write_text("precious")
    refused(ctrlgen("solve", scenario, "--out", out), "did not make")
    assert (out / "chapter1.tex").read_text() == "precious"


@pytest.mark.long
def test_an_earlier_result_is_replaced_whole_and_kept_when_the_next_run_fails(scenario, tmp_path):
    out = tmp_path / "out"
    assert ctrlgen("solve", scenario, "--out", out).returncode == 0
    before = (out / "trajectory.csv").read_text()
    (scenario / "poses.csv").write_text("delta_z [um]\n900\n")
    refused_run = ctrlgen("solve", scenario, "--out", out)
    assert refused_run.returncode == 1 and (out / "trajectory.csv").read_text() == before
    (scenario / "poses.csv").write_text("delta_z [um]\n25\n")
    assert ctrlgen("solve", scenario, "--out", out).returncode == 0
    assert (out / "trajectory.csv").read_text() != before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine", "out"]


def test_unreachable_says_which_actuator_by_how_much_and_what_is_nearest(tmp_path):
    done = ctrlgen("run", SCENARIOS / "unreachable", "--out", tmp_path / "out")
    refused(done, "actuator 2X: needs -5 um", "only pushes", "nearest pose")
    assert not (tmp_path / "out").exists()


SWALLOWED = """
import os, signal, sys
import ctrlgen.app.commands.cli
from ctrlgen.__main__ import main

class Dying:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
        sum(range(100))

def execute(check):
    Dying()
    check()

ctrlgen.app.commands.cli.execute = execute
main()
"""


@pytest.mark.long
def test_an_interruption_that_a_callback_swallows_ends_the_work_too():
    """Python ignores what is raised there, and prints it."""
    done = subprocess.run([sys.executable, "-c", SWALLOWED], capture_output=True, text=True)
    assert done.returncode == 130 and "Traceback" not in done.stderr and "interrupted" in done.stderr


def handles(pid: int, number: signal.Signals) -> bool:
    """Whether a process has a handler of its own for a signal."""
    status = Path(f"/proc/{pid}/status").read_text()
    caught = next((line.split()[1] for line in status.splitlines() if line.startswith("SigCgt:")), "0")
    return bool(int(caught, 16) >> (number - 1) & 1)


MOMENTS = [(stop, after) for stop in (signal.SIGINT, signal.SIGTERM) for after in (0.05, 0.6, 1.4, 2.2, 3.0)]
QUICK = ((signal.SIGINT, 0.05), (signal.SIGTERM, 2.2))


@pytest.mark.long
@pytest.mark.parametrize(
    ("stop", "after"), [m if m in QUICK else pytest.param(*m, marks=pytest.mark.long) for m in MOMENTS]
)
def test_an_interruption_at_any_moment_leaves_nothing_behind(tmp_path, stop, after):
    """As a terminal does it: the signal goes to the whole process group, compilers included."""
    out = tmp_path / "out"
    process = subprocess.Popen(
        [sys.executable, "-m", "ctrlgen", "run", str(SCENARIOS / "spiral"), "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while not handles(
        process.pid, signal.SIGTERM
    ):  # before, on a busy machine for seconds, Python itself is not there yet
        time.sleep(0.005)
    time.sleep(after)
    os.killpg(process.pid, stop)
    _, message = process.communicate(timeout=60)
    assert "Traceback" not in message
    if process.returncode == 0:  # too late: it had finished, and the result is whole
        assert {p.name for p in out.iterdir()} >= {"c", "figures", "summary.json", "trajectory.csv", "report.html"}
        assert list(tmp_path.iterdir()) == [out]
    else:
        assert process.returncode == 130 and "nothing was written" in message
        assert list(tmp_path.iterdir()) == []


def test_a_device_in_place_of_a_scenario_and_the_reverse_is_named(tmp_path):
    refused(ctrlgen("run", DEVICE, "--out", tmp_path / "out"), "describes a device")
    for scenario in (SCENARIOS / "circle20", SCENARIOS / "circle20" / "scenario.toml"):
        refused(
            ctrlgen("workspace", scenario, "--out", tmp_path / "out"), "is a scenario", "../devices/mems_hexapod.toml"
        )


@pytest.mark.long
def test_titles_with_brackets_are_printed_as_they_are(scenario, tmp_path):
    text = (scenario / "scenario.toml").read_text().replace('title = "t"', 'title = "scan [/raster] 20 [um] */ x"')
    (scenario / "scenario.toml").write_text(text)
    done = ctrlgen("run", scenario, "--out", tmp_path / "o[red]2")
    assert done.returncode == 0, done.stderr
    assert "scan [/raster] 20 [um] */ x" in done.stdout and "o[red]2/report.html" in done.stdout


def test_files_added_to_a_result_are_not_deleted(scenario, tmp_path):
    out = tmp_path / "out"
    assert ctrlgen("solve", scenario, "--out", out).returncode == 0
    (out / "mynotes.txt").write_text("precious")
    refused(ctrlgen("solve", scenario, "--out", out), "mynotes.txt", "did not make")
    assert (out / "mynotes.txt").read_text() == "precious"


@pytest.mark.long
def test_a_compiler_that_says_nothing_is_reported_with_its_command(scenario, tmp_path):
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "gcc").write_text('#!/bin/sh\n[ "$1" = --version ] && echo fake && exit 0\nexit 1\n')
    (tools / "gcc").chmod(0o755)
    refused(ctrlgen("run", scenario, "--out", tmp_path / "out", PATH=f"{tools}:/bin/nowhere"), "gcc", "status 1")


@pytest.mark.long
def test_a_device_without_dynamics_has_no_frequency_response(tmp_path):
    devices = DEVICES
    refused(
        ctrlgen("bode", devices / "meso_hexapod.toml", "--out", tmp_path / "b.svg", "--at", "delta_x=1um"),
        "dynamics: the device has none",
    )
    done = ctrlgen("bode", devices / "rrr_case2.toml", "--out", tmp_path / "b.png", "--at", "theta_z=-2mrad")
    assert done.returncode == 0, done.stderr


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "across", "says"),
    [
        ("mems_hexapod", "delta_z [um]", "delta_z 20 um"),
        ("meso_hexapod", "delta_z [um]", "delta_z 20 um"),
        ("rrr_case2", "theta_z [urad]", "theta_z -2195 urad"),
    ],
)
def test_the_workspace_of_any_device_is_mapped_by_one_command(tmp_path, name, across, says):
    out = tmp_path / "w"
    done = ctrlgen("workspace", DEVICES / f"{name}.toml", "--out", out)
    assert done.returncode == 0, done.stderr
    assert says in done.stdout and across in done.stdout and "anywhere" in done.stdout
    drawn = (out / "workspace.svg").read_text()
    assert across in drawn and "largest ball" in drawn
    assert len(json.loads((out / "workspace.json").read_text())["alone"]) == 3


@pytest.mark.long
def test_a_workspace_is_sliced_where_it_is_asked_for(tmp_path):
    rrr = DEVICES / "rrr_case2.toml"
    out = tmp_path / "w"
    done = ctrlgen("workspace", rrr, "--out", out, "--at", "theta_z=-2mrad,delta_x=1um")
    assert done.returncode == 0 and "delta_x 1 um, theta_z -2000 urad" in done.stdout
    refused(ctrlgen("workspace", rrr, "--out", out, "--at", "theta_z=2mrad"), "cannot be held")
    refused(ctrlgen("workspace", rrr, "--out", out, "--at", "theta_z"), "channel=value")
    refused(ctrlgen("workspace", rrr, "--out", out, "--at", "delta_z=1um"), "error: --at", "delta_z: is not a channel")


def test_an_expectation_out_of_range_gives_a_non_zero_status(scenario, tmp_path):
    with open(scenario / "scenario.toml", "a") as file:
        file.write('\n[[expect]]\nvalue = "force.1X.max"\nrange = ["1 N", "2 N"]\n')
    done = ctrlgen("solve", scenario, "--out", tmp_path / "out")
    assert done.returncode == 1 and "force.1X.max" in done.stdout and "out of tolerance" in done.stdout


@pytest.mark.long
def test_reproduce_prints_rows_as_a_table_and_as_json(tmp_path):
    done = ctrlgen("reproduce", "S1", "--out", tmp_path / "page.html")
    assert done.returncode == 0 and "reciprocity" in done.stdout
    assert re.search(r"eq\. \(5\) \(1,4\) +8\.70e-2 N, um +0\.0869\d+ +reproduced", done.stdout)
    assert (tmp_path / "page.html").read_text().count("<tr>") > 30
    rows = json.loads(ctrlgen("reproduce", "S2", "--json").stdout)
    names = {
        "source",
        "where",
        "printed",
        "ours",
        "difference",
        "taken_literally",
        "implied",
        "unit",
        "status",
        "reason",
    }
    assert names == set(rows[0])
    refused(ctrlgen("reproduce", "S9"), "S9", "S0, S1, S2, S3")


@pytest.mark.long
def test_check_tells_what_a_file_describes():
    assert "6 actuators" in ctrlgen("check", DEVICE).stdout
    assert "1000 samples" in ctrlgen("check", SCENARIOS / "circle20").stdout
    assert "1000 samples" in ctrlgen("check", SCENARIOS / "circle20" / "scenario.toml").stdout
    assert "can be followed within every limit" in ctrlgen("check", SCENARIOS / "circle20").stdout
    assert "as expected: cannot follow 1 of 1 sample" in ctrlgen("check", SCENARIOS / "unreachable").stdout


def test_check_explains_a_path_that_cannot_be_followed_and_a_duration_that_is_no_number_of_samples(tmp_path):
    text = (SCENARIOS / "circle20" / "scenario.toml").read_text().replace("../devices/mems_hexapod.toml", str(DEVICE))
    (tmp_path / "scenario.toml").write_text(text.replace('centre = { delta_z = "20 um" }', ""))
    ended = ctrlgen("check", tmp_path)
    assert ended.returncode == 1 and "the actuator only pushes" in ended.stderr and "shifted by delta_z" in ended.stderr
    (tmp_path / "scenario.toml").write_text(text.replace('duration = "1 s"', 'duration = "1.0005 s"'))
    ended = ctrlgen("check", tmp_path)
    assert ended.returncode == 1 and 'write duration = "1 s" or "1.001 s"' in ended.stderr


@pytest.mark.long
@pytest.mark.parametrize("suffix", ["svg", "png"])
def test_bode_draws_a_picture(tmp_path, suffix):
    done = ctrlgen("bode", DEVICE, "--out", tmp_path / f"b.{suffix}", "--at", "delta_x=2um,delta_z=20um")
    assert done.returncode == 0 and (tmp_path / f"b.{suffix}").stat().st_size > 10_000


@pytest.mark.long
@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--out", "b.pdf"), ".svg or .png"),
        (("--out", "b.svg", "--at", "delta_z"), "channel=value"),
        (("--out", "b.svg", "--at", "delta_q=1um"), "delta_q"),
        (("--out", "b.svg", "--at", "delta_z=900um"), "not an equilibrium"),
        (("--out", "b.svg", "--at", "delta_z=3V"), "wrong unit"),
    ],
)
def test_bode_refuses_what_it_cannot_draw(words, says):
    refused(ctrlgen("bode", DEVICE, *words), says)


def test_help_needs_no_library_of_the_work():
    """They take longer to import than the help to print."""
    heavy = "{'casadi', 'numpy', 'pint', 'pydantic', 'scipy', 'matplotlib'}"
    asked = f"import sys, ctrlgen.app.commands.cli; print(sorted({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True).stdout == "[]\n"

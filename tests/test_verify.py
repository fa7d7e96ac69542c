"""`ctrlgen verify`: one page of all that is known of a build; what failed is said, what did not run is never called passed."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENARIOS
from markupsafe import escape
from result_files import faults
from typer.testing import CliRunner

from ctrlgen import ToolError
from ctrlgen.app import scenario_pipeline as pipeline
from ctrlgen.app.commands import controllers  # noqa: F401, it registers the command
from ctrlgen.app.commands.app import app
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.package import verify_package
from ctrlgen.verification import hostile, in_loop, qemu, rules
from ctrlgen.verification.build_page import write_build
from ctrlgen.verification.build_record import BUDGETS, Build, record
from ctrlgen.verification.check import Check, CheckState, ToolFinding, not_run
from ctrlgen.verification.comparison import Comparison
from ctrlgen.verification.comparison_entry import ComparisonEntry, ComparisonKind
from ctrlgen.verification.emulated_target import CallCost, CallKind, NotRun, StoppedTarget, Target
from ctrlgen.verification.host import HostBuild
from ctrlgen.verification.in_loop import InLoop
from ctrlgen.verification.tracking import Piece

pytestmark = pytest.mark.long

KEYS = {
    "scenario",
    "inputs",
    "passed",
    "failures",
    "not_run",
    "interface",
    "budgets",
    "errors_along_the_trajectory",
    "targets",
    "stopped",
    "checks",
    "comparison",
    "compilers",
    "margins",
    "expected",
    "c",
    "program",
}
TOOLS = {
    "cppcheck --addon=misra",
    "clang-tidy",
    "gcc -fanalyzer",
    "clang --analyze",
    "sanitizers, random calls",
    "libFuzzer",
}


@pytest.fixture(scope="module")
def verified(compiler, tmp_path_factory) -> tuple[subprocess.CompletedProcess[str], Path]:
    """A small stage, on a computer that has a C compiler and what pip supplies, nothing else."""
    tools, out = tmp_path_factory.mktemp("tools"), tmp_path_factory.mktemp("verify") / "out"
    for name in (compiler, "as", "ld"):
        if shutil.which(name):
            (tools / name).symlink_to(shutil.which(name))
    words = [sys.executable, "-m", "ctrlgen", "verify", str(SCENARIOS / "rrr_circle"), "--out", str(out), "--quick"]
    env = {**os.environ, "PATH": str(tools), "COLUMNS": "200"}
    return subprocess.run(words, capture_output=True, text=True, env=env), out


def test_a_scenario_is_verified_end_to_end(verified):
    done, out = verified
    assert done.returncode == 0, done.stdout + done.stderr
    assert {path.name for path in out.iterdir()} == {"build.html", "build.json", "c", ".ctrlgen"}
    assert verify_package(out / "c") == ()
    found = json.loads((out / "build.json").read_text())
    assert set(found) >= KEYS and faults(found, "build") == []
    assert found["passed"] and not found["failures"] and all(row["passed"] for row in found["comparison"])
    assert found["budgets"] is None  # they are stated for six drives; this stage has three
    assert {row["c"] for row in found["errors_along_the_trajectory"]} == {"online C", "player C"}
    for run in found["targets"]:
        assert run["passed"] and 0 < run["instructions"]["scenario"] <= run["instructions"]["worst"]
    assert [row["name"] for row in found["interface"]["status"]][-3:] == ["LOST", "UNSURE", "CLOCK"]
    assert "passed" in done.stdout and str(out / "build.html") in done.stdout.replace("\n", "")


def test_missing_tools_are_not_run_with_their_remedy_and_fail_nothing(verified):
    done, out = verified
    found = json.loads((out / "build.json").read_text())
    missing = {row["what"]: row["remedy"] for row in found["not_run"]}
    assert {"cppcheck --addon=misra", "clang-tidy", "qemu-system-arm", "arm-none-eabi-gcc", "libFuzzer"} <= set(missing)
    assert "apt-get install clang-tidy" in missing["clang-tidy"] and "--quick" in missing["libFuzzer"]
    assert "apt-get install gcc-arm-none-eabi" in missing["arm-none-eabi-gcc"]
    for what, remedy in missing.items():
        assert f"not run: {what}: {remedy}" in done.stdout
    states = {check["tool"]: check["state"] for check in found["checks"]}
    assert set(states) >= TOOLS and all(states[tool] == "not run" for tool in missing if tool in states)


def test_the_page_holds_every_check_target_and_comparison(verified):
    _, out = verified
    found, page = json.loads((out / "build.json").read_text()), (out / "build.html").read_text()
    assert page.index("Everything that ran passed") < page.index("<h2>")
    assert f"{len(found['not_run'])} not run" in page
    for check in found["checks"]:
        assert check["tool"] in page
    for run in found["targets"]:
        assert str(run["instructions"]["worst"]) in page and f"{run['stack']} B" in page
    for row in found["comparison"]:
        assert str(escape(row["what"])) in page
    for digest in found["inputs"].values():
        assert digest in page
    assert page.count("<svg") == 2 + bool(found["targets"])
    assert not re.search(r'(src|href)="(?!#)', page)  # self-contained


@pytest.mark.long
def test_the_same_input_gives_the_same_numbers_on_a_page_twice(example, tmp_path):
    for name in ("a", "b"):
        write_build(tmp_path / name, example)
    for file in ("build.html", "build.json"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


@pytest.fixture(scope="module")
def example(circle, circle_c) -> Build:
    """A build of six drives in which all is well."""
    cost = CallCost(what=CallKind.STEP_SCENARIO, calls=10, mean=500.0, worst=601, worst_within=601)
    sizes = {"stack": 256, "code": 1000, "tables": 100, "writable": 0}
    same = {"numbers": 500, "differing": 0, "ulp": 0, "where": ""}
    run = Target(core="Cortex-M4F", compiler="zig 0.13", real=Real.FLOAT, costs=(cost,), **sizes, **same)
    numbers = {"worst": 0.0, "rms": 0.0, "limit": 1.0, "samples": 10, "first": None}
    host = HostBuild("gcc", Real.DOUBLE)
    row = ComparisonEntry(build=host, what=ComparisonKind.FOLLOWED, signal="drive", unit="W", **numbers)
    errors = {Piece.ONLINE: {real: np.full((5, 6), 1e-12) for real in Real}}
    check = Check("clang-tidy", "14", (("x.c", Real.FLOAT),), CheckState.PASSED)
    return Build(
        circle, circle_c, (), Comparison((row,), {"gcc": "gcc 12"}, ()), InLoop((run,), (), ()), (check,), errors
    )


def shown(build: Build, out: Path) -> str:
    write_build(out, build)
    return (out / "build.html").read_text()


def test_what_is_well_passes_and_budgets_are_stated_for_six_drives(example, tmp_path):
    assert example.passed and record(example).as_json()["budgets"] == {"core": "Cortex-M4F", **BUDGETS}
    page = shown(example, tmp_path)
    assert "Everything that ran passed" in page and "not run" not in re.sub(r"<style>.*?</style>", "", page, flags=re.S)


def refused(file: str, line: int, severity: str, rule: str) -> ToolFinding:
    """A rule of MISRA C that is broken and not permitted."""
    text = f"MISRA C:2012 rule {rule}"
    return ToolFinding(file=file, line=line, rule=f"misra-c2012-{rule}", severity=severity, text=text, permitted=False)


def broken(build: Build) -> dict[str, tuple[Build, str]]:
    """The same build with one thing wrong, and what must be said of it."""
    run, row, check = build.in_loop.runs[0], build.comparison.rows[0], build.checks[0]
    finding = refused("x.c", 7, "mandatory", "13.6")
    off = run.model_copy(update={"differing": 3, "ulp": 2, "where": "step, along the scenario, call 4"})
    words = "f did not return within 10 s on the emulated core"
    stopped = StoppedTarget(core="Cortex-M7", compiler="zig 0.13", real=Real.DOUBLE, words=words)
    wrong = row.model_copy(update={"worst": 2.0, "first": 3})
    return {
        "bits": (replace(build, in_loop=InLoop((off,), (), ())), "3 of 500 numbers differ"),
        "memory": (
            replace(build, in_loop=InLoop((run.model_copy(update={"writable": 4}),), (), ())),
            "4 bytes of static writable memory",
        ),
        "stopped": (replace(build, in_loop=InLoop((run,), (stopped,), ())), "f did not return within 10 s"),
        "tolerance": (
            replace(build, comparison=replace(build.comparison, rows=(wrong,))),
            "gcc double: scenario, online C - CasADi, drive, is out of tolerance",
        ),
        "rule": (
            replace(build, checks=(replace(check, state=CheckState.FAILED, findings=(finding,)),)),
            "clang-tidy: 1 finding, first x.c:7: mandatory: MISRA C:2012 rule 13.6",
        ),
    }


@pytest.mark.parametrize("kind", ["bits", "memory", "stopped", "tolerance", "rule"])
def test_anything_that_fails_fails_the_build_and_stands_first_on_the_page(example, tmp_path, kind):
    build, words = broken(example)[kind]
    assert not build.passed and len(build.failures) == 1 and words in build.failures[0]
    page = shown(build, tmp_path)
    assert "1 failed" in page and "Everything that ran passed" not in page
    assert page.index(words) < page.index("<h2>")
    assert record(build).passed is False


def test_what_did_not_run_is_listed_and_is_neither_passed_nor_failed(example, tmp_path):
    build = replace(
        example,
        checks=(not_run("clang-tidy", (), "clang-tidy is missing; apt-get install clang-tidy"),),
        in_loop=InLoop((), (), (NotRun(what="emulated cores", remedy="pip install unicorn pyelftools"),)),
        comparison=replace(example.comparison, missing=("clang",)),
    )
    assert build.passed and [row.what for row in build.not_run] == ["clang", "emulated cores", "clang-tidy"]
    page = shown(build, tmp_path)
    assert "3 not run" in page and "apt-get install clang-tidy" in page and "pip install unicorn pyelftools" in page
    assert '<span class="idle">not run</span>' in page and '<span class="ok">passed</span>' not in page


@pytest.fixture
def stubbed(monkeypatch, compiler):
    """Everything but solving, generating and writing replaced by an answer at once."""
    monkeypatch.setattr(
        in_loop,
        "run_in_loop",
        lambda *_: InLoop((), (), (NotRun(what="emulated cores", remedy="pip install unicorn pyelftools"),)),
    )
    monkeypatch.setattr(qemu, "check_on_boards", lambda *_: ())
    monkeypatch.setattr(hostile, "check_hostile", lambda *_, **__: ())
    monkeypatch.setattr(rules, "check_rules", lambda *_, **__: ())
    return monkeypatch


@pytest.mark.long
def test_a_failing_check_gives_status_1_and_the_page_is_written(stubbed, tmp_path):
    finding = refused("a.c", 3, "advisory", "15.1")
    failing = Check("cppcheck --addon=misra", "2.10", (), CheckState.FAILED, (finding,))
    stubbed.setattr(rules, "check_rules", lambda *_, **__: (failing,))
    out = tmp_path / "out"
    done = CliRunner().invoke(app, ["verify", str(SCENARIOS / "rrr_circle"), "--out", str(out)])
    assert done.exit_code == 1
    assert "failed: cppcheck --addon=misra: 1 finding, first a.c:3" in done.output
    assert json.loads((out / "build.json").read_text())["passed"] is False


def test_c_that_a_compiler_refuses_leaves_nothing_behind(stubbed, tmp_path):
    def refuse(*_):
        raise ToolError("gcc refuses the C:\nunused")

    stubbed.setattr(pipeline, "compare", refuse)
    with pytest.raises(ToolError, match="refuses the C"):
        pipeline.verify(SCENARIOS / "rrr_circle", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


# .ci/run does this at the command line
@pytest.mark.exhaustive
def test_the_circle_passes_everything_that_is_there(compiler, tmp_path):
    build = pipeline.verify(SCENARIOS / "circle20", tmp_path / "out")
    assert build.passed, build.failures

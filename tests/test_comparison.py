"""The comparison finds what is wrong with a C file, and says where."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace

import pytest

from ctrlgen import ToolError
from ctrlgen.firmware.c import toolchains
from ctrlgen.firmware.c.real import Real
from ctrlgen.reporting.result_file import json_text
from ctrlgen.verification.comparison import Comparison, compare
from ctrlgen.verification.comparison_entry import ComparisonEntry, ComparisonKind
from ctrlgen.verification.host import HostBuild

pytestmark = pytest.mark.long


def entry(compiler: str, real: Real, worst: float, first: int | None = None) -> ComparisonEntry:
    numbers = {"worst": worst, "rms": 0.0, "limit": 1.0, "samples": 9, "first": first}
    return ComparisonEntry(
        build=HostBuild(compiler, real), what=ComparisonKind.CURVE, signal="drive", unit="W", **numbers
    )


def test_the_worst_build_of_each_arithmetic_is_shown_first_one_out_of_tolerance():
    rows = entry("gcc", Real.DOUBLE, 0.1), entry("clang", Real.DOUBLE, 0.2), entry("gcc", Real.FLOAT, 0.5)
    failed = entry("clang", Real.FLOAT, float("nan"), 0)
    assert Comparison(rows, {}, ()).worst == (rows[1], rows[2])
    assert Comparison((*rows, failed), {}, ()).worst == (rows[1], failed)
    assert json.loads(json_text(failed))["worst"] is None and not failed.passed


@pytest.fixture
def folder(tmp_path, circle_c, compiler):
    """The circle's C, to be spoilt."""
    shutil.copytree(circle_c.path, tmp_path, dirs_exist_ok=True)
    return replace(circle_c, path=tmp_path)


def spoil(folder, real: Real, kind: str, pattern: str, replacement: str) -> None:
    path = folder.path / f"{getattr(folder, kind)[real]}.c"
    text, count = re.subn(pattern, replacement, path.read_text(), count=1)
    assert count == 1, pattern
    path.write_text(text)


def test_a_controller_that_is_a_little_off_is_found_by_each_reference(folder, circle):
    spoil(folder, Real.DOUBLE, "online", r"(\(\S+ \* target_5\))", r"(1.0000001 * \1)")
    comparison = compare(folder, circle)
    assert not comparison.passed
    failed = {(row.build.real, row.what) for row in comparison.rows if not row.passed}
    assert (Real.DOUBLE, "scenario, online C - CasADi") in failed
    assert (Real.DOUBLE, "scenario, online C - IPOPT") in failed or (
        Real.DOUBLE,
        "online C -> model - command",
    ) in failed
    assert not any(real is Real.FLOAT for real, _ in failed)
    assert min(row.first for row in comparison.rows if not row.passed) == 0


def test_one_wrong_number_of_the_player_is_found_at_its_place(folder, circle):
    path = folder.path / f"{folder.player[Real.FLOAT]}.c"
    curve = folder.compression[Real.FLOAT].curve
    lines = path.read_text().splitlines(True)
    row = next(i for i, line in enumerate(lines) if "CONTROL[" in line) + 1 + 11  # acts on segments 8 to 11
    lines[row] = re.sub(r"0\.(\d)", lambda m: f"0.{(int(m[1]) + 1) % 10}", lines[row], count=1)
    path.write_text("".join(lines))
    rows = [row for row in compare(folder, circle).rows if not row.passed]
    assert {row.what for row in rows} >= {"player C - its curve", "player C - IPOPT", "player C -> model - command"}
    length = len(circle.drive) / curve.pieces[0].segments
    assert all(8 * length <= row.first < 9 * length for row in rows if row.what == "player C - its curve")


def test_a_forgotten_limit_is_found_by_the_hostile_sequence(folder, circle):
    spoil(folder, Real.FLOAT, "online", r"(U_HIGH\[6\] = \{ )1\.0\d*f", r"\g<1>1.5f")
    failed = {row.what for row in compare(folder, circle).rows if not row.passed}
    assert "hostile sequence -> model: excess over a limit" in failed


def test_a_controller_that_always_reports_a_limit_is_held_to_every_equilibrium(folder, circle):
    """Its drive is off by a thousandth, and its status says each time that a limit moved it."""
    status = "    if (out != NULL) { out->drive[0] *= 1.001; }\n    return status | MEMS_HEXAPOD_ONLINE_F64_COMPOSITE;"
    spoil(folder, Real.DOUBLE, "online", r"(?s)(_settle\([^;]*\)\n\{\n.*?)    return status;", rf"\g<1>{status}")
    failed = {(row.build.real, row.what) for row in compare(folder, circle).rows if not row.passed}
    assert (Real.DOUBLE, ComparisonKind.EQUILIBRIA) in failed


def test_c_with_a_warning_is_refused_with_the_compilers_words(folder, circle):
    spoil(folder, Real.DOUBLE, "online", r"uint32_t status = 0U;", "uint32_t status = 0U; int unused_thing;")
    with pytest.raises(ToolError, match="unused_thing"):
        compare(folder, circle)


def test_c_that_hangs_up_is_reported(folder, circle):
    spoil(
        folder,
        Real.DOUBLE,
        "online",
        r"    uint32_t status = MEMS_HEXAPOD_ONLINE_F64_INPUT;",
        "    uint32_t status = MEMS_HEXAPOD_ONLINE_F64_INPUT;\n    if (target[5] > 0.0) { (void)*(volatile int *)0; }",
    )
    with pytest.raises(ToolError):
        compare(folder, circle)


def test_without_a_compiler_the_message_says_what_to_install(folder, circle, monkeypatch):
    monkeypatch.setattr(toolchains.shutil, "which", lambda _: None)
    with pytest.raises(ToolError, match="apt-get install gcc"):
        compare(folder, circle)


def test_a_compiler_that_is_not_there_is_named_as_not_run(folder, circle, monkeypatch):
    import shutil

    real_which = shutil.which
    present = "gcc" if real_which("gcc") else "clang"
    monkeypatch.setattr(toolchains.shutil, "which", lambda name: real_which(name) if name == present else None)
    comparison = compare(folder, circle)
    assert (
        comparison.passed
        and len(comparison.missing) == 1
        and all(row.build.compiler == present for row in comparison.rows)
    )

"""The generated C breaks no rule, DEVIATIONS.md is exact, hostile calls find nothing, and every one of these checks can fail."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import three_stacks
from conftest import SCENARIOS, effect_device
from one_kernel import print_function

from ctrlgen import build_model, load_scenario, solve
from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.deviations import DEVIATIONS, permits
from ctrlgen.firmware.c.elementary import elementary_text
from ctrlgen.firmware.c.misra import ADVISORY, MANDATORY, rule_class
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder, generate, write_harness
from ctrlgen.verification.check import Check
from ctrlgen.verification.host import run_host
from ctrlgen.verification.hostile import check_hostile
from ctrlgen.verification.rules import ANALYZERS, check_rules, run_analyzer

pytestmark = pytest.mark.long

STATIC = ("cppcheck --addon=misra", "clang-tidy", "gcc -fanalyzer", "clang --analyze")
HOSTILE = ("sanitizers, random calls", "libFuzzer")


@pytest.fixture(scope="module")
def stage():
    """A small stage: scenario and model."""
    scenario = load_scenario(SCENARIOS / "rrr_circle")
    return scenario, build_model(scenario.device)


@pytest.fixture(scope="module")
def folder(stage, tmp_path_factory) -> CFolder:
    return generate(*stage, tmp_path_factory.mktemp("c"))


@pytest.fixture(scope="module")
def checks(folder) -> dict[str, Check]:
    return by_tool(check_rules(folder))


def by_tool(checks: tuple[Check, ...]) -> dict[str, Check]:
    return {check.tool: check for check in checks}


def ran(check: Check) -> Check:
    if check.state == "not run":
        pytest.skip(check.note)
    return check


def planted(folder: CFolder, into: Path, faults: dict[Real, tuple[str, str]]) -> CFolder:
    """A copy of `folder` whose online controllers have a text replaced."""
    shutil.copytree(folder.path, into)
    for real, (old, new) in faults.items():
        path = into / f"{folder.online[real]}.c"
        text = path.read_text()
        assert old in text, f"the place to plant the fault is gone: {old}"
        path.write_text(text.replace(old, new, 1))
    return replace(folder, path=into)


def listed(folder: CFolder) -> set[tuple[str, str]]:
    """(rule, file) of every row of DEVIATIONS.md."""
    rows = re.findall(r"^\| (\d+\.\d+) \| (.+?) \|", (folder.path / "DEVIATIONS.md").read_text(), re.M)
    return {(rule, file) for rule, files in rows for file in files.split(", ")}


def reported(check: Check) -> set[tuple[str, str]]:
    return {(f.rule.removeprefix("misra-c2012-"), f.file) for f in check.findings if f.permitted}


@pytest.mark.parametrize("tool", STATIC)
def test_the_generated_c_breaks_no_rule(checks, tool):
    check = ran(checks[tool])
    assert check.passed, [str(f) for f in check.findings if not f.permitted]
    assert check.version and len(check.subjects) == 8  # controller, its vectors, their test and its program, twice


def test_the_list_of_deviations_is_what_is_reported_no_more_no_less(folder, checks):
    check = ran(checks[STATIC[0]])
    assert listed(folder) == reported(check)
    # Required: stdio of the test
    assert {f.severity for f in check.findings if f.permitted} == {
        "advisory",
        "required",
    }


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [
        "xy_stage_force",
        *(pytest.param(name, marks=pytest.mark.exhaustive) for name in ("circle20", "meso_circle", "tilt_platform")),
    ],
)
def test_other_devices_break_no_rule_either(name, tmp_path):
    scenario = load_scenario(SCENARIOS / name)
    folder = generate(scenario, build_model(scenario.device), tmp_path)
    for check in check_rules(folder):
        assert check.state != "failed", [str(f) for f in check.findings if not f.permitted]
        if check.tool == STATIC[0] and check.state == "passed":
            assert listed(folder) == reported(check)


@pytest.mark.long
def test_more_drives_than_axes_with_inertia_and_rates_break_no_rule_either(tmp_path):
    scenario, model = three_stacks.loaded(
        tmp_path, three_stacks.heavy(drive_rate={"a": "5 V/ms"}), three_stacks.circle(20)
    )
    for check in check_rules(generate(scenario, model, tmp_path / "c")):
        assert check.state != "failed", [str(f) for f in check.findings if not f.permitted]


def test_the_player_of_a_path_that_ends_breaks_no_rule(tmp_path):
    scenario = load_scenario(SCENARIOS / "flexure_axis_line")
    model = build_model(scenario.device)
    folder = generate(scenario, model, tmp_path, solve(scenario, model))
    check = ran(by_tool(check_rules(folder))[STATIC[0]])
    assert check.passed, [str(f) for f in check.findings if not f.permitted]
    assert listed(folder) == reported(check)


@pytest.mark.exhaustive
def test_the_list_of_deviations_is_exact_with_a_player(circle, tmp_path):
    folder = generate(circle.scenario, circle.model, tmp_path, circle)
    check = ran(by_tool(check_rules(folder))[STATIC[0]])
    assert listed(folder) == reported(check)


@pytest.mark.long
@pytest.mark.parametrize("kind", [pytest.param(kind, marks=pytest.mark.exhaustive) for kind in ("creep", "hysteresis")])
def test_controllers_of_devices_with_effects_break_no_rule_and_survive_hostile_calls(kind, tmp_path):
    effects = {
        "creep": {"kind": "creep", "at": "1X", "tau": "0.03 s", "gain": 0.02, "slow": 0.3},
        "hysteresis": {"kind": "hysteresis", "at": "1X", "stiffness": "0.0015 N/um", "reach": "0.3 um", "taper": 0.0},
    }
    scenario = replace(load_scenario(SCENARIOS / "circle20"), device=effect_device(effects[kind]))
    model = build_model(scenario.device)
    folder = generate(scenario, model, tmp_path)
    for check in (*check_rules(folder), *check_hostile(folder, scenario, model, runs=2000)):
        assert check.state != "failed", [str(f) for f in check.findings if not f.permitted]


def test_every_operation_is_printed_within_the_rules(tmp_path):
    if not shutil.which("cppcheck"):
        pytest.skip("cppcheck is missing (apt-get install cppcheck): the printed operations were not checked")
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    operations = [
        a + b,
        a - b,
        a * b,
        a / b,
        -a,
        -(-a - b),
        a * a,
        2 * a,
        1 / a,
        -2 * a,
        a - (-2.5),
        ca.fmin(a, b),
        ca.fmax(a, b),
        ca.fabs(a - 3),
        ca.sign(a - b),
        ca.sqrt(a),
        ca.exp(a),
        ca.log(a),
        ca.sin(a),
        ca.cos(a),
        ca.atan(a),
        ca.atan2(a, b),
        a**2.5,
        a**b,
        a < b,
        a <= b,
        ca.eq(a, b),
        ca.ne(a, b),
        ca.logic_and(a, b),
        ca.logic_or(a, b),
        ca.logic_not(a),
        ca.if_else(a < b, a, b),
        ca.floor(a),
        ca.ceil(a),
        ca.tan(a),
        ca.asin(a),
        ca.acos(a),
        ca.tanh(a),
        ca.sinh(a),
        ca.cosh(a),
        a**-3,
        a**0.3,
    ]
    function = ca.Function("f", [a, b], [ca.vertcat(*operations)], ["a", "b"], ["r"])
    for real in Real:
        head = f"void g(const {real.value} a[1], const {real.value} b[1], {real.value} r[{len(operations)}])"
        kernel = print_function(function, "f", real)
        body = f"{kernel.text}\n{head}\n{{\n    {kernel.call('r', a='a', b='b')};\n}}\n"
        (tmp_path / f"{real.suffix}.c").write_text(
            f"#include <stdint.h>\n{head};\n{elementary_text(kernel.calls, real)}{body}"
        )
        words = ["cppcheck", "--addon=misra", "--std=c99", "--quiet", "--enable=style", "--template={id}"]
        done = subprocess.run([*words, str(tmp_path / f"{real.suffix}.c")], capture_output=True, text=True)
        unions = ["misra-c2012-19.2"] * 3  # of root, exponential, logarithm: permitted
        assert done.returncode == 0 and (done.stdout + done.stderr).split() == unions


@pytest.fixture(scope="module")
def broken(folder, tmp_path_factory) -> dict[str, Check]:
    """Checks of a folder with planted faults: a goto and a double constant in float, a mandatory rule and a null pointer in double."""
    jump = "    uint32_t status = {0};\n    double wide = (double)status * 1.5;\n    if (wide > 40.0) {{ goto end; }}\nend:\n"
    null = "    uint32_t status = {0};\n    int *nowhere = 0;\n    if (sizeof(status++) > 9u) {{ status = 3; }}\n    *nowhere = 1;\n"
    faults = {}
    for real, text in ((Real.FLOAT, jump), (Real.DOUBLE, null)):
        macro = f"{folder.online[real].upper()}_INPUT"
        faults[real] = (f"    uint32_t status = {macro};\n", text.format(macro))
    return by_tool(check_rules(planted(folder, tmp_path_factory.mktemp("bad") / "c", faults)))


@pytest.mark.parametrize(
    ("tool", "real", "rule"),
    [
        ("cppcheck --addon=misra", Real.FLOAT, "misra-c2012-15.1"),
        pytest.param("cppcheck --addon=misra", Real.DOUBLE, "misra-c2012-13.6", marks=pytest.mark.long),
        ("cppcheck --addon=misra", Real.DOUBLE, "nullPointer"),
        ("clang-tidy", Real.DOUBLE, "clang-analyzer-core.NullDereference"),
        ("gcc -fanalyzer", Real.DOUBLE, "-Wanalyzer-null-dereference"),
        ("clang --analyze", Real.DOUBLE, "core.NullDereference"),
    ],
)
def test_a_planted_fault_is_reported(broken, folder, tool, real, rule):
    check = ran(broken[tool])
    assert check.state == "failed"
    found = [f for f in check.findings if rule in f.rule and f.file == f"{folder.online[real]}.c"]
    assert found and not any(f.permitted for f in found), [str(f) for f in check.findings]
    if rule == "misra-c2012-13.6":
        assert found[0].severity == "mandatory"


def test_a_double_constant_in_float_is_reported(folder, tmp_path):
    status = f"    uint32_t status = {folder.online[Real.FLOAT].upper()}_INPUT;\n"
    wide = status + "    const float wide = 1.5 * (float)status;\n    (void)wide;\n"
    check = ran(run_analyzer(ANALYZERS[1], planted(folder, tmp_path / "c", {Real.FLOAT: (status, wide)})))
    assert check.state == "failed" and {"-Wdouble-promotion", "-Wfloat-conversion"} & {f.rule for f in check.findings}


def test_an_analyzer_that_gives_up_has_not_passed(folder):
    """gcc's own limit leaves a controller half analysed, and without the warning that is asked for nothing says so."""
    gcc = ANALYZERS[1]
    limited = replace(
        gcc,
        words=(*gcc.words, "--param=analyzer-bb-explosion-factor=1", "--param=analyzer-max-enodes-per-program-point=1"),
    )
    check = run_analyzer(limited, folder)
    assert check.state == "not run" and ("gave up" in check.note or "missing" in check.note)


@pytest.mark.long
def test_hostile_calls_find_nothing(folder, stage):
    for check in check_hostile(folder, *stage, runs=3000):
        if check.state == "not run":
            continue
        assert check.passed, [str(f) for f in check.findings]
        assert check.note.count("calls") + check.note.count("edges of the generated C") == 2  # both arithmetics ran


@pytest.mark.exhaustive
def test_many_hostile_calls_of_controller_and_player_find_nothing(circle, tmp_path):
    folder = generate(circle.scenario, circle.model, tmp_path, circle)
    for check in check_hostile(folder, circle.scenario, circle.model):
        assert check.state != "failed", [str(f) for f in check.findings]


@pytest.mark.long
def test_planted_faults_are_found_by_hostile_calls(folder, stage, tmp_path):
    """A write beyond the end in float; a drive that is not limited in double: each is found by chance and by the fuzzer."""
    n, safe = len(stage[1].axes), f"{folder.online[Real.FLOAT].upper()}_U_SAFE"
    faults = {
        Real.FLOAT: (
            f"    for (i = 0; i < {n}; i++) {{\n        out->drive[i] = {safe}[i];",
            f"    for (i = 0; i < {9 * n}; i++) {{\n        out->drive[i] = {safe}[i % {n}];",
        ),
        Real.DOUBLE: ("            value[i] = high[i];", "            hit = 1;"),
    }
    bad = planted(folder, tmp_path / "c", faults)
    for check in check_hostile(bad, *stage, runs=20_000):
        if check.state != "not run":
            assert check.state == "failed", check.tool
            words = [str(f) for f in check.findings]
            assert any("AddressSanitizer" in w or "undefined" in w for w in words), words
            assert any("every drive is a number within its limits" in w for w in words), words


def test_a_missing_tool_is_not_run_and_named_with_its_remedy(folder, stage, monkeypatch):
    monkeypatch.setenv("PATH", "")
    checks = (*check_rules(folder), *check_hostile(folder, *stage, runs=10))
    assert [check.tool for check in checks] == [*STATIC, *HOSTILE]
    for check in checks:
        assert check.state == "not run" and not check.passed and not check.findings
        assert "missing" in check.note and "apt-get install" in check.note


def test_a_tool_that_stops_without_a_word_on_the_c_did_not_run(folder, monkeypatch, tmp_path):
    for name in ("cppcheck", "clang-tidy", "gcc", "clang"):
        (tmp_path / name).write_text(
            '#!/bin/sh\nif [ "$1" = --version ]; then echo "version 1.2"; else echo no licence >&2; exit 3; fi\n'
        )
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    for check in check_rules(folder):
        assert check.state == "not run" and "no licence" in check.note and check.version == "version 1.2"


def test_classes_of_rules():
    assert not MANDATORY & ADVISORY
    assert [rule_class(r) for r in ("13.6", "15.5", "10.6", "99.9")] == [
        "mandatory",
        "advisory",
        "required",
        "required",
    ]
    assert all(rule_class(d.number) == "advisory" for d in DEVIATIONS)
    assert permits("21.6", "test_a_f32.c") and not permits("21.6", "a_online_f32.c")


@pytest.mark.parametrize("garbage", [np.nan, np.inf, -np.inf, 1e300, -1e9])
@pytest.mark.parametrize("part", ["x", "z"])
def test_from_a_state_of_garbage_c_and_python_answer_alike_and_admissibly(
    folder, stage, compiler, tmp_path, part, garbage
):
    scenario, model = stage
    write_harness(folder, scenario, model, Real.DOUBLE, tmp_path / "harness.c")
    program = tmp_path / "harness"
    words = [
        compiler,
        "-std=c99",
        f"-I{folder.path}",
        str(tmp_path / "harness.c"),
        *map(str, folder.sources(Real.DOUBLE)),
    ]
    subprocess.run([*words, "-o", str(program)], check=True)
    controller = controller_of(model, scenario.file.follow, scenario.sample_time)
    x, z = controller.rest()
    (x if part == "x" else z)[0] = garbage
    target = scenario.bind(model).samples[:3]
    n, state, steps = len(model.axes), (x, z), []
    with np.errstate(all="ignore"):
        for row in target:
            steps.append(controller.step(state, row))
            state = steps[-1].state
    answer = run_host(program, "follow", target, 2 * n + model.n_states, (x, z))
    low, high = model.u_bounds
    for row, step in zip(answer, steps, strict=True):
        assert not step.status & ControllerStatus.INPUT and int(row[0]) == step.status
        if not np.isfinite(garbage):  # huge numbers cancel: there the last digit decides
            assert row[1 : 1 + n] == pytest.approx(step.drive, rel=1e-9, abs=1e-12)
        assert np.all((row[1 : 1 + n] >= low) & (row[1 : 1 + n] <= high))
        assert np.all((step.drive >= low) & (step.drive <= high))

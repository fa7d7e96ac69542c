"""Where a folder has the controller in integers, and which devices are refused it."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace

import pytest
from conftest import SCENARIOS, effect_device
from package_programs import ARDUINO, STRICT, ZEPHYR, run
from three_stacks import stage

from ctrlgen import ControllerStatus, InputError, build_model, load_device, load_scenario, solve
from ctrlgen.controller.fixed_maps import NoFixedPoint
from ctrlgen.controller.fixed_point import fixed_point
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Integers, Real
from ctrlgen.firmware.folder import CFolder, generate
from ctrlgen.firmware.package import verify_package
from ctrlgen.trajectory.solution import Solution
from ctrlgen.verification import in_loop
from ctrlgen.verification.check import CheckState
from ctrlgen.verification.comparison import compare
from ctrlgen.verification.comparison_entry import ComparisonKind
from ctrlgen.verification.cores import M0_PLUS, cross_compilers
from ctrlgen.verification.emulation import available
from ctrlgen.verification.hostile import check_hostile
from ctrlgen.verification.qemu import check_on_boards
from ctrlgen.verification.reference import ReferenceAnswers
from ctrlgen.verification.rules import check_rules

Q31 = Integers.Q31
USES = """
#include "%(name)s_online_f32.h"
#include "%(name)s_checked_f32.h"
#include "%(name)s_online_q31.h"
int main(void)
{
    static %(name)s_online_f32_state plain;
    static %(name)s_checked_f32_state checked;
    static %(name)s_online_q31_state integers;
    %(name)s_online_f32_init(&plain);
    %(name)s_checked_f32_init(&checked);
    %(name)s_online_q31_init(&integers);
    return 0;
}
"""


def test_devices_without_a_controller_in_integers_are_refused_with_the_reason():
    hexapod = SCENARIOS / "devices" / "mems_hexapod.toml"
    creep = {"kind": "creep", "at": "1X", "gain": "0.02", "tau": "10 s", "slow": "0.1"}
    found = {
        "no state": "meso_circle",
        "state beyond its limits": "rrr_circle",
        "has inertia": "dynamic_circle",
        "limits on rates of drives": "tilt_platform",
    }
    devices = {why: load_scenario(SCENARIOS / name).device for why, name in found.items()} | {
        "more drives than axes": stage(),
        "given at the start": load_device(SCENARIOS / "devices" / "mems_hexapod_run_time.toml"),
        "an effect of the device remembers": effect_device(creep),
        "cannot be kept by drives": effect_device({"kind": "heat_crosstalk", "at": "1X", "share": "0.05"}),
    }
    for why, device in devices.items():
        with pytest.raises(NoFixedPoint, match=why):
            fixed_point(controller_of(build_model(device), "pose", 1e-3))
    with pytest.raises(NoFixedPoint, match="no sample_rate"):
        fixed_point(controller_of(build_model(load_device(hexapod)), "pose", None))


def test_a_refusal_leaves_no_folder(tmp_path):
    folder = tmp_path / "scenarios" / "meso_circle"
    shutil.copytree(SCENARIOS / "meso_circle", folder)
    shutil.copytree(SCENARIOS / "devices", tmp_path / "scenarios" / "devices")
    path = folder / "scenario.toml"
    path.write_text("fixed_point = true\n" + path.read_text())
    scenario = load_scenario(folder)
    with pytest.raises(InputError, match="fixed_point: is asked for, but its actuators have no state"):
        generate(scenario, build_model(scenario.device), tmp_path / "c")
    assert not (tmp_path / "c").exists()


@pytest.mark.long
def test_the_package_has_it_where_the_scenario_asks_for_it_alone(tmp_path):
    """With a checksum beside it; both in one project with a folder of the same controller that has neither."""
    scenarios, added = tmp_path / "scenarios", ""
    shutil.copytree(SCENARIOS / "devices", scenarios / "devices")
    for name in ("plain", "with_both"):
        asked = name == "with_both"
        shutil.copytree(SCENARIOS / "circle20", scenarios / name)
        path = scenarios / name / "scenario.toml"
        if asked:
            path.write_text("fixed_point = true\nchecksum = true\n" + path.read_text())
        scenario = load_scenario(path.parent)
        c = generate(scenario, build_model(scenario.device), tmp_path / name)
        added += f"add_subdirectory({c.path} {name}_build)\n"
        files = {file.name for file in c.path.glob("*q31*")}
        parts = ("mems_hexapod_online_q31", "with_both_selftest_q31", "with_both_vectors_q31")
        assert files == ({f"{part}.{kind}" for part in parts for kind in "ch"} if asked else set())
        assert verify_package(c.path) == ()
        for text in ((c.path / file).read_text() for file in ("README.md", "CMakeLists.txt")):
            assert ("q31" in text) == asked
            assert ("checked_f32" in text or "_checked_${real}" in text) == asked
        if asked:
            assert re.search(rf"void {c.init[Q31]}\(", (c.path / f"{c.online[Q31]}.h").read_text())
    if shutil.which("cmake"):
        (tmp_path / "main.c").write_text(USES % {"name": "mems_hexapod"})
        (tmp_path / "CMakeLists.txt").write_text(
            f"cmake_minimum_required(VERSION 3.16)\nproject(firmware C)\n{added}add_executable(app main.c)\n"
            f"target_link_libraries(app PRIVATE ctrlgen::plain_f32 ctrlgen::with_both_f32 ctrlgen::{c.online[Q31]})\n"
        )
        for words in (["-S", tmp_path, "-B", tmp_path / "b"], ["--build", tmp_path / "b", "--target", "app"]):
            done = subprocess.run(["cmake", *words], capture_output=True, text=True)
            assert done.returncode == 0, done.stderr
        subprocess.run([tmp_path / "b" / "app"], check=True)


@pytest.fixture(scope="module")
def integers(tmp_path_factory) -> tuple[CFolder, Solution]:
    """The circle with a controller in integers."""
    home = tmp_path_factory.mktemp("integers")
    shutil.copytree(SCENARIOS / "devices", home / "devices")
    shutil.copytree(SCENARIOS / "circle20", home / "circle20")
    path = home / "circle20" / "scenario.toml"
    path.write_text("fixed_point = true\n" + path.read_text())
    scenario = load_scenario(path.parent)
    model = build_model(scenario.device)
    solution = solve(scenario, model)
    return generate(scenario, model, home / "c", solution), solution


def alone(c: CFolder) -> CFolder:
    """The folder as if it had nothing but integers."""
    q31 = {name: {Q31: getattr(c, name)[Q31]} for name in ("online", "selftest", "vectors", "init")}
    return replace(c, player={}, checked={}, compression={}, **q31)


def spoilt(c: CFolder, folder, right: str, wrong: str) -> CFolder:
    """The folder with one line of the controller in integers changed."""
    shutil.copytree(c.path, folder)
    path = folder / f"{c.online[Q31]}.c"
    text = path.read_text()
    assert right in text
    path.write_text(text.replace(right, wrong))
    return replace(alone(c), path=folder)


@pytest.mark.long
def test_what_verifies_the_c_looks_at_integers_too(integers, tmp_path):
    """Bits of every compiler and of emulated cores, the self test on boards, rules, hostile calls; and a wrong line is found by each."""
    c, solution = integers
    reference, scenario, model = ReferenceAnswers(solution), solution.scenario, solution.model
    comparison = compare(alone(c), solution, reference=reference)
    assert comparison.passed
    exact = [row for row in comparison.rows if row.what.is_controller]
    assert {row.what for row in exact} == {
        ComparisonKind.FOLLOWED_INTEGERS, ComparisonKind.SETTLED_INTEGERS, ComparisonKind.CHASED_INTEGERS,
    }  # fmt: skip
    assert all(row.worst == row.limit == 0.0 for row in exact) and len(exact) >= 12
    path = [row for row in comparison.rows if row.what is ComparisonKind.ONLINE_PATH and row.unit == "nm"]
    assert path and all(0.001 < row.worst < row.limit < 0.02 for row in path)
    wrong = spoilt(c, tmp_path / "wrong", "share += part;", "share += 0;")
    told = {row.what for row in compare(wrong, solution, reference=reference).rows if not row.passed}
    assert ComparisonKind.CHASED_INTEGERS in told and ComparisonKind.SHIPPED_TEST in told

    random, fuzzed = check_hostile(alone(c), scenario, model, runs=20_000)
    every = ControllerStatus.DISPLACEMENT | ControllerStatus.COMPOSITE | ControllerStatus.DRIVE
    every |= ControllerStatus.INPUT | ControllerStatus.LOST | ControllerStatus.UNSURE
    for check in (random, fuzzed):
        assert check.state is not CheckState.FAILED, check.findings
    if random.passed:
        assert f"statuses {int(every)}" in random.note
        high = spoilt(
            c,
            tmp_path / "high",
            "U_HIGH[6] = { ",
            "U_HIGH[6] = { 2000000000 + 0 * ",
        )
        (finding,) = {f.text for f in check_hostile(high, scenario, model, runs=20_000, quick=True)[0].refused}
        assert finding.startswith("every drive is within its limits")
    for check in (*check_rules(alone(c)), *check_on_boards(alone(c))):
        assert check.state is not CheckState.FAILED, check.findings
        assert any("q31" in name for name, _ in check.subjects)


@pytest.mark.long
def test_emulated_cores_count_integers_and_compare_every_bit(integers, monkeypatch):
    if not available() or not cross_compilers():
        pytest.skip("nothing emulates a core, or compiles for one")
    c, solution = integers
    monkeypatch.setattr(in_loop, "CORES", (M0_PLUS,))
    found = in_loop.run_in_loop(c, ReferenceAnswers(solution))
    assert found.passed
    for run_ in (r for r in found.runs if r.real is Q31):
        beside = next(r for r in found.runs if r.real is Real.FLOAT and r.compiler == run_.compiler)
        most, of_float = run_.instructions, beside.instructions
        assert (
            most["scenario"] == most["status_0"] < 0.5 * of_float["scenario"]
            and most["worst"] < 0.2 * of_float["worst"]
        )
        assert most["player"] is None and run_.numbers > 5000
    assert any(r.real is Q31 for r in found.runs)


@pytest.mark.long
def test_build_systems_have_integers_and_their_test(integers, tmp_path):
    """Zephyr and Arduino by stand-ins for what the module and the sketch call; PlatformIO by its manifest."""
    c, _ = integers
    test, calls = c.selftest[Q31], None
    if found := re.search(rf"{test.upper()}_VECTORS (\d+)", (c.path / f"{test}.h").read_text()):
        calls = int(found[1])
    assert calls
    manifest = json.loads((c.path / "library.json").read_text())
    assert f"{c.online[Q31]}.h" in manifest["headers"]
    assert f"{c.online[Q31]}.h" in (c.path / "library.properties").read_text()
    if cpp := shutil.which("g++"):
        sketch = c.path / "examples" / test / f"{test}.ino"
        (tmp_path / "Arduino.h").write_text(ARDUINO)
        text = f'#include "Arduino.h"\n{sketch.read_text()}\nint main() {{ setup(); loop(); return 0; }}\n'
        (tmp_path / "sketch.cpp").write_text(text)
        objects = []
        for source in c.sources(Q31):
            objects.append(tmp_path / f"{source.stem}.o")
            run("gcc", "-std=c99", *STRICT, "-c", source, "-o", objects[-1])
        words = (cpp, "-std=c++11", *STRICT, f"-I{tmp_path}", f"-I{c.path}", tmp_path / "sketch.cpp", *objects)
        run(*words, "-o", tmp_path / "sketch")
        assert run(tmp_path / "sketch") == f"{calls} of {calls} vectors agree\n"
    if cmake := shutil.which("cmake"):
        options = "".join(f"set(CONFIG_CIRCLE20_CONTROLLER{option} y)\n" for option in ("", "_INTEGERS", "_SELFTEST"))
        options += f"add_subdirectory({c.path}/zephyr circle20)\n"
        links = f"target_link_libraries(app PRIVATE circle20 {c.online[Q31]})\n"
        (tmp_path / "CMakeLists.txt").write_text(f"{ZEPHYR}{options}add_executable(app main.c)\n{links}")
        (tmp_path / "main.c").write_text(f"#include <{test}.h>\nint main(void) {{ return {test}(0); }}\n")
        run(cmake, "-S", tmp_path, "-B", tmp_path / "b")
        run(cmake, "--build", tmp_path / "b")
        run(tmp_path / "b" / "app")
        run(cmake, "-S", c.path, "-B", tmp_path / "own")
        run(cmake, "--build", tmp_path / "own")
        assert "100% tests passed, 0 tests failed out of 3" in run("ctest", "--test-dir", tmp_path / "own")

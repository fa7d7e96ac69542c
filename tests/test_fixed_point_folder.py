"""Where a folder has the controller in integers, and which devices are refused it."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest
from conftest import SCENARIOS, effect_device
from three_stacks import stage

from ctrlgen import InputError, build_model, load_device, load_scenario
from ctrlgen.controller.fixed_maps import NoFixedPoint
from ctrlgen.controller.fixed_point import fixed_point
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.folder import generate
from ctrlgen.firmware.package import verify_package

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
        assert files == ({"mems_hexapod_online_q31.c", "mems_hexapod_online_q31.h"} if asked else set())
        assert verify_package(c.path) == ()
        for text in ((c.path / file).read_text() for file in ("README.md", "CMakeLists.txt")):
            assert ("q31" in text) == asked
            assert ("checked_f32" in text or "_checked_${real}" in text) == asked
        if asked:
            assert re.search(rf"void {c.fixed_init}\(", (c.path / f"{c.fixed}.h").read_text())
    if shutil.which("cmake"):
        (tmp_path / "main.c").write_text(USES % {"name": "mems_hexapod"})
        (tmp_path / "CMakeLists.txt").write_text(
            f"cmake_minimum_required(VERSION 3.16)\nproject(firmware C)\n{added}add_executable(app main.c)\n"
            f"target_link_libraries(app PRIVATE ctrlgen::plain_f32 ctrlgen::with_both_f32 ctrlgen::{c.fixed})\n"
        )
        for words in (["-S", tmp_path, "-B", tmp_path / "b"], ["--build", tmp_path / "b", "--target", "app"]):
            done = subprocess.run(["cmake", *words], capture_output=True, text=True)
            assert done.returncode == 0, done.stderr
        subprocess.run([tmp_path / "b" / "app"], check=True)

"""Constant loads that a scenario states: of mechanisms, and on the platforms of the papers' stages."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from budget_cases import stated
from conftest import DEVICE, SCENARIOS
from held_blades import EI, L
from mechanism_files import PARALLELOGRAM, blade, dm, loaded, mems_hexapod_text
from rrr_direct import assemble

from ctrlgen import InputError, build_model, load_device, load_scenario, run, solve
from ctrlgen.budget.error_budget import budget_of
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.devices.load import Load
from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.loads import Loads
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.devices.rrr_stage import hinge_compliance
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.online.online import online_context
from ctrlgen.physics import hexapod, piezo_stack, xy_stage

K = 24 * EI / L**3  # of the parallelogram of two blades
FORCE = '[[load]]\nname = "pull"\non = "stage"\nat = ["0 mm", "0 mm", "0 mm"]\nforce = ["0.2 N", "0 N", "0 N"]\n'
LINE = (
    'title = "t"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "20 ms"\n{gravity}'
    '[path]\nkind = "line"\nstart = {{ delta_x = "-50 um" }}\nend = {{ delta_x = "100 um" }}\n'
)


def at(expression, d) -> np.ndarray:
    symbol = ca.SX.sym("d", len(d))
    return ca.Function("at", [symbol], [expression(symbol)])(d).full().ravel()


def pushed(device, **load: tuple[str, ...]):
    return device.loaded((Load(name="push", **load),), None)


def test_the_load_of_a_scenario_is_that_of_its_device_in_drives_budget_and_c(tmp_path):
    found, folders = [], [tmp_path / name for name in ("device", "scenario", "none")]
    for folder, (of_device, of_scenario) in zip(folders, ((FORCE, ""), ("", FORCE), ("", "")), strict=True):
        folder.mkdir()
        (folder / "device.toml").write_text(PARALLELOGRAM + of_device)
        (folder / "scenario.toml").write_text(LINE.format(gravity="") + of_scenario)
        scenario = load_scenario(folder)
        found.append(solve(scenario, build_model(scenario.device)))
    in_device, in_scenario, without = (
        found  # the coil pushes 10 mm beside the load, where the blades' stretching turns the stage
    )
    np.testing.assert_array_equal(in_scenario.drive, in_device.drive)
    assert (in_scenario.drive - without.drive)[[0, -1], 0] * 2 == pytest.approx([-0.2, -0.2], rel=2e-4)
    uncertain = stated(in_scenario, '[numbers]\n"load[0].force[0]" = { sd = "0.01 N", source = "s" }\n', tmp_path)
    assert budget_of(in_scenario, uncertain, draws=0).combined == pytest.approx(0.01 / K, rel=2e-4)
    contexts = [
        online_context(s.scenario, controller_of(s.model, "pose", 1e-3), Real.DOUBLE, "c")
        for s in (in_scenario, without)
    ]
    assert contexts[0]["loads"] == ("pull on stage: force 0.2 N, 0 N, 0 N; at 0 mm, 0 mm, 0 mm",)
    assert contexts[1]["loads"] == () and contexts[0]["ready"] != contexts[1]["ready"]
    # of the same name it takes the place of the device's, as of a device that has it already
    again = load_scenario(folders[1], folders[0] / "device.toml")
    assert again.device.load == in_device.scenario.device.load
    assert again.on(again.device).device.load == again.device.load


def test_a_scenarios_gravity_is_the_devices(tmp_path):
    heavy = 'name = "stage"\nmass = "80 g"\ninertia = ["9 kg*mm^2", "9 kg*mm^2", "9 kg*mm^2"]\n'
    (tmp_path / "device.toml").write_text(PARALLELOGRAM.replace('name = "stage"\n', heavy))
    (tmp_path / "scenario.toml").write_text(LINE.format(gravity='gravity = ["9.81 m/s^2", "0 m/s^2", "0 m/s^2"]\n'))
    device = load_scenario(tmp_path).device
    assert at(device.physics(device.values()).restoring_force, [0.0]) == pytest.approx([-0.08 * 9.81], rel=1e-9)
    assert device.load_texts == ("gravity 9.81 m/s^2, 0 m/s^2, 0 m/s^2",)


def test_a_moment_is_a_couple_of_two_forces_in_the_plane(tmp_path):
    """On one blade, which a moment turns while the axis is held: its force on the axis and its stiffness."""
    text = PARALLELOGRAM.replace(blade("right", 10), "").replace('at = ["0 mm", "-10 mm"', 'at = ["5 mm", "4 mm"')
    forces = "".join(
        f'[[load]]\nname = "f{side + 1}"\non = "stage"\nat = ["{side * 7} mm", "3 mm", "0 mm"]\nforce = ["0 N", "{side} N", "0 N"]\n'
        for side in (1, -1)
    )
    moment = '[[load]]\nname = "m"\non = "stage"\nmoment = ["0 N*m", "0 N*m", "0.014 N*m"]\n'
    # and with the image of each in the plane, which turns the same way
    mirrored = ('[[pattern]]\nname = "both"\nmirror = "z"\n', 'pattern = "both"\n')
    for before, after in (("", ""), mirrored):
        laws = []
        for load in (forces, moment):
            c = nominal(loaded(tmp_path, text + before + load.replace('on = "stage"\n', f'on = "stage"\n{after}')))
            loads = Loads(c, SecondOrder(c))
            laws.append([dm(loads.force)[0, 0], dm(loads.stiffness)[0, 0]])
        np.testing.assert_allclose(laws[1], laws[0], rtol=1e-9)
        assert all(np.abs(laws[1]) > 1e-3)


def test_a_load_on_the_3_rrr_stage_is_that_of_the_direct_stiffness_method():
    stage = load_device(SCENARIOS / "devices" / "rrr_case2.toml")
    device = pushed(
        stage, force=("2 N", "-1 N", "0 N"), moment=("0 N*m", "0 N*m", "0.01 N*m"), at=("4 mm", "3 mm", "0 mm")
    )
    p = device.values()
    W = np.array([2, -1, 0.01 + 4e-3 * -1 - 3e-3 * 2])
    g = SimpleNamespace(**vars(p.lengths))
    for name in ("R1", "R2", "R3"):
        setattr(g, name, getattr(p, f"hinge{name[1]}").R)
    g.frame_angle = p.frame_angle
    C = assemble([dm(hinge_compliance(device, name, p)) for name in device.hinges], g)
    d = np.array([5e-6, 1e-6, 9e-6])
    F = np.linalg.solve(C[3:, 3:], d - C[3:, :3] @ W)
    physics = device.physics(p)
    stacks = piezo_stack.stiffness(p.piezo) * d
    np.testing.assert_allclose(at(physics.restoring_force, d) - stacks, F, rtol=1e-7)
    pose = C[:3, :3] @ W + C[:3, 3:] @ F
    np.testing.assert_allclose(at(physics.pose, d), pose, rtol=1e-7, atol=1e-6 * np.abs(pose).min())
    # with the voltages at zero, the stacks hold it
    rest = np.linalg.solve(
        np.linalg.inv(C[3:, 3:]) + piezo_stack.stiffness(p.piezo) * np.eye(3), np.linalg.solve(C[3:, 3:], C[3:, :3] @ W)
    )
    np.testing.assert_allclose(at(physics.restoring_force, rest), 0, atol=1e-9)
    stroke = next(limit for limit in build_model(device).limits if limit.name == "stroke")
    before = next(limit for limit in build_model(stage).limits if limit.name == "stroke")
    assert rest.min() < 0 and stroke.lower - before.lower == pytest.approx(rest.min(), rel=1e-7)


def test_a_load_on_the_mems_hexapod_is_that_of_its_mechanism(tmp_path):
    """Pose and stress of the wires under force and moment with the stages held and moved; the actuators feel its virtual work."""
    special = load_device(DEVICE)
    device = pushed(special, force=("0.02 N", "-0.01 N", "-0.05 N"), moment=("1e-5 N*m", "2e-5 N*m", "-3e-5 N*m"))
    load = '[[load]]\nname = "w"\nforce = ["0.02 N", "-0.01 N", "-0.05 N"]\nmoment = ["1e-5 N*m", "2e-5 N*m", "-3e-5 N*m"]\n'
    text = mems_hexapod_text(special).replace('name = "tungsten"\n', 'name = "tungsten"\nstress_limit = "1 GPa"\n')
    c = nominal(loaded(tmp_path, text + load))
    loads, p = Loads(c, SecondOrder(c)), device.values()
    physics = device.physics(p)
    d = 1e-6 * np.array([3.0, 20, 8, 1, 15, 9])
    np.testing.assert_allclose(at(physics.pose, 0 * d), dm(loads.pose).ravel(), rtol=1e-6)
    moved = dm(c.jacobian)[:, :6] @ d + dm(loads.pose).ravel()
    np.testing.assert_allclose(at(physics.pose, d), moved, rtol=1e-6, atol=1e-9 * np.abs(moved).max())
    names, stress = c.stress("tungsten", ca.DM(d), 1e-9 * p.hexapod.stress_limit, constant=loads.wrench)
    mine = build_model(device)
    expression = next(limit.expr for limit in mine.limits if limit.name == "wire_stress")
    ours = ca.Function("stress", [mine.z], [expression])(d).full().reshape(6, 2)  # foot and top of every strut
    found = dict(zip(names, ca.DM(ca.evalf(stress)).full().ravel(), strict=True))
    theirs = [[found[f"strut{i + 1}_{end}"] for end in ("fixed_end", "free_end")] for i in range(6)]
    np.testing.assert_allclose(ours, theirs, rtol=1e-6)
    W = np.array([1e-5, 2e-5, -3e-5, 0.02, -0.01, -0.05])
    J = dm(hexapod.jacobian(p.hexapod, xy_stage.stage_compliance(p.stage, p.actuator)))
    bare = at(special.physics(special.values()).restoring_force, d)
    np.testing.assert_allclose(bare - at(physics.restoring_force, d), J.T @ W, rtol=1e-9)
    # with the stages held the struts pull at them by the same force, to which a plate yields less than at home
    more = at(physics.tangent_compliance, d) - at(special.physics(special.values()).tangent_compliance, d)
    np.testing.assert_allclose(
        more, -at(lambda d: xy_stage.stiffened(d, p.stage, p.actuator), d) * (J.T @ W), rtol=1e-6
    )


def test_cold_stages_that_a_load_pushes_back_are_within_the_stroke():
    """Where no actuator pushes: beyond it by a hundredth at most, of a load so small that the stages are linear."""
    device = pushed(load_device(DEVICE), force=("0.2 mN", "-0.1 mN", "-0.5 mN"))
    force = device.physics(device.values()).restoring_force
    z = ca.SX.sym("z", 6)
    cold = np.array(ca.rootfinder("cold", "newton", {"x": z, "g": force(z)})(x0=np.zeros(6))["x"])
    stroke = next(limit for limit in build_model(device).limits if limit.name == "stroke")
    assert cold.min() < 0 and 1.001 < stroke.lower / cold.min() < 1.011


def test_loads_that_a_device_cannot_have_are_refused(tmp_path):
    (tmp_path / "device.toml").write_text(PARALLELOGRAM)
    down = ("0 N", "0 N", "-1 N")
    scenario = LINE.format(gravity="") + FORCE.replace('on = "stage"', 'on = "stge"')
    (tmp_path / "scenario.toml").write_text(scenario)
    with pytest.raises(InputError, match="'stge' is no body"):
        load_scenario(tmp_path)
    rrr, mems = (load_device(SCENARIOS / "devices" / f"{n}.toml") for n in ("rrr_case2", "mems_hexapod"))
    meso = load_device(SCENARIOS / "devices" / "meso_hexapod.toml")
    for device, load, said in (
        (rrr, {"force": down}, "planar"),
        (rrr, {"mass": "1 g"}, "state the weight as a force"),
        (mems, {"force": down, "on": "stage1"}, "alone is loaded"),
        (meso, {"force": down}, "has no bodies that could be loaded"),
    ):
        with pytest.raises(ValueError, match=said):
            pushed(device, **load)
    with pytest.raises(ValueError, match="weights of this kind"):
        mems.loaded((), ())


@pytest.mark.long
@pytest.mark.parametrize(
    "name, force", [("rrr_circle", '["2 N", "-3 N", "0 N"]'), ("circle20", '["0 N", "0 N", "-0.001 N"]')]
)
def test_a_loaded_platform_is_solved_and_its_c_is_the_model(tmp_path, name, force):
    scenario = load_scenario(SCENARIOS / name)
    text = scenario.path.read_text().partition("[[expect]]")[0]
    device = (SCENARIOS / name / scenario.file.device).resolve()
    loaded_text = (
        text.replace(f'"{scenario.file.device}"', f'"{device}"') + f'\n[[load]]\nname = "w"\nforce = {force}\n'
    )
    (tmp_path / "scenario.toml").write_text(loaded_text)
    outcome = run(tmp_path, tmp_path / "out")
    assert outcome.passed
    header = next((tmp_path / "out").rglob("*online*.h")).read_text()
    assert "Constant load: w on platform: force" in header
    bare = solve(scenario, build_model(scenario.device))
    assert np.abs(outcome.solution.drive - bare.drive).max() > 1e-3 * np.abs(bare.drive).max()

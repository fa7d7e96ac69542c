"""What a stage with inertia cannot follow, its controller online and in C, and delays of its reading."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from command_line import ctrlgen as run
from conftest import AXIS_FILE
from inertial_stages import (
    CUBIC,
    DAMPING,
    EFFECTS,
    FORCE,
    LAG,
    LINE,
    MASS,
    PATHS,
    STIFFNESS,
    coil,
    scenario,
    solved,
    stage,
    with_effect,
)

import ctrlgen
from ctrlgen import InputError, Unreachable, build_model, load_scenario, solve
from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.trajectory.scenario import model_of

# Limits


def test_a_path_that_is_too_fast_names_drive_amount_and_what_can_be_followed(tmp_path):
    fast = scenario(tmp_path, coil("1.5 V"), LINE, duration="4 ms")
    with pytest.raises(
        Unreachable, match=r"drive of coil would have to be .* above 1.5 V \(the path is too fast\)"
    ) as caught:
        solve(fast, build_model(fast.device))
    assert "times slower" in str(caught.value) and "scaled to" in str(caught.value)
    slower = next(text for text in caught.value.infeasibility.alternatives if "slower" in text)
    duration = slower.split('"')[1]
    solution = solved(tmp_path, coil("1.5 V"), LINE, duration=duration)
    assert np.abs(solution.drive).max() <= 1.5


def test_a_path_beyond_the_stroke_names_it_and_the_nearest_pose(tmp_path):
    with pytest.raises(Unreachable, match="actuator axis: needs 120 um, 20 um above 100 um") as caught:
        solved(tmp_path, coil("40 V", state={"current": "40 V"}), 'kind = "line"\nend = { axis = "120 um" }')
    assert caught.value.infeasibility.nearest == pytest.approx([100e-6], rel=1e-6)


def test_a_scenario_without_time_is_refused(tmp_path):
    file = tmp_path / "scenario.toml"
    file.write_text('title = "t"\ndevice = "coil"\npoints = 10\n[path]\n' + LINE)
    it = load_scenario(tmp_path, coil())
    with pytest.raises(InputError, match="sample_rate: is missing: coil has inertia"):
        solve(it, build_model(it.device))


@pytest.mark.long
def test_check_says_whether_the_path_can_be_followed(tmp_path):
    scenario(tmp_path, str(AXIS_FILE), LINE)
    done = run("check", tmp_path)
    assert done.returncode == 0 and "can be followed within every limit" in done.stdout
    scenario(tmp_path, str(AXIS_FILE), LINE, duration="2 ms")
    done = run("check", tmp_path)
    assert done.returncode != 0 and "times slower" in done.stdout + done.stderr
    scenario(tmp_path, with_effect(tmp_path, "backlash", 'gap = "1 um"'), LINE)
    assert "no drive was found" in run("check", tmp_path).stdout


# Path of the two axes, what is said
TOO_FAST = {
    "circle": (PATHS["circle"].replace("turns = 4", "turns = 80"), "the path is too fast"),
    "circle from rest": (PATHS["circle from rest"] + "\nturns = 50", "the path is too fast"),
    "circle too large": (PATHS["circle"].replace("60 um", "5 mm"), "its stroke ends there"),
    "circle off the range": (PATHS["circle"] + '\ncentre = { x = "90 um" }', "its stroke ends there"),
    "raster": (PATHS["raster"].replace("lines = 3", "lines = 60"), "the path is too fast"),
    "spiral": (PATHS["spiral"].replace("turns = 3", "turns = 60"), "the path is too fast"),
    "spiral too large": (PATHS["spiral"].replace("40 um", "600 um"), "its stroke ends there"),
    "lissajous": (PATHS["lissajous"].replace("[3, 2]", "[90, 70]"), "the path is too fast"),
}


@pytest.mark.long
@pytest.mark.parametrize("name", TOO_FAST)
def test_every_path_that_cannot_be_followed_is_explained_with_one_that_can(tmp_path, name):
    path, says = TOO_FAST[name]
    with pytest.raises(Unreachable, match="the path can be followed") as caught:
        solved(tmp_path, stage(), path, duration="0.2 s")
    assert says in str(caught.value) and caught.value.infeasibility.alternatives


# C


def test_the_online_drive_is_that_of_the_equations_and_limits_are_kept():
    device = coil(state={"current": ("-1.5 V", "1.5 V")})
    controller = controller_of(build_model(device), "pose", 1e-3)
    # Derivatives instead of the sample before
    assert controller.kernels.moving is None and controller.kernels.named.moving is None
    rest = controller.rest()
    d, v, a, jerk = 20e-6, 1e-3, 0.5, 30.0
    force = MASS * a + DAMPING * v + STIFFNESS * d + CUBIC * d**3
    slope = MASS * jerk + DAMPING * a + STIFFNESS * v + 3 * CUBIC * d**2 * v
    plain = controller.step(rest, np.array([d, v, a, jerk]))
    assert plain.status == 0 and plain.drive == pytest.approx([(force + LAG * slope) / FORCE], rel=1e-12)
    quick = controller.step(rest, np.array([0, 0, 0, 1e6]))  # 0.5 kg 1e6 m/s^3 1 ms / 10 N/V = 50 V
    assert quick.status == ControllerStatus.DRIVE and quick.drive == pytest.approx([4.0])
    heavy = controller.step(rest, np.array([d, 0, 40.0, 0]))  # 20 N would take 2.4 V of the current's 1.5 V
    still = controller.step(rest, np.array([d, 0, 0, 0]), settle=True)
    assert heavy.status == ControllerStatus.STATE and heavy.drive == pytest.approx(still.drive)
    far = controller.step(rest, np.array([150e-6, 1e-3, 0, 0]))
    assert ControllerStatus.DISPLACEMENT in far.status and np.abs(far.drive) <= 4.0
    assert controller.step(rest, np.array([d, np.nan, 0, 0])).status == ControllerStatus.INPUT


@pytest.mark.long
def test_the_c_computes_what_the_model_does(tmp_path, compiler):
    device = coil(state={"current": ("-1.5 V", "1.5 V")}, limits={"flexure_force": (lambda d, p: p.k * d.axis, "15 N")})
    outcome = ctrlgen.run(scenario(tmp_path, device, LINE), tmp_path / "out")
    assert outcome.comparison.rows and not [row for row in outcome.comparison.rows if not row.passed]


def test_a_device_with_memories_gets_no_c_and_the_law_is_named(tmp_path):
    it = scenario(tmp_path, with_effect(tmp_path, "creep", EFFECTS["creep"]), LINE)
    with pytest.raises(InputError, match=r"creep.*cannot compute its drive online"):
        ctrlgen.generate(it, build_model(it.device), tmp_path / "c")


@pytest.mark.long
def test_a_pendulum_is_led_to_45_degrees_and_its_c_agrees(tmp_path, compiler):
    pendulum = ctrlgen.user_device(
        "pendulum",
        parameters={"inertia": "2 kg*cm^2", "weight": "20 mN*m", "damping": "4e-4 N*m*s", "motor": "15 mN*m/V"},
        drive={"motor": "2 V"},
        axes={"swing": "60 deg"},
        mass=lambda p: p.inertia,
        force=lambda u, p: p.motor * u.motor,
        restoring_force=lambda d, p: p.weight * ca.sin(d.swing),
        damping_force=lambda v, p: p.damping * v.swing,
    )
    path = 'kind = "line"\nend = { swing = "45 deg" }'
    outcome = ctrlgen.run(scenario(tmp_path, pendulum, path, rate="1 kHz", duration="0.5 s"), tmp_path / "out")
    assert outcome.passed
    assert outcome.solution.drive[-1] == pytest.approx([20e-3 * np.sin(np.pi / 4) / 15e-3], rel=1e-9)


@pytest.mark.parametrize(
    ("device", "path", "least"),
    [
        (stage(), 'kind = "line"\nend = { x = "1 nm" }\n', 3),  # a force on the mass: at rest, pushed, at rest
        (coil(), 'kind = "line"\nend = { axis = "1 nm" }\n', 4),  # its current has to be led back too
        (stage(), 'kind = "circle"\ndiameter = "1 nm"\nplane = ["x", "y"]\n', 3),
    ],
)
def test_a_motion_of_too_few_samples_is_a_fault_that_says_how_many_it_takes(tmp_path, device, path, least):
    with pytest.raises(
        InputError, match=rf"has 2 samples; {device.name}, which has inertia, takes {least} or more: raise"
    ):
        solved(tmp_path, device, path, duration="0.4 ms")
    if device.name == "stage":
        assert len(solved(tmp_path, device, path, duration="0.6 ms").drive) == 3


def test_a_delay_of_the_reading_changes_no_drive_and_a_warning_says_so(tmp_path):
    plain = solved(tmp_path, str(AXIS_FILE), LINE)
    late = scenario(tmp_path, with_effect(tmp_path, "delay", 'delay = "0.5 ms"'), LINE)
    with pytest.warns(UserWarning, match="flexure_axis: delay is of the reading and changes no drive"):
        model = model_of(late)
    assert np.array_equal(solve(late, model).drive, plain.drive)


def test_a_delay_in_the_reading_of_a_loop_is_refused(tmp_path):
    """It is left out where the loop reads the displacement by an encoder of its own."""
    loop = '[loop]\nposition_gain = "50 1/s"\nvelocity_gain = "100 V/(m/s)"\nintegral_gain = "0 V/(m*s)"\nmeasures = "{}"\n'
    delay = '[[effect]]\nkind = "delay"\nat = "axis"\ndelay = "0.5 ms"\n'
    for measured in ("reading", "displacement"):
        text = AXIS_FILE.read_text() + loop.format(measured) + delay
        (tmp_path / "loop.toml").write_text(text)
        late = scenario(tmp_path, "loop.toml", LINE)
        if measured == "reading":
            with pytest.raises(InputError, match=r"has delay in the reading of its feedback loop.*leave it out"):
                model_of(late)
        else:
            with pytest.warns(UserWarning, match="changes no drive"):
                model_of(late)

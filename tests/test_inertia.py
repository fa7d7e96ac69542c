"""Trajectories of devices with inertia: inverse dynamics, smooth paths, drives that are held from sample to sample.

The references are written by hand for a mass on a spring with a cubic part, a damper and a drive that lags behind,
m a + c v + k d + k3 d^3 = f i,  tau i' = u - i.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from command_line import ctrlgen as run
from conftest import AXIS_FILE, SCENARIOS
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp

import ctrlgen
from ctrlgen import InputError, Unreachable, build_model, load_scenario, solve
from ctrlgen.controller.feedforward import ControllerStatus
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.core.errors import SolverError
from ctrlgen.devices import load_device
from ctrlgen.model.inverse_dynamics import inverse_dynamics, relative_degrees
from ctrlgen.model.simulation import simulate
from ctrlgen.trajectory.scenario import model_of

MASS, DAMPING, STIFFNESS, CUBIC, FORCE, LAG = 0.5, 30.0, 2e5, 1e13, 10.0, 1e-3
TRAVEL = 100e-6
GOAL = 1e-9  # of the travel, by which a solved drive may miss the path at the samples: 0.1 pm, far below any sensor
LINE = 'kind = "line"\nstart = { axis = "-20 um" }\nend = { axis = "30 um" }\n'
SNAP = Polynomial([0, 0, 0, 0, 35, -84, 70, -20])  # from 0 to 1 with velocity, acceleration and jerk zero at both ends


def coil(limit: str = "4 V", **other):
    """The mass on its spring, the current in a coil lagging behind the voltage."""
    laws = dict(
        parameters={
            "m": "0.5 kg", "c": "30 N*s/m", "k": "0.2 N/um", "k3": "1e13 N/m^3", "f": "10 N/V", "tau": "1 ms",
        },
        axes={"axis": "100 um"}, drive={"coil": limit}, state={"current": "4 V"},
        rates=lambda u, x, p: (u.coil - x.current) / p.tau,
        force=lambda x, p: p.f * x.current,
        restoring_force=lambda d, p: p.k * d.axis + p.k3 * d.axis**3,
        damping_force=lambda v, p: p.c * v.axis,
        mass=lambda p: p.m,
    )  # fmt: skip
    return ctrlgen.user_device("coil", **(laws | other))


def stage(limit: str = "4 A"):
    """Two such axes without lag, coupled by a hundredth of their stiffness."""
    return ctrlgen.user_device(
        "stage",
        parameters={"m": "0.5 kg", "c": "30 N*s/m", "k": "0.2 N/um", "e": "2 N/mm", "f": "10 N/A"},
        axes={"x": "100 um", "y": "100 um"}, drive={"a": limit, "b": limit},
        force=lambda u, p: [p.f * u.a, p.f * u.b],
        restoring_force=lambda d, p: [p.k * d.x + p.e * d.y, p.k * d.y + p.e * d.x],
        damping_force=lambda v, p: [p.c * v.x, p.c * v.y],
        mass=lambda p: [p.m, p.m],
    )  # fmt: skip


def scenario(folder, device, path: str, rate: str = "5 kHz", duration: str | None = "0.1 s"):
    """A scenario for a device, or for a device file with this name."""
    file = folder / "scenario.toml"
    name = device if isinstance(device, str) else device.name
    timing = "" if duration is None else f'duration = "{duration}"\n'
    file.write_text(f'title = "t"\ndevice = "{name}"\nsample_rate = "{rate}"\n{timing}[path]\n{path}\n')
    return load_scenario(folder, None if isinstance(device, str) else device)


def solved(folder, device, path: str, **timing):
    it = scenario(folder, device, path, **timing)
    return solve(it, build_model(it.device))


def with_effect(folder, kind: str, numbers: str) -> str:
    """The shipped axis with a law, as a device file."""
    text = AXIS_FILE.read_text() + f'\n[[effect]]\nkind = "{kind}"\nat = "axis"\n{numbers}\n'
    (folder / "device.toml").write_text(text)
    return "device.toml"


def moved(solution, hold: int = 0):
    """(n + 1 + hold,) places of the coil's mass by scipy, each drive held, the last for `hold` samples more; nothing of ctrlgen."""
    h = solution.scenario.sample_time
    current, velocity, place = solution.trace.x[0, 0], solution.trace.x[0, 1], solution.trace.z[0, 0]
    state, found = np.array([current, velocity, place]), [place]
    for u in [*solution.drive[:, 0], *[solution.drive[-1, 0]] * hold]:

        def rates(_, y, u=u):
            i, v, d = y
            return [(u - i) / LAG, (FORCE * i - DAMPING * v - STIFFNESS * d - CUBIC * d**3) / MASS, v]

        state = solve_ivp(rates, (0, h), state, method="DOP853", rtol=1e-13, atol=[1e-15, 1e-16, 1e-19]).y[:, -1]
        found.append(state[2])
    return np.array(found)


# Inverse dynamics


def test_the_drive_through_a_lag_is_what_the_equations_say():
    d, v, a, jerk = 20e-6, 1e-3, 0.5, 30.0
    force = MASS * a + DAMPING * v + STIFFNESS * d + CUBIC * d**3
    slope = MASS * jerk + DAMPING * a + STIFFNESS * v + 3 * CUBIC * d**2 * v
    x, z, u = inverse_dynamics(build_model(coil()), "pose").kernel(np.array([[d, v, a, jerk]]))
    assert float(z) == pytest.approx(d, rel=1e-14)
    assert x.full().ravel() == pytest.approx([force / FORCE, v], rel=1e-14)
    assert float(u) == pytest.approx((force + LAG * slope) / FORCE, rel=1e-13)


def test_the_relative_degree_is_that_of_the_equations():
    assert relative_degrees(build_model(coil()), "pose") == (3,)
    assert relative_degrees(build_model(stage()), "displacement") == (2, 2)
    prompt = coil(force=lambda u, x, p: p.f * x.current + 0.1 * p.f * u.coil)  # a part of the force does not lag
    assert relative_degrees(build_model(prompt), "pose") == (2,)


def test_axes_that_share_masses_are_led_by_the_drive_of_their_inverse():
    """NIST's hexapod on a circle 25 times a second: its states change as the equations of motion say under the drive."""
    model = build_model(load_device(SCENARIOS / "devices" / "dynamic_hexapod.toml"))
    inverse = inverse_dynamics(model, "pose")
    assert inverse.degrees == (3,) * 6 and inverse.internal == ()
    assert inverse.kernel.n_instructions() < 1500  # a Newton step of all temperatures at once takes 8,000
    rate, radius, height, step = 2 * np.pi * 25, 10e-6, 20e-6, 1e-5

    def wanted(t):
        turned = [radius * rate**k * np.exp(1j * (rate * t + k * np.pi / 2)) for k in range(4)]
        target = np.zeros((6, 4))
        target[3], target[4], target[5, 0] = np.real(turned), np.imag(turned), height
        return [part.full().ravel() for part in inverse.kernel(target)]

    for t in (0.0, 7e-3, 23e-3):
        x, z, u = wanted(t)
        pose = ca.Function("pose", [model.z], [model.signals["pose"].expr])(z).full().ravel()
        there = [0, 0, 0, radius * np.cos(rate * t), radius * np.sin(rate * t), height]
        assert pose == pytest.approx(there, abs=1e-15)
        rates = model.dynamics(x, z, u, [])[0].full().ravel()
        near = [wanted(t + k * step) for k in (-2, -1, 1, 2)]  # central differences of the fourth order
        x_rate, z_rate = (np.dot([1, -8, 8, -1], [w[i] for w in near]) / (12 * step) for i in (0, 1))
        assert rates == pytest.approx(x_rate, rel=1e-8, abs=1e-9 * np.abs(x_rate[-6:]).max())
        assert x[-6:] == pytest.approx(z_rate, abs=1e-9 * radius * rate)


def test_a_signal_that_the_drive_does_not_move_is_named():
    idle = coil(force=lambda p, d: 0 * d.axis)
    with pytest.raises(InputError, match="does not move axis of the pose"):
        inverse_dynamics(build_model(idle), "pose")


# Paths


def test_derivatives_of_a_line_are_those_of_its_polynomial(tmp_path):
    model, n, length = build_model(coil()), 50, 50e-6
    it = scenario(tmp_path, coil(), LINE + "smooth = 3", duration="10 ms")
    motion, duration = it.motion(model), (n - 1) / 5000
    s = np.linspace(0, 1, n)
    assert motion.position[:, 0] == pytest.approx(-20e-6 + length * SNAP(s), abs=1e-12 * length)
    for k in (1, 2, 3):
        expected = length * SNAP.deriv(k)(s) / duration**k
        assert motion.derivatives[k - 1, :, 0] == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())


def test_derivatives_of_a_circle_turn_by_a_right_angle_each(tmp_path):
    it = scenario(tmp_path, stage(), 'kind = "circle"\ndiameter = "40 um"\nplane = ["x", "y"]\nturns = 3')
    motion, speed = it.motion(build_model(stage())), 2 * np.pi * 3 / 0.1
    angle = speed * np.arange(500) / 5000
    for k, table in enumerate([motion.position, *motion.derivatives]):
        turned = angle + k * np.pi / 2
        expected = 20e-6 * speed**k * np.column_stack([np.cos(turned), np.sin(turned)])
        assert table == pytest.approx(expected, abs=1e-11 * 20e-6 * speed**k)


def test_a_line_is_by_default_one_derivative_smoother_than_the_drive_follows(tmp_path):
    still = scenario(tmp_path, coil(), LINE).motion(build_model(coil())).derivatives
    assert np.all(np.abs(still[:, [0, -1]]) < 1e-12 * np.abs(still).max(axis=1, keepdims=True))
    s = np.linspace(0, 1, 500)
    command = scenario(tmp_path, stage(), 'kind = "line"\nend = { x = "1 um" }').command(build_model(stage()))
    assert command[:, 0] == pytest.approx(1e-6 * SNAP(s), abs=1e-18)


@pytest.mark.parametrize(
    ("path", "says"),
    [
        (LINE + "smooth = 2", "path.smooth: makes derivative 3 jump.*write smooth = 3"),
        (LINE + "even = true", "path.even: makes derivative 1 jump.*leave it out"),
    ],
)
def test_a_path_that_is_not_smooth_enough_is_refused_with_the_remedy(tmp_path, path, says):
    with pytest.raises(InputError, match=says):
        solved(tmp_path, coil(), path)


def listed(folder, places: np.ndarray) -> str:
    rows = "\n".join(f"{1e6 * d:.15g}" for d in places)
    (folder / "samples.csv").write_text(f"axis [um]\n{rows}\n")
    return 'kind = "poses"\nfile = "samples.csv"'


def test_listed_samples_are_followed_like_the_line_that_they_are_of(tmp_path):
    line = solved(tmp_path, coil(), LINE)
    samples = solved(tmp_path, coil(), listed(tmp_path, line.command[:, 0]), duration=None)
    assert samples.drive == pytest.approx(line.drive, abs=1e-6)  # V, of 1 V: what the spline between samples leaves


def test_listed_samples_that_jump_in_velocity_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"derivative.*changes by more than half.*begin and end at rest"):
        solved(tmp_path, coil(), listed(tmp_path, np.linspace(0, 50e-6, 200)), duration=None)


# Tracking


def test_a_line_through_a_lag_is_tracked_to_a_billionth_of_the_travel(tmp_path):
    solution = solved(tmp_path, coil(), LINE, duration="60 ms")
    path = np.append(solution.command[:, 0], solution.command[-1, 0])
    assert np.abs(moved(solution) - path).max() < GOAL * TRAVEL


def test_the_drive_neither_alternates_nor_grows(tmp_path):
    drive = solved(tmp_path, coil(), LINE).drive[:, 0]
    curvature = np.abs(np.diff(drive, 2)).max()
    assert curvature < 1e-3 * np.ptp(drive)  # (2 pi / 500 samples)^2 of a half wave is 4e-5; alternating would be 4


def test_after_a_line_the_mass_stays_where_it_is(tmp_path):
    solution = solved(tmp_path, coil(), LINE, duration="40 ms")
    assert np.abs(moved(solution, hold=100)[-100:] - 30e-6).max() < GOAL * TRAVEL


PATHS = {
    "circle": 'kind = "circle"\ndiameter = "60 um"\nturns = 4\nplane = ["x", "y"]',
    "circle from rest": 'kind = "circle"\ndiameter = "60 um"\nplane = ["x", "y"]\nfrom_rest = true',
    "lissajous": 'kind = "lissajous"\namplitudes = ["30 um", "20 um"]\nperiods = [3, 2]\nplane = ["x", "y"]',
    "raster": 'kind = "raster"\nlength = "40 um"\nspacing = "2 um"\nlines = 3\nplane = ["x", "y"]',
    "spiral": 'kind = "spiral"\ndiameter = "40 um"\nturns = 3\nplane = ["x", "y"]',
}


@pytest.mark.parametrize("name", PATHS)
def test_every_path_is_tracked_to_a_billionth_of_the_travel(tmp_path, name):
    solution = solved(tmp_path, stage(), PATHS[name], duration="0.2 s")
    laps = 2 if solution.scenario.closed else 1
    start = solution.trace.x[0], solution.trace.z[0]
    drives = np.tile(solution.drive, (laps, 1))
    reached = simulate(solution.model, drives, solution.scenario.sample_time, *start).signals["pose"]
    assert np.abs(reached[:-1] - np.tile(solution.command, (laps, 1))).max() < GOAL * TRAVEL


def test_a_circle_starts_in_its_steady_motion(tmp_path):
    solution = solved(tmp_path, stage(), PATHS["circle"])
    w, h = 2 * np.pi * 4 / 0.1, 1 / 5000
    # within a sample a held drive misses the one of the circle by u' (h/2 - t), which moves the mass by
    # u'/m (-h^2 t/12 + h t^2/4 - t^3/6): zero at both ends, with the slope -u' h^2/(12 m) there; u' = (k - m w^2) v
    expected = 30e-6 * w * (1 - (STIFFNESS / MASS - w**2) * h**2 / 12)
    assert solution.trace.x[0] == pytest.approx([0, expected], abs=2e-4 * expected)


def test_between_the_samples_a_held_drive_misses_the_path_by_what_is_reported(tmp_path):
    solution = solved(tmp_path, stage(), PATHS["circle"])
    w, h = 2 * np.pi * 4 / 0.1, 1 / 5000
    slope = (STIFFNESS / MASS - w**2) * w * 30e-6
    # The cubic above, its maximum
    assert solution.between_samples == pytest.approx(slope * h**3 / (72 * np.sqrt(3)), rel=0.05)


# Laws with no inverse in closed form, with memories, with dry friction
EFFECTS = {
    "stiffening": 'k3 = "2e13 N/m^3"',
    "quadratic_damping": 'damping = "300 N*s^2/m^2"',
    "saturation": 'share = "1"\nlevel = "1.5 V"',
    "resonance": 'stiffness = "0.05 N/um"\nfrequency = "300 Hz"\ndamping = "0.01"',
    "creep": 'gain = "3 %"\ntau = "0.5 s"\nslow = "30 %"',
    "thermal_lag": 'share = "0.2"\ntau = "0.01 s"\nsecond = "0.3"',
    "hysteresis": 'stiffness = "0.02 N/um"\nreach = "10 um"\ntaper = "0.5"',
    "drive_hysteresis": 'share = "0.1"\nreach = "1 V"\ntaper = "0.5"',
    "coulomb": 'force = "1 N"\nreach = "0.1 um"\nsmoothing = "1 um/s"',
}


@pytest.mark.long
@pytest.mark.parametrize("kind", EFFECTS)
def test_laws_of_the_device_file_are_in_the_drive(tmp_path, kind):
    name = with_effect(tmp_path, kind, EFFECTS[kind])
    solution = solved(tmp_path, name, LINE)
    start = solution.trace.x[0], solution.trace.z[0]
    reached = simulate(solution.model, solution.drive, solution.scenario.sample_time, *start).signals["pose"]
    assert np.abs(reached[:-1] - solution.command).max() < GOAL * TRAVEL


def two_masses(pose):
    """A driven mass of 0.5 kg that carries one of 0.1 kg on a spring, a mode at 350 Hz; what is followed is `pose`."""
    return ctrlgen.user_device(
        "two_masses",
        parameters={
            "m": "0.5 kg", "n": "0.1 kg", "c": "30 N*s/m", "e": "2 N*s/m", "k": "0.2 N/um", "q": "0.4 N/um", "f": "10 N/V",
        },
        axes={"base": "200 um", "tip": "200 um"}, drive={"coil": "4 V"}, reading={"axis": "100 um"}, pose=pose,
        force=lambda u, p: [p.f * u.coil, 0],
        restoring_force=lambda d, p: [p.k * d.base + p.q * (d.base - d.tip), p.q * (d.tip - d.base)],
        damping_force=lambda v, p: [p.c * v.base + p.e * (v.base - v.tip), p.e * (v.tip - v.base)],
        mass=lambda p: [p.m, p.n],
    )  # fmt: skip


# Pose, relative degree, share of the travel that may be missed
MODES = {
    # zero at -q/e: inside the unit circle once sampled, forgotten at once
    "tip": (lambda d, p: d.tip, 3, GOAL),
    # zeros of the tip held by its spring: its vibration outlasts the path, and is weighed against the path's last samples
    "base": (lambda d, p: d.base, 2, 1e-6),
    # zeros -n s^2 + e s + q = 0, one of them at +2000/s: what the drive would have to do before the start is missing
    "non-minimum phase": (lambda d, p: 2 * d.tip - d.base, 2, 1e-5),
}


@pytest.mark.parametrize("name", MODES)
def test_a_stage_with_a_flexible_mode_follows_and_comes_to_rest(tmp_path, name):
    pose, degree, missed = MODES[name]
    device = two_masses(pose)
    assert relative_degrees(build_model(device), "pose") == (degree,)
    solution = solved(tmp_path, device, LINE, rate="10 kHz", duration="50 ms")
    drives = np.vstack([solution.drive, np.tile(solution.drive[-1:], (500, 1))])
    start = solution.trace.x[0], solution.trace.z[0]
    reached = simulate(solution.model, drives, solution.scenario.sample_time, *start).signals["pose"][:, 0]
    path = np.append(solution.command[:, 0], np.full(501, solution.command[-1, 0]))
    assert np.abs(reached - path).max() < missed * TRAVEL


@pytest.mark.long
def test_dry_friction_is_overcome_by_the_drive(tmp_path):
    plain = solved(tmp_path, str(AXIS_FILE), LINE)
    rubbing = solved(tmp_path, with_effect(tmp_path, "coulomb", EFFECTS["coulomb"]), LINE)
    middle = slice(200, 300)  # where the stage slides: 1 N against 10 N/V
    assert (rubbing.drive - plain.drive)[middle] == pytest.approx(np.full((100, 1), 0.1), abs=1e-3)


def test_a_law_without_an_inverse_is_named(tmp_path):
    with pytest.raises(SolverError, match=r"no drive held .*the device has backlash"):
        solved(tmp_path, with_effect(tmp_path, "backlash", 'gap = "1 um"'), LINE)
    device = ctrlgen.load_device(tmp_path / "device.toml")
    with pytest.raises(InputError, match=r"effect: .*backlash.* there is no inverse"):
        inverse_dynamics(build_model(device, sample_time=2e-4), "pose")


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
    assert (
        controller.kernels.moving is None and controller.kernels.named.moving is None
    )  # derivatives instead of the sample before
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
        drive={"motor": "2 V"}, axes={"swing": "60 deg"}, mass=lambda p: p.inertia,
        force=lambda u, p: p.motor * u.motor,
        restoring_force=lambda d, p: p.weight * ca.sin(d.swing),
        damping_force=lambda v, p: p.damping * v.swing,
    )  # fmt: skip
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

"""Trajectories of devices with inertia: inverse dynamics, smooth paths, drives that are held from sample to sample.

The references are written by hand for a mass on a spring with a cubic part, a damper and a drive that lags behind,
m a + c v + k d + k3 d^3 = f i,  tau i' = u - i.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from conftest import AXIS_FILE, SCENARIOS
from inertial_stages import (
    CUBIC,
    DAMPING,
    EFFECTS,
    FORCE,
    GOAL,
    LAG,
    LINE,
    MASS,
    PATHS,
    STIFFNESS,
    TRAVEL,
    coil,
    scenario,
    solved,
    stage,
    with_effect,
)
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp

import ctrlgen
from ctrlgen import InputError, build_model
from ctrlgen.core.errors import SolverError
from ctrlgen.devices import load_device
from ctrlgen.model.inverse_dynamics import inverse_dynamics, relative_degrees
from ctrlgen.model.simulation import simulate

SNAP = Polynomial([0, 0, 0, 0, 35, -84, 70, -20])  # from 0 to 1 with velocity, acceleration and jerk zero at both ends


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
    motion, duration = it.bind(model).motion, (n - 1) / 5000
    s = np.linspace(0, 1, n)
    assert motion.position[:, 0] == pytest.approx(-20e-6 + length * SNAP(s), abs=1e-12 * length)
    for k in (1, 2, 3):
        expected = length * SNAP.deriv(k)(s) / duration**k
        assert motion.derivatives[k - 1, :, 0] == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())


def test_derivatives_of_a_circle_turn_by_a_right_angle_each(tmp_path):
    it = scenario(tmp_path, stage(), 'kind = "circle"\ndiameter = "40 um"\nplane = ["x", "y"]\nturns = 3')
    motion, speed = it.bind(build_model(stage())).motion, 2 * np.pi * 3 / 0.1
    angle = speed * np.arange(500) / 5000
    for k, table in enumerate([motion.position, *motion.derivatives]):
        turned = angle + k * np.pi / 2
        expected = 20e-6 * speed**k * np.column_stack([np.cos(turned), np.sin(turned)])
        assert table == pytest.approx(expected, abs=1e-11 * 20e-6 * speed**k)


def test_a_line_is_by_default_one_derivative_smoother_than_the_drive_follows(tmp_path):
    still = scenario(tmp_path, coil(), LINE).bind(build_model(coil())).motion.derivatives
    assert np.all(np.abs(still[:, [0, -1]]) < 1e-12 * np.abs(still).max(axis=1, keepdims=True))
    s = np.linspace(0, 1, 500)
    command = scenario(tmp_path, stage(), 'kind = "line"\nend = { x = "1 um" }').bind(build_model(stage())).samples
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
            "m": "0.5 kg",
            "n": "0.1 kg",
            "c": "30 N*s/m",
            "e": "2 N*s/m",
            "k": "0.2 N/um",
            "q": "0.4 N/um",
            "f": "10 N/V",
        },
        axes={"base": "200 um", "tip": "200 um"},
        drive={"coil": "4 V"},
        reading={"axis": "100 um"},
        pose=pose,
        force=lambda u, p: [p.f * u.coil, 0],
        restoring_force=lambda d, p: [p.k * d.base + p.q * (d.base - d.tip), p.q * (d.tip - d.base)],
        damping_force=lambda v, p: [p.c * v.base + p.e * (v.base - v.tip), p.e * (v.tip - v.base)],
        mass=lambda p: [p.m, p.n],
    )


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


@pytest.mark.long
def test_a_law_without_an_inverse_is_named(tmp_path):
    with pytest.raises(SolverError, match=r"no drive held .*the device has backlash"):
        solved(tmp_path, with_effect(tmp_path, "backlash", 'gap = "1 um"'), LINE)
    device = ctrlgen.load_device(tmp_path / "device.toml")
    with pytest.raises(InputError, match=r"effect: .*backlash.* there is no inverse"):
        inverse_dynamics(build_model(device, sample_time=2e-4), "pose")

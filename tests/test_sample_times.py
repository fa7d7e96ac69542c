"""Calls at times that vary: every one exact, limits kept between them, and told where it came later than it was said to."""

from __future__ import annotations

import shutil

import casadi as ca
import numpy as np
import pytest
from conftest import DEVICE, SCENARIOS
from creeping_axis import CREEP
from reset_storm import CLOCK, INPUT, LOST, UNSURE, Compiled, Heaters, N, compiled, displacements, poses

from ctrlgen import InputError, build_model, load_device, load_scenario
from ctrlgen.controller.controller_step import answer
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.controller.sample_times import why_one_time
from ctrlgen.controller.timed import TimedController
from ctrlgen.firmware.c.real import Real
from ctrlgen.model.inverse import invert
from ctrlgen.numerics.phi_functions import phi_matrices, varied_gain

SHORTEST, NOMINAL, LONGEST = 0.5e-3, 1e-3, 2e-3
# A float holds a temperature to 30 uK, of which a stage makes 5 pm; the gain of a short sample rounds what is 10 times that
POSITION = 0.1e-9  # m
HOT = 823.15 + 2e-3  # K: the limit, with what a float's slack lets pass


DELAYED = """[[effect]]
kind = "delay"
at = "delta_x"
delay = "3 ms"
"""
HYSTERESIS = """[[effect]]
kind = "displacement_hysteresis"
at = "axis"
share = "0.1"
reach = "10 um"
taper = "1"
reversible = "0"
"""


@pytest.fixture(scope="module")
def both(tmp_path_factory) -> dict[Real, Compiled]:
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: sample times that vary were not tried")
    return compiled(tmp_path_factory.mktemp("timed"), ("0.5 ms", "2 ms"))


def pass_time(device: Heaters, power: np.ndarray, time: float) -> None:
    steady = device.rest + device.per_watt * power
    device.T = steady + (device.T - steady) * np.exp(-time / 5e-3)


def circle(t: float) -> np.ndarray:
    """The path of the scenario at any time, 1 s a turn."""
    pose = np.zeros(N)
    pose[3:] = 10e-6 * np.cos(2 * np.pi * t), 10e-6 * np.sin(2 * np.pi * t), 20e-6
    return pose


def ways(rng: np.random.Generator, count: int) -> np.ndarray:
    """Times of samples, some at both ends of what is allowed, as a float holds them."""
    h = rng.uniform(SHORTEST, LONGEST, count)
    h[::5], h[1::7], h[2::11] = np.float32(SHORTEST), np.float32(LONGEST), NOMINAL
    return np.clip(np.float32(h).astype(float), SHORTEST, LONGEST)


def follows(c: Compiled, calls: int, seed: int) -> float:
    """The largest error [m] of translations behind calls along the circle, at times that were said before."""
    rng, device, t, worst, since = np.random.default_rng(seed), Heaters(), 0.0, 0.0, NOMINAL
    m = c.model
    pose = ca.Function("pose", [m.x, m.z, m.u], [m.signals["pose"].expr])
    c.c_init(c.at)
    c.settle(circle(0.0))
    drive = np.array(c.out.drive)
    c.elapsed(c.twin.bounds.settling, drive)
    pass_time(device, drive, 1.0)
    hot, wanted = [], []
    for h in ways(rng, calls):
        assert c.step_after(since, h, circle(t + h)) == 0
        pass_time(device, np.array(c.out.drive), h)
        t, since = t + h, h
        hot.append(device.T)
        wanted.append(circle(t))
    reached = pose.map(calls)(np.array(hot).T, displacements(c, np.array(hot)).T, np.zeros((N, calls))).full().T
    worst = np.abs(reached - np.array(wanted))[:, 3:].max()
    return float(worst)


@pytest.mark.long
def test_a_path_is_followed_at_any_times_that_were_said_before(both):
    """As at the clock of the scenario, on a device that goes on by itself: its error is that of rounding."""
    assert follows(both[Real.FLOAT], 400, 0) < POSITION
    assert follows(both[Real.DOUBLE], 100, 1) < 1e-13


def jittered(c: Compiled, calls: int, seed: int, latest: float = LONGEST) -> tuple[int, int]:
    """Jumps among poses, some out of range, at times that come as they like; limits at each moment. How many calls were late, and told."""
    rng, device, since, told, late = np.random.default_rng(seed), Heaters(), NOMINAL, 0, 0
    targets, hot, now, believed = poses(c, rng, 64), [], [], []
    c.c_init(c.at)
    target = targets[0]
    for h in ways(rng, calls):
        if rng.random() < 0.2:
            target = targets[rng.integers(len(targets))]
        ahead = min(float(np.float32(latest if rng.random() < 0.7 else rng.uniform(h, LONGEST))), LONGEST)
        status = c.step_after(since, ahead, target)
        assert not status & (UNSURE | LOST | INPUT)
        told += bool(status & CLOCK)
        late += h > ahead
        now.append(device.T)
        believed.append(np.array(c.state.x_begun))
        drive, part = np.array(c.out.drive), min(h, ahead) * rng.random()
        pass_time(device, drive, part)
        hot.append(device.T)
        pass_time(device, drive, min(h, ahead) - part)
        hot.append(device.T)
        pass_time(device, drive, h - min(h, ahead))
        since = h
    T, (low, high) = np.array(hot), c.model.z_bounds
    z = displacements(c, T)
    assert T.max() <= HOT and np.all(z >= low - POSITION) and np.all(z <= high + POSITION)
    assert np.abs(np.array(believed) - np.array(now)).max() < 2e-3  # K, of 550: float
    return late, told


@pytest.mark.long
def test_limits_hold_at_every_moment_however_calls_jitter(both):
    """The latest time is said: whatever comes before it, the device is between where it was and where it was led."""
    late, told = jittered(both[Real.FLOAT], 600, 2)
    assert late == told == 0


@pytest.mark.long
def test_a_call_later_than_it_was_said_to_be_is_told_and_made_up_for(both):
    late, told = jittered(both[Real.FLOAT], 300, 3, latest=NOMINAL)
    assert late > 50 and abs(told - late) <= 1  # the last one is told by no call


@pytest.mark.long
def test_limits_hold_in_a_long_storm_of_jitter(both):
    for real, calls in ((Real.FLOAT, 100_000), (Real.DOUBLE, 20_000)):
        late, told = jittered(both[real], calls, 4)
        assert late == told == 0
        assert follows(both[real], 5000, 5) < (POSITION if real is Real.FLOAT else 1e-13)


def test_times_beyond_their_bounds_are_told_and_not_obeyed(both):
    """2 kHz and 500 Hz of a 1 kHz controller would be obeyed here: what is beyond the bounds is not."""
    c, target = both[Real.FLOAT], circle(0.0)
    for since, ahead in (
        (NOMINAL, 0.4e-3),
        (NOMINAL, 2.1e-3),
        (NOMINAL, np.nan),
        (NOMINAL, -NOMINAL),
        (NOMINAL, np.inf),
    ):
        c.c_init(c.at)
        c.step_after(NOMINAL, NOMINAL, target)
        assert c.step_after(since, ahead, target) == CLOCK | INPUT and not np.any(c.out.drive)
    for since in (0.4e-3, 2.1e-3, 0.0, -NOMINAL, np.nan, np.inf):
        c.c_init(c.at)
        assert not c.step_after(since, NOMINAL, target) & (CLOCK | INPUT)  # nothing was stepped before
        assert c.step_after(since, NOMINAL, target) == CLOCK | INPUT | UNSURE and not np.any(c.out.drive)
        assert c.step_after(NOMINAL, NOMINAL, target) & UNSURE
    c.c_init(c.at)
    c.step_after(NOMINAL, NOMINAL, target)
    c.out.drive[0] = np.nan  # what was held is not known
    assert c.step_after(LONGEST, NOMINAL, target) == CLOCK | INPUT | UNSURE


def test_c_and_python_agree_at_any_times(both):
    """In double: the same status, drives and beliefs, whatever the calls."""
    c, rng = both[Real.DOUBLE], np.random.default_rng(6)
    controller = c.twin.controller
    mine, T = TimedController(controller), poses(c, rng, 32)
    c.c_init(c.at)
    believed, times = mine.rest(), [SHORTEST, 0.7e-3, NOMINAL, 1.5e-3, LONGEST]
    for k in range(150):
        since, ahead = rng.choice(times, 2) if k % 11 else rng.choice([0.4e-3, 2.5e-3, np.nan, NOMINAL], 2)
        target = T[rng.integers(len(T))] * (1 if k % 13 else np.nan)
        held = np.array(c.out.drive)
        step, believed = mine.step_after(believed, since, ahead, target, held)
        assert c.step_after(since, ahead, target) == step.status
        assert np.allclose(c.out.drive, step.drive, rtol=0, atol=1e-9)
        assert np.allclose(c.state.x, believed.now.state[0], rtol=1e-9) and c.state.unsure == believed.now.unsure


def test_kernels_of_varying_times_are_those_of_each_time(both):
    """The series of a gain over a symbol h against the exponential of a number."""
    controller = both[Real.DOUBLE].twin.controller
    m, follow = controller.kernels.nominal, controller.kernels.follow
    x, z, u = m.rest + 30 * np.arange(N), np.full(N, 1e-6), np.linspace(0, 0.5, N)
    for h in (SHORTEST, NOMINAL, LONGEST):
        own, fixed = controller.kernels.over(h).moving, invert(m, follow, h)
        T = answer(fixed.state, x, z, np.full(N, 1e-5))
        wanted = np.full(N, 1e-5)
        assert np.allclose(answer(own.drive, x, z, wanted, T), answer(fixed.drive, x, z, wanted, T), rtol=1e-12)
        assert np.allclose(answer(own.advance, x, z, u), answer(fixed.advance, x, z, u), rtol=1e-14)
    h = ca.SX.sym("h")
    for rate in (-0.01, -30.0, -499.0, -501.0, -5000.0):  # the last two by the closed form
        gain = ca.Function("gain", [h], [varied_gain(ca.SX(rate), h, LONGEST)])
        for time in (SHORTEST, LONGEST):
            exact = time * phi_matrices(np.array([[rate * time]]), 1)[1][0, 0]
            assert float(gain(time)) == pytest.approx(exact, rel=3e-15 if abs(rate) < 500 else 1e-14)


def test_what_has_one_sample_time_alone_is_refused_with_its_reason(tmp_path):
    for name, reason in (("meso_circle", "remembers nothing"), ("dynamic_circle", "inertia")):
        said = why_one_time(build_model(load_scenario(SCENARIOS / name).device))
        assert said is not None and reason in said
    given = load_device(SCENARIOS / "devices" / "mems_hexapod_run_time.toml")
    assert "given at the start" in str(why_one_time(build_model(given)))
    for name, text, reason in (("late", DELAYED, "one by one"), ("creep", CREEP, None), ("play", HYSTERESIS, None)):
        (tmp_path / f"{name}.toml").write_text(DEVICE.read_text() + text.replace('"axis"', '"1X"'))
        said = why_one_time(build_model(load_device(tmp_path / f"{name}.toml"), sample_time=NOMINAL))
        assert said is None if reason is None else said is not None and reason in said
    with pytest.raises(InputError, match="sample_times"):
        controller_of(
            build_model(load_scenario(SCENARIOS / "meso_circle").device), "pose", NOMINAL, times=(SHORTEST, LONGEST)
        )


@pytest.mark.parametrize(
    ("times", "more", "why"),
    [
        (["2 ms", "0.5 ms"], {}, "the shortest and the longest"),
        (["2 ms", "3 ms"], {}, "between them"),
        (["1 ms", "1 ms"], {}, "the shortest"),
        (["0 ms", "1 ms"], {}, "0"),
        (["0.5 ms", "2 ms"], {"fixed_point": True}, "fixed_point"),
        (["0.5 ms", "2 ms"], {"feedforward": "modes"}, "kept with feedforward"),
        (["0.5 ms", "2 ms"], {"sample_rate": None, "duration": None, "points": 3}, "sample_rate"),
    ],
)
def test_sample_times_that_cannot_be_are_refused(times, more, why):
    file = load_scenario(SCENARIOS / "circle20").file
    with pytest.raises(ValueError, match=why):
        type(file).model_validate(file.model_dump() | more | {"sample_times": times})

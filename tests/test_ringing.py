"""Devices with inertia: the controller tells when the device may ring about the motion that it is to follow, and for how long."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from inertial_stages import coil
from ringing_storm import DAMPED, DAMPING, MASS, UNSURE, Compiled, H, Mass, storm
from ringing_storm import STIFFNESS as STIFFNESS_OF_AXIS
from scipy.linalg import expm
from two_masses import MASS as MASSES
from two_masses import STIFFNESS, damping, two_masses

from ctrlgen import ControllerStatus, build_model, load_device
from ctrlgen.controller.contraction import FOREVER
from ctrlgen.controller.motion_estimate import MotionEstimator
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.controller.ringing import STILL, ringing
from ctrlgen.firmware.c.real import Real

RANGE = 200e-6  # m
TOLERANCE = STILL * RANGE  # 0.2 um


@pytest.fixture(scope="module")
def floats(tmp_path_factory) -> Compiled:
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: resets were not tried")
    return Compiled(tmp_path_factory.mktemp("ringing"), Real.FLOAT)


def keeps_its_promises(c: Compiled, calls: int, seed: int) -> None:
    found = storm(c, calls, seed)
    true, promised = np.array(found.true), np.array(found.promised)
    assert calls / 10 < len(true) and found.told > calls / 10
    assert len(found.events) == 9 and min(found.events.values()) > calls / 6000
    assert np.abs(true).max() <= RANGE / 2 + TOLERANCE
    assert np.abs(true - promised).max() <= TOLERANCE


def test_a_status_of_zero_is_true_whatever_set_the_device_ringing_before(floats):
    keeps_its_promises(floats, 8000, 0)


@pytest.mark.long
def test_a_status_of_zero_is_true_in_a_long_storm_of_a_mass(floats):
    keeps_its_promises(floats, 100_000, 1)


@pytest.mark.exhaustive
def test_a_status_of_zero_is_true_in_a_million_calls_of_a_mass(floats):
    keeps_its_promises(floats, 1_000_000, 2)


def test_a_reset_of_a_moving_mass_that_is_taken_for_rest_breaks_what_was_promised(floats):
    found = storm(floats, 40_000, 0, tells=False)
    assert np.abs(np.array(found.true) - np.array(found.promised)).max() > 10 * TOLERANCE


def test_c_and_python_tell_the_same_of_a_mass(tmp_path):
    """Any calls, in double: the same status, drive and bound."""
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: the C was not compared")
    c, rng = Compiled(tmp_path, Real.DOUBLE), np.random.default_rng(3)
    twin = c.twin
    c.c_init(c.at)
    mine, tick = twin.rest(), 2**32 - 90
    for k in range(400):
        what, held = int(rng.integers(10)), np.array([c.out.drive])
        target = rng.normal(size=3) * [4e-5, 1e-2, 20] * rng.choice([0, 1e-4, 1, 3]) if k % 3 == 0 else np.zeros(3)
        if k % 11 == 5:  # nothing can follow that
            target = np.array([0.0, 0.0, 0.9 * float(twin.controller.kernels.input_limits[2])])
        if what == 0:
            assert c.c_forget(c.at) == UNSURE
            mine = twin.forget(mine)
        elif what == 1:
            ticks, drive = int(rng.choice([0, 1, 7, 64, 300, 2**31])), rng.uniform(-4, 4) * (1.2 if k % 9 == 0 else 1)
            told, mine = twin.elapsed(mine, ticks, np.array([drive]))
            assert c.elapsed(ticks, drive) == told
        elif what == 2:
            v, z = rng.choice([0, 1e-4, 1]) * rng.normal(size=2) * [1e-2, 1e-5]
            error = rng.choice([-1, 0, 1e-3, 1, np.nan, 1e23], p=[0.1, 0.3, 0.3, 0.1, 0.1, 0.1]) * np.array(
                [1e-3, 1e-6]
            )
            told, mine = twin.observe(mine, *(np.array([value]) for value in (v, z, *error)))
            assert c.observe(v, z, *error) == told
        elif what == 3:
            step, mine = twin.step(mine, target, settle=True)
            assert c.settle(target) == step.status
        elif what == 4:  # a step that the clock counts, whatever it says
            step, mine = twin.step(mine, target)
            assert c.step(target) == step.status
        else:
            tick = mine.tick if k % 2 and mine.tick is not None else tick
            tick = (tick + int(rng.choice([1, 1, 1, 1, 0, 3, 100, -2]))) % 2**32
            step, mine = twin.step_at(mine, tick, target, held)
            told = ControllerStatus.CLOCK | twin.elapsed(mine, 0, np.zeros(1))[0] if step is None else step.status
            assert c.step_at(tick, target) == told
            assert step is None or c.out.drive == pytest.approx(step.drive[0], abs=1e-12)
        assert mine.tick is None or c.state.tick == mine.tick
        assert c.state.ringing == pytest.approx(mine.ringing, rel=1e-6, abs=1e-12)  # its decay is rounded up
        assert np.array(c.state.ahead) == pytest.approx(mine.ahead, abs=1e-9)
        assert c.state.z == pytest.approx(mine.state[1][0], abs=1e-18)


@pytest.mark.parametrize("damping", [0.1, 0.8])
def test_what_a_held_drive_leaves_of_a_fast_path_is_told(tmp_path, damping):
    """A sample of half the mass's own period, in which it answers to every step of the drive."""
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: the C was not tried")
    own = float(np.sqrt(STIFFNESS_OF_AXIS / MASS))
    h, c = 3 / own, 2 * damping * own * MASS
    tool = Compiled(tmp_path, Real.DOUBLE, DAMPED.replace(f'"{DAMPING:g} N*s/m", sd = "20 N*s/m"', f'"{c!r} N*s/m"'), h)
    for turn in (0.01, 0.08):
        size, w, device = 9e-5, turn / h, Mass(c)
        tool.c_init(tool.at)
        belief, told, far = tool.twin.rest(), [], []
        for k in range(240):
            angle = (k + 0.5) * turn
            target = size * np.array([np.sin(angle), w * np.cos(angle), -w * w * np.sin(angle)])
            told.append(tool.step_at(k, target))
            if k < 40:
                step, belief = tool.twin.step(belief, target)
                assert told[-1] == step.status
            apart = []
            for part in range(8):
                device.hold(float(tool.out.drive), h / 8)
                apart.append(abs(device.y[0] - size * np.sin((k + (part + 1) / 8) * turn)))
            far.append(max(apart))
        sure = np.array(told) == 0
        assert np.max(np.array(far)[sure]) <= TOLERANCE
        assert sure.mean() > 0.9 if turn == 0.01 else sure.mean() < 0.2 and max(far) > 3 * TOLERANCE


@pytest.mark.parametrize("place", [0.0, 99e-6])
def test_no_command_rings_for_longer_than_the_header_says(floats, place):
    """An acceleration that nothing can follow, for one sample: the device itself has moved no more than its drives made it; about
    home, and about the end of its range."""
    settling, still = floats.twin.bounds.settling, (place, 0.0, 0.0)
    held = float(floats.twin.controller.step(floats.twin.rest().state, np.array(still), settle=True).drive[0])
    absurd = 0.99 * float(floats.twin.controller.kernels.input_limits[2])
    assert absurd > 1e3
    for wait in (lambda: [floats.settle(still) for _ in range(settling)][-1], lambda: floats.elapsed(settling, held)):
        floats.c_init(floats.at)
        for _ in range(3):
            assert floats.c_step(floats.at, (floats.number * 3)(-place, 0.0, absurd), floats.output) & UNSURE
        assert wait() == 0


def test_a_ringing_that_is_over_is_zero_and_no_denormal_number(floats):
    floats.c_init(floats.at)
    floats.c_forget(floats.at)
    left = []
    for _ in range(3 * floats.twin.bounds.settling):
        floats.settle((0.0, 0.0, 0.0))
        left.append(float(floats.state.ringing))
    assert left[-1] == 0 and min(size for size in left if size) >= 1.9e-6
    floats.c_forget(floats.at)
    floats.elapsed(5 * floats.twin.bounds.settling, 0.0)
    assert floats.state.ringing == 0


def bounds_of(folder, device: str):
    (folder / "device.toml").write_text(device)
    return ringing(build_model(load_device(folder / "device.toml")), H, None)


@pytest.mark.parametrize("damping", [DAMPING, DAMPING - 2 * 20])
def test_a_ringing_is_told_as_over_when_it_is(tmp_path, damping):
    """From the worst that drives can do, by driving the true device at its resonance, and with the damping that it has at least."""
    bounds, device = bounds_of(tmp_path, DAMPED), Mass(damping)
    nx, size = bounds.weights
    farthest = 0.0
    for _ in range(2000):  # whatever drives do, they do no more
        device.hold(4.0 * np.sign(device.y[1] or 1.0), H)
        farthest = max(farthest, abs(device.y[0]))
        assert np.hypot(nx * device.y[1] / bounds.reach[0], size * device.y[0] / bounds.reach[1]) < bounds.unknown
    assert farthest > 1.5 * 4.0 * 10 / 2e5  # of where the drive holds it
    for _ in range(bounds.settling):
        device.hold(0.0, H)
    assert np.abs(device.y[0]) <= TOLERANCE


def test_differences_die_out_as_they_are_said_to(rng):
    """Random differences of a mass with a coil that lags: weighted, below the bound, and below it ever after."""
    model = build_model(coil())
    linear = build_model(coil(restoring_force=lambda d, p: p.k * d.axis))
    bounds = ringing(linear, H, None)
    assert bounds.settling < FOREVER and ringing(model, H, None).settling == FOREVER  # it stiffens by half
    A = np.array([[-1e3, 0, 0], [20.0, -60.0, -4e5], [0, 1, 0]])  # current, velocity, displacement
    step = expm(H * A)
    tolerated = STILL * np.array([8.0, np.inf, 200e-6])
    for _ in range(30):
        e = rng.normal(size=3) / bounds.weights
        for n in range(0, 400, 40):
            left = np.linalg.matrix_power(step, n) @ e
            bound = float(bounds.weights @ np.abs(e)) * bounds.decay**n
            assert np.all(np.abs(left) <= bound * tolerated * (1 + 1e-9))


def test_the_damping_that_a_device_has_at_least_counts(tmp_path):
    sure = bounds_of(tmp_path, DAMPED.replace(', sd = "20 N*s/m"', ""))
    usual = bounds_of(tmp_path, DAMPED)
    hardly = bounds_of(tmp_path, DAMPED.replace('sd = "20 N*s/m"', 'sd = "100 N*s/m"'))
    rates = [-np.log(b.decay) / H for b in (sure, usual)]
    slowest = [0.95 * c / (2 * m) for c, m in ((DAMPING, MASS + 0.05), (DAMPING - 40, MASS + 0.05))]
    assert rates[0] > slowest[0] and slowest[1] < rates[1] < 0.85 * rates[0]
    assert hardly.settling == FOREVER and hardly.decay == 1.0


def test_a_device_without_damping_is_unsure_until_it_is_told(tmp_path):
    (tmp_path / "device.toml").write_text(DAMPED.replace(f'"{DAMPING:g} N*s/m", sd = "20 N*s/m"', '"0 N*s/m"'))
    twin = MotionEstimator(controller_of(build_model(load_device(tmp_path / "device.toml")), "pose", H))
    assert twin.bounds.settling == FOREVER
    still = np.zeros(3)
    known = twin.forget(twin.rest())
    _, known = twin.elapsed(known, 2**30, np.zeros(1))
    step, known = twin.step(known, still)
    assert ControllerStatus.UNSURE in step.status
    nothing = np.zeros(1)
    told, seen = twin.observe(known, nothing, nothing, nothing, np.full(1, 1e-9))
    assert told == 0 and ControllerStatus.UNSURE not in twin.step(seen, still)[0].status
    assert twin.step(twin.rest(), still)[0].status == 0
    _, settled = twin.step(twin.rest(), np.array([3e-5, 0.0, 0.0]), settle=True)
    assert twin.observe(settled, *settled.state, nothing, nothing)[0] == 0  # told that it stands there


def test_a_header_says_when_a_ringing_is_told_as_over(tmp_path, floats):
    assert "_SETTLING (323U)" in floats.header and "Clears itself */" in floats.header
    if shutil.which("gcc"):
        never = Compiled(tmp_path, Real.FLOAT, DAMPED.replace(f'"{DAMPING:g} N*s/m", sd = "20 N*s/m"', '"0 N*s/m"'))
        assert "_SETTLING (0xFFFFFFFFU)" in never.header and "Clears itself by no waiting" in never.header


@pytest.mark.long
def test_a_float_tells_a_ringing_as_over_when_the_header_says(tmp_path):
    """Of a stage that rings for long the decay of a sample is near one, and what a float rounds of it adds up."""
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: no float rounded")
    c = Compiled(tmp_path, Real.FLOAT, DAMPED.replace(f'"{DAMPING:g} N*s/m", sd = "20 N*s/m"', '"0.5 N*s/m"'))
    settling = c.twin.bounds.settling
    assert 1e5 < settling < FOREVER
    c.c_init(c.at)
    for ticks, told in ((settling, 0), (int(0.99 * settling), UNSURE)):
        c.c_forget(c.at)
        assert c.elapsed(ticks, 0.0) == told
    c.c_forget(c.at)
    still = np.zeros(3)
    told = [c.settle(still) for _ in range(settling)]
    assert told[-1] == 0 and told[int(0.99 * settling)] == UNSURE


def test_modes_that_are_led_ring_too(tmp_path):
    """Two masses with 1 % of damping, after a jump: the second one is told as still when it is, and nobody can measure the first."""
    (tmp_path / "device.toml").write_text(two_masses('modes_below = "200 Hz"\n'))
    model, h = build_model(load_device(tmp_path / "device.toml")), 5e-4
    twin = MotionEstimator(controller_of(model, "pose", h, True))
    assert len(twin.bounds.weights) == 4 and not twin.controller.kernels.can_be_observed
    target = np.zeros(len(twin.controller.kernels.target.channels))
    assert twin.step(twin.rest(), target)[0].status == 0
    target[0] = 3e-4
    step, after = twin.step(twin.rest(), target)
    assert ControllerStatus.UNSURE in step.status
    told = [n for n in range(1, 20_000, 100) if not twin.elapsed(after, n, step.drive)[0]]
    A = np.block(
        [[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(MASSES, STIFFNESS), -np.linalg.solve(MASSES, damping())]]
    )
    there = np.append(np.linalg.solve(STIFFNESS, [step.drive[0], 0.0]), [0.0, 0.0])
    left = [np.abs(expm(n * h * A) @ -there)[1] for n in range(told[0], told[0] + 40)]
    tolerance = STILL * float(np.ptp(model.z_bounds))
    assert tolerance / 100 < max(left) <= tolerance and 2 * tolerance < there[1]

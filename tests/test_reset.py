"""Resets, late and double calls: the controller tells when its belief of the device may be wrong, and keeps its promises else."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
from conftest import DEVICE, SCENARIOS
from creeping_axis import CREEP
from reset_storm import CLOCK, INPUT, LOST, UNSURE, Compiled, N, compiled, displacements, poses, storm

from ctrlgen import build_model, load_device, load_scenario
from ctrlgen.controller.contraction import FOREVER, forgetting, shrinking
from ctrlgen.controller.controller_step import ControllerStatus, answer
from ctrlgen.controller.estimate import EXACT, Estimator
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Real

# The state is known to a millionth of what heaters can lead to, 0.55 mK, of which a stage makes some 0.1 nm; floats round to as much.
POSITION = 0.2e-9  # m
HOT = 823.15 + 2e-3  # K: the limit, with the same


@pytest.fixture(scope="module")
def both(tmp_path_factory) -> dict[Real, Compiled]:
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: resets were not tried")
    return compiled(tmp_path_factory.mktemp("storm"))


@pytest.fixture(scope="module")
def floats(both) -> Compiled:
    return both[Real.FLOAT]


def keeps_its_promises(c: Compiled, calls: int, seed: int) -> None:
    found = storm(c, calls, seed)
    T, promised, (low, high) = np.array(found.hot), np.array(found.promised), c.model.z_bounds
    z = displacements(c, T)
    assert len(T) > calls / 20 and found.resets > calls / 100 and found.told > calls / 5
    assert found.late > calls / 50 and found.double > calls / 200 and found.untimed > calls / 100
    assert T.max() <= HOT and np.all(z >= low - POSITION) and np.all(z <= high + POSITION)
    assert np.max(np.abs(z - promised)) <= POSITION


@pytest.mark.long
def test_a_status_of_zero_is_true_whatever_resets_and_late_calls_were_before(floats):
    keeps_its_promises(floats, 3000, 0)


@pytest.mark.long
def test_a_status_of_zero_is_true_in_a_long_storm(floats):
    keeps_its_promises(floats, 100_000, 1)


@pytest.mark.long
def test_a_reset_that_is_taken_for_a_cold_start_breaks_what_was_promised(floats):
    """The storm finds it: what the tests above show is not for want of trying."""
    found = storm(floats, 3000, 0, forgets=False)
    off = np.abs(displacements(floats, np.array(found.hot)) - np.array(found.promised))
    assert off.max() > 1e-6


def estimate_of(c: Compiled):
    return np.array(c.state.x), np.array(c.state.z), c.state.unsure


def test_c_and_python_believe_the_same(both):
    """Any calls, in double: the same status, count of samples, state and drives."""
    c, rng = both[Real.DOUBLE], np.random.default_rng(4)
    targets, twin = poses(c, rng, 64), c.twin
    c.c_init(c.at)
    mine, tick = twin.rest(), 2**32 - 40
    for k in range(300):
        what, held = int(rng.integers(9)), np.array(c.out.drive)
        target = targets[rng.integers(len(targets))]
        if what == 0:
            assert c.c_forget(c.at) == UNSURE
            mine, told = twin.forget(mine), None
        elif what == 1:
            ticks, drive = (
                int(rng.choice([0, 1, 7, 64, 65, 80, 200])),
                rng.uniform(0, 1, N) * (1.2 if k % 9 == 0 else 1),
            )
            told, mine = twin.elapsed(mine, ticks, drive)
            assert c.elapsed(ticks, drive) == told
        elif what == 2:
            error = float(rng.choice([-1, 0, 1e-4, 0.1, 30, np.nan, 1e19]))
            measured = np.clip(mine.state[0] + rng.choice([0, 1e-4, 1, 1000]) * rng.normal(size=N), 250, 900)
            told, mine = twin.observe(mine, measured, error)
            assert c.observe(measured, error) == told
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
            told = ControllerStatus.CLOCK | twin.elapsed(mine, 0, np.zeros(N))[0] if step is None else step.status
            assert c.step_at(tick, target) == told
            if step is not None:
                assert np.allclose(c.out.drive, step.drive, rtol=0, atol=1e-9)
        x, z, unsure = estimate_of(c)
        assert unsure == mine.unsure and (mine.tick is None or c.state.tick == mine.tick)
        assert np.allclose(x, mine.state[0], rtol=1e-9) and np.allclose(z, mine.state[1], rtol=0, atol=1e-14)


def test_a_measurement_is_believed_as_far_as_it_is_better(floats):
    twin = floats.twin
    rest, n = twin.rest(), N
    cold = rest.state[0][:n]
    _, known = twin.observe(twin.forget(rest), cold + 100, 0.0)
    assert known.unsure == 0 and np.allclose(known.state[0], cold + 100)
    _, near = twin.observe(twin.forget(rest), cold + 100, 1.0)
    assert 0 < near.unsure < twin.bounds.unknown
    assert np.allclose(near.state[0], cold + 101)  # the hottest that it can be
    told, same = twin.observe(near, cold + 50, 60.0)  # worse than what is known
    assert told == ControllerStatus.UNSURE and np.array_equal(same.state[0], near.state[0])
    told, given_up = twin.observe(rest, cold + 5, 1.0)  # a device that was to be cold is not
    assert told == ControllerStatus.UNSURE and given_up.unsure == twin.bounds.unknown
    for measured, error in ((cold + np.nan, 1.0), (cold - 5, 1.0), (cold, -1.0), (cold, np.nan)):
        told, same = twin.observe(rest, measured, error)
        assert told == ControllerStatus.INPUT and same is rest


def test_a_device_that_was_not_followed_is_unsure_until_it_must_have_settled(floats):
    """As at 100 kHz, where to settle takes much longer than the samples of a late call that are followed one by one."""
    twin = Estimator(controller_of(floats.model, "pose", 1e-5))
    held = np.full(N, 0.3)
    for ticks in (EXACT, EXACT + 1, 5 * EXACT):
        _, late = twin.elapsed(twin.rest(), ticks, held)
        assert late.unsure == (0 if ticks <= EXACT else twin.bounds.settling - ticks)


def test_a_clock_that_goes_back_leaves_the_state_unknown(floats):
    twin, target = floats.twin, poses(floats, np.random.default_rng(3), 1)[0]
    _, now = twin.step_at(twin.rest(), 10, target, np.zeros(N))
    assert now.unsure == 0
    step, now = twin.step_at(now, 8, target, np.zeros(N))
    assert ControllerStatus.UNSURE | ControllerStatus.CLOCK in step.status
    assert now.unsure == twin.bounds.unknown - 1


def test_a_measured_state_is_known_when_it_was_said_to_be(floats):
    """Believed at one end of the error, true at the other: as far apart as the count is for. At 100 kHz a halving is 347 samples, so that
    none is lost to a whole sample."""
    twin = Estimator(controller_of(floats.model, "pose", 1e-5))
    b, rest, (_, moving) = twin.bounds, twin.rest(), twin.controller.kernels.modes
    error = 0.49 * b.known[0] * 2**10
    middle = rest.state[0] + 100
    _, near = twin.observe(twin.forget(rest), middle, error)
    gap = near.state[0] - (middle - error)
    z, off = near.state[1], np.zeros(N)
    ends = near.state[0], middle - error
    for _ in range(near.unsure):
        ends = answer(moving.advance, ends[0], z, off), answer(moving.advance, ends[1], z, off)
    assert np.all(gap > 900 * b.known) and np.all(np.abs(ends[0] - ends[1]) <= b.known)


def test_a_lost_state_is_not_corrected(floats):
    floats.c_init(floats.at)
    floats.state.x[0] = np.nan
    assert floats.elapsed(1, np.zeros(N)) == LOST and floats.observe(np.full(N, 300.0), 0.0) == LOST
    assert floats.c_forget(floats.at) == LOST and floats.c_forget(None) == INPUT
    assert CLOCK not in (floats.step_at(1, np.zeros(N)), floats.step_at(1, np.zeros(N)))


def creeping(tmp_path, *effects: str):
    (tmp_path / "device.toml").write_text(DEVICE.read_text() + "".join(e.replace('"axis"', '"1X"') for e in effects))
    scenario = replace(load_scenario(SCENARIOS / "circle20"), device=load_device(tmp_path / "device.toml"))
    return controller_of(build_model(scenario.device), scenario.file.follow, scenario.sample_time)


def test_two_beliefs_of_a_device_that_creeps_meet_when_they_were_said_to(tmp_path):
    """From both ends of what drives can lead to, under the same random drives, with creep behind the heaters."""
    controller = creeping(tmp_path, CREEP)
    bounds, (static, moving) = controller.kernels.contraction, controller.kernels.modes
    assert bounds.unknown == bounds.settling > 14 * 0.8 / 1e-3  # the slow creep's time constant, four times 0.2 s
    rng, ends = np.random.default_rng(2), []
    drives = [rng.uniform(0, 0.5, N) for _ in range(40)]
    for x in (bounds.low, bounds.high):
        z = answer(static.settle, x, np.zeros(N), drives[0])
        for k in range(bounds.unknown):
            u = drives[k * len(drives) // bounds.unknown]
            x = answer(moving.advance, x, z, u)
            z = answer(static.settle, x, z, u) if k % 50 == 0 or k > bounds.unknown - 50 else z
        ends.append(x)
    assert np.all(np.abs(ends[0] - ends[1]) <= bounds.known)


HYSTERESIS = """[[effect]]
kind = "displacement_hysteresis"
at = "axis"
share = "0.1"
reach = "10 um"
taper = "1"
reversible = "0"
"""


def test_a_hysteresis_is_not_known_by_waiting(tmp_path):
    bounds = creeping(tmp_path, HYSTERESIS).kernels.contraction
    assert bounds.unknown == FOREVER and bounds.settling < 1000  # heaters settle nevertheless
    assert np.isinf(bounds.known[N:]).any() and np.all(np.isfinite(bounds.known[:N]))


def test_what_a_play_acts_on_does_not_forget_either():
    """A lag, a play (a gain of one) that follows it, a lag that follows the play, and one that follows that."""
    gain = np.diag([0.5, 1.0, 0.5, 0.5]) + np.diag([0.1, 0.1, 0.1], -1)
    assert forgetting(gain).tolist() == [True, False, False, False]
    unbounded = np.diag([0.5, 0.5])
    unbounded[1, 0] = np.inf
    assert forgetting(unbounded).tolist() == [True, False]


def test_devices_without_states_and_equilibria_have_nothing_to_be_wrong():
    for name in ("meso_circle", "coupled_dof"):
        scenario = load_scenario(SCENARIOS / name)
        kernels = controller_of(build_model(scenario.device), scenario.file.follow, scenario.sample_time).kernels
        assert kernels.contraction is None


def test_errors_shrink_as_fast_as_they_are_said_to(rng):
    """Random lags that act on one another, one after the other too: after so many samples the error is below one, and stays there."""
    for _ in range(30):
        gain = rng.uniform(0, 1, (5, 5)) * (rng.random((5, 5)) < 0.4)
        gain *= 0.97 / max(np.abs(np.linalg.eigvals(gain)).max(), 0.1)
        error = 10 ** rng.uniform(0, 6, 5)
        shrinks = shrinking(gain, error)
        for n in range(1, 12):  # what a measurement's error is counted by, all at one size
            after = np.linalg.matrix_power(gain, n * shrinks.halving) @ np.ones(5)
            assert after.max() <= shrinks.growth * 0.5**n * (1 + 1e-9)
        left = np.linalg.matrix_power(gain, shrinks.samples(error)) @ error
        for _ in range(200):
            assert np.all(left <= 1 + 1e-9)
            left = gain @ left


def test_the_count_of_a_settling_device_is_told_by_every_call(floats):
    twin = floats.twin
    target = poses(floats, np.random.default_rng(1), 1)[0]
    step, there = twin.step(twin.rest(), target, settle=True)
    for _ in range(twin.bounds.settling - 1):
        assert step.status & ControllerStatus.UNSURE
        step, there = twin.step(there, target, settle=True)
    step, there = twin.step(there, target, settle=True)
    assert not step.status & ControllerStatus.UNSURE

from __future__ import annotations

import tomllib
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from conftest import DEVICE
from scipy.optimize import lsq_linear

from ctrlgen import ControllerStatus, build_model, simulate, user_device
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.model.inverse import ExpansionPoint, solve_by_blocks

NM, H = 1e-9, 1e-3


@pytest.fixture(scope="module")
def controller(model):
    return controller_of(model, "pose", H)


def limits_kept(model, x, z, u) -> bool:
    """Every limit, with the slack of a few roundings of its bound."""
    for limit, value in zip(model.limits, model.evaluate_limits(x, z, u, model.p_nominal), strict=True):
        v = value.full().ravel()
        if limit.upper is not None and np.any(v > limit.upper * (1 + 1e-9)):
            return False
        if limit.lower is not None and np.any(v < limit.lower - 1e-9 * max(abs(limit.lower), 1e-3)):
            return False
    return True


def solve_one(equations, unknowns, **at) -> ca.DM:
    """Roots of `equations` by the block solver, all symbols but the unknowns at given values."""
    others = ca.vertcat(*at.values()) if at else ca.SX(0, 1)
    n = unknowns.numel()
    known = ExpansionPoint(
        ca.vertcat(others, unknowns),
        np.concatenate([np.zeros(others.numel()), np.zeros(n)]),
        np.ones(others.numel() + n),
    )
    return ca.Function("f", [others], [solve_by_blocks(known, equations, unknowns)])


def test_a_linear_block_is_solved_exactly():
    v, c = ca.SX.sym("v", 2), ca.SX.sym("c", 2)
    f = solve_one(ca.vertcat(2 * v[0] + c[0] * v[1] - 1, v[0] - v[1] - c[1]), v, c=c)
    a, b = f([3.0, 0.5]).full().ravel()
    assert 2 * a + 3 * b == pytest.approx(1, abs=1e-14) and a - b == pytest.approx(0.5, abs=1e-14)


def test_a_quadratic_takes_the_root_on_the_side_of_operation_without_cancellation():
    v, q = ca.SX.sym("v"), ca.SX.sym("q")
    f = solve_one(v + v**2 - q, v, q=q)
    assert float(f(6.0)) == pytest.approx(2.0, rel=1e-15)
    assert float(f(1e-18)) == pytest.approx(1e-18, rel=1e-15)  # the textbook formula gives 0 here
    g = solve_one(q - v**2, v, q=q)
    assert float(g(9.0)) == 3.0 and float(g(-9.0)) == -3.0 and float(g(0.0)) == 0.0


def test_what_is_neither_is_solved_by_newton_steps():
    v, q = ca.SX.sym("v"), ca.SX.sym("q")
    f = solve_one(v + ca.tanh(v) - q, v, q=q)
    root = float(f(1.5))
    assert root + np.tanh(root) == pytest.approx(1.5, abs=1e-14)


def test_blocks_are_solved_in_the_order_that_they_need():
    v = ca.SX.sym("v", 3)
    f = solve_one(ca.vertcat(v[2] - v[1] ** 2 - v[1], v[0] - 2, v[1] - v[0]), v)
    assert f([]).full().ravel() == pytest.approx([2, 2, 6])


def test_random_reachable_poses_come_back_through_the_model(model, controller, rng):
    """Settle, then simulate the model for 60 time constants with the drive."""
    for z in rng.uniform(1e-6, 3e-5, size=(20, 6)):  # below the smallest corner that the wires allow
        pose = model.evaluate(model.rest, z, 0, [])[list(model.signals).index("pose")].full().ravel()
        step = controller.step(controller.rest(), pose, settle=True)
        assert step.status == 0
        reached = simulate(model, np.tile(step.drive, (300, 1)), H).signals["pose"][-1]
        assert np.abs(reached - pose)[3:].max() < 0.01 * NM and np.abs(reached - pose)[:3].max() < 1e-12


def test_no_target_makes_it_leave_a_limit(model, controller, rng):
    """Hostile sequences: far, huge, not a number; the model driven by the answers keeps every limit."""
    scale = np.array(model.signals["pose"].scale)
    targets = list(rng.normal(size=(150, 6)) * scale * 10 ** rng.uniform(0, 3, (150, 1)))
    targets[10], targets[20], targets[30] = np.full(6, np.nan), np.full(6, np.inf), np.full(6, -1e300)
    state, drives, seen = controller.rest(), [], ControllerStatus(0)
    for k, target in enumerate(targets):
        step = controller.step(state, target)
        state, seen = step.state, seen | step.status
        drives.append(step.drive)
        assert limits_kept(model, np.append(step.actuator_state, []), step.displacement, step.drive)
        assert bool(step.status & ControllerStatus.INPUT) == (k in (10, 20, 30))
    trace = simulate(model, np.array(drives), H)
    for k in range(len(trace.time)):
        assert limits_kept(model, trace.x[k], trace.z[k], drives[min(k, len(drives) - 1)])
    assert (
        seen & ControllerStatus.DISPLACEMENT
        and seen & ControllerStatus.COMPOSITE
        and seen & ControllerStatus.DRIVE
        and seen & ControllerStatus.INPUT
    )


def test_the_temperature_limit_is_kept_where_the_stroke_would_allow_more():
    table = tomllib.loads(DEVICE.read_text())
    table["actuator"]["temperature_limit"]["value"] = "120 degC"
    model = build_model(validate(Device.library["mems_hexapod"], table, "cooler"))
    controller = controller_of(model, "displacement", H)
    step = controller.step(controller.rest(), np.full(6, 30e-6), settle=True)
    assert step.status == ControllerStatus.STATE
    assert step.actuator_state == pytest.approx(np.full(6, 393.15), abs=1e-9)
    settled = simulate(model, np.tile(step.drive, (300, 1)), H)
    assert settled.signals["state"].max() <= 393.15 + 1e-9


def test_not_a_number_switches_the_heaters_off_and_the_state_cools(controller):
    warm = controller.step(controller.rest(), np.array([0, 0, 0, 0, 0, 2e-5]), settle=True)
    step = controller.step(warm.state, np.full(6, np.nan))
    assert step.status == ControllerStatus.INPUT and np.all(step.drive == 0)
    assert np.all(step.state[0] < warm.state[0])


def test_the_cheap_bound_of_the_stress_is_never_below_it_and_exact_for_a_lift(model, controller, rng):
    z = rng.uniform(*(bound[0] for bound in model.z_bounds), size=(6, 2000))
    z[:, ::2] *= rng.uniform(0, 1, (6, 1000))
    cold = np.tile(model.rest[:, None], (1, 2000))
    shares = controller.kernels.composite_ratio.map(2000)(cold, 0 * z, z).full().ravel()
    bounds = controller.kernels.composite_bound.map(2000)(z).full().ravel()
    assert np.all(bounds >= shares) and shares.max() > 1
    lift = controller.kernels.static.displacement(model.rest, np.zeros(6), [0, 0, 0, 0, 0, 2e-5])
    share = float(controller.kernels.composite_ratio(model.rest, np.zeros(6), lift))
    assert share == pytest.approx(float(controller.kernels.composite_bound(lift)), abs=1e-4) and share > 0.3


@pytest.mark.parametrize(("low", "high"), [("-30 um", "0 um"), ("-30 um", "1 um"), ("0 um", "30 um")])
def test_a_stress_is_limited_whatever_the_signs_of_the_displacements(low, high):
    """The cheap bound of axes that are only pulled is as good as of those that are pushed."""
    device = user_device(
        "stage",
        parameters={"gain": "0.2 N/V", "stiffness": "1 N/um"},
        drive=dict.fromkeys("xy", "150 V"),
        axes=dict.fromkeys("xy", (low, high)),
        force=lambda u, p: p.gain * u.vector,
        restoring_force=lambda d, p: p.stiffness * d.vector,
        limits={"stress": (lambda d, p: 1e13 * ca.sum1(ca.fabs(d.vector)), "250 MPa")},
    )
    controller = controller_of(build_model(device), "pose", H)
    target = np.array([25e-6, 20e-6]) * (-1 if low.startswith("-") else 1)
    step = controller.step(controller.rest(), target, settle=True)
    assert step.status == ControllerStatus.COMPOSITE
    assert step.displacement == pytest.approx(target / 1.8, rel=1e-9)


def test_a_target_beyond_the_drives_is_approached_as_far_as_they_reach(model, controller):
    """The drive that is first at its limit is at it, and the displacement on the straight line to the target."""
    settled = controller.step(controller.rest(), np.array([0, 0, 0, 0, 0, 1e-5]), settle=True).state
    for target in ([0, 0, 0, 0, 0, 3e-5], [0, 0, 0, 0, 0, 1e-6], [0, 0, 0, 5e-6, 0, 3e-5]):
        step = controller.step(settled, np.array(target))
        assert step.status & ControllerStatus.DRIVE
        low, high = model.u_bounds
        assert min(np.min(high - step.drive), np.min(step.drive - low)) < 1e-3 * (high - low)[0]
        goal = controller.kernels.moving.displacement(*settled, target).full().ravel().clip(*model.z_bounds)
        way = (step.displacement - settled[1]) @ (goal - settled[1]) / np.sum((goal - settled[1]) ** 2)
        assert step.displacement == pytest.approx(settled[1] + way * (goal - settled[1]), abs=1e-12)


def test_temperatures_that_the_stroke_implies_are_not_limited_online(controller):
    assert not controller.state_can_be_limited
    table = tomllib.loads(DEVICE.read_text())
    table["actuator"]["temperature_limit"]["value"] = "120 degC"
    cooler = build_model(validate(Device.library["mems_hexapod"], table, "cooler"))
    assert controller_of(cooler, "pose", H).state_can_be_limited


def test_beyond_the_range_the_nearest_target_inside_is_taken(model, controller, rng):
    """In typical sizes of the pose, against an exact bounded least-squares solver; clipping each displacement is far worse."""
    low, high = model.z_bounds
    slope = ca.Function("W", [model.x, model.z], [ca.jacobian(model.signals["pose"].expr, model.z)])(
        model.rest, np.zeros(6)
    )
    W = slope.full() / np.array(model.signals["pose"].scale)[:, None]
    ratios, clipped = [], []
    for beyond in rng.uniform(low - high, 2 * high, size=(200, 6)):
        exact = lsq_linear(W * high, W @ beyond, (low / high, 1.0)).x * high
        off = np.linalg.norm(W @ (exact - beyond))
        found = controller.kernels.nearest(beyond).full().ravel()
        assert np.all((found >= low) & (found <= high))
        ratios.append(np.linalg.norm(W @ (found - beyond)) / off)
        clipped.append(np.linalg.norm(W @ (np.clip(beyond, low, high) - beyond)) / off)
    assert max(ratios) < 1.005 and np.median(clipped) > 1.1
    step = controller.step(controller.rest(), np.array([0, 0, 0, 1e-5, 0, -2e-6]), settle=True)
    assert step.status == ControllerStatus.DISPLACEMENT
    inside = rng.uniform(0, 3e-5, 6)
    assert np.array_equal(controller.kernels.nearest(inside).full().ravel(), inside)


def test_a_lost_state_gets_the_safe_drive_until_one_starts_again_from_rest(controller):
    target = np.array([0, 0, 0, 0, 0, 2e-5])
    x, z = controller.rest()
    for bad in (np.nan, np.inf, -1e4, 1e4):
        lost = x.copy()
        lost[3] = bad
        step = controller.step((lost, z), target)
        assert step.status == ControllerStatus.LOST and np.all(step.drive == controller.kernels.safe_drive)
        for again in (controller.step(step.state, target), controller.step(step.state, target, settle=True)):
            assert again.status == ControllerStatus.LOST
    assert controller.step(controller.rest(), target, settle=True).status == 0
    edge = np.max(controller.kernels.nominal.x_bounds[1])
    # Every state within its limits is one
    assert not controller.is_lost(np.full(6, edge), controller.kernels.nominal.z_bounds[1])


def test_a_state_is_lost_where_one_of_its_numbers_is_beyond_four_times_its_range(controller):
    hottest, farthest = (
        bound[1][0] for bound in (controller.kernels.nominal.x_bounds, controller.kernels.nominal.z_bounds)
    )
    for x, z, lost in ((3.99, 3.99, False), (4.01, 0.0, True), (0.0, 4.01, True)):
        assert controller.is_lost(np.full(6, x * hottest), np.full(6, z * farthest)) == lost
    one = np.zeros(6)
    one[2] = 3.99 * farthest
    assert not controller.is_lost(np.zeros(6), one) and controller.is_lost(np.zeros(6), 1.01 * one)


def test_limits_that_the_stroke_implies_are_not_computed_online(controller):
    assert [limit.name for limit in controller.kernels.guarded_limits] == ["wire_stress"]


def test_a_saturated_sample_is_made_up_for_as_soon_as_the_limits_allow(model, controller):
    """A jump asks for more power than there is; the state the controller keeps is the device's, so it arrives."""
    start, goal = np.array([0, 0, 0, 0, 0, 5e-6]), np.array([0, 0, 0, 0, 0, 3e-5])
    step = controller.step(controller.rest(), start, settle=True)
    x_0, state, drives, statuses = step.state[0], step.state, [], []
    for _ in range(10):
        step = controller.step(state, goal)
        state = step.state
        drives.append(step.drive)
        statuses.append(step.status)
    assert statuses[0] & ControllerStatus.DRIVE and statuses[-1] == 0
    reached = simulate(model, np.array(drives), H, x_0).signals["pose"][-1]
    assert np.abs(reached - goal)[3:].max() < 0.01 * NM


def test_the_inverse_is_wrong_when_the_model_behind_it_is(model):
    """The round trip can fail: invert a model that is 1 % stiffer than the plant."""
    table = tomllib.loads(DEVICE.read_text())
    table["stage"]["half_stage_stiffness"]["value"] = "0.05209277 N/um"
    other = controller_of(build_model(validate(Device.library["mems_hexapod"], table, "stiffer")), "pose", H)
    pose = np.array([0, 0, 0, 0, 0, 2e-5])
    drive = other.step(other.rest(), pose, settle=True).drive
    reached = simulate(model, np.tile(drive, (200, 1)), H).signals["pose"][-1]
    assert abs(reached[5] - pose[5]) > 5 * NM


def test_equations_that_hang_together_are_solved_together(model):
    """A drive that also pushes directly, quadratically: temperature and drive need Newton on one block."""
    direct = replace(model, balance=model.balance + 1e-3 * model.u**2)
    controller = controller_of(direct, "pose", H)
    pose = np.array([0, 0, 0, 2e-6, 1e-6, 2e-5])
    step = controller.step(controller.rest(), pose, settle=True)
    reached = simulate(direct, np.tile(step.drive, (300, 1)), H).signals["pose"][-1]
    assert np.abs(reached - pose)[3:].max() < 0.01 * NM

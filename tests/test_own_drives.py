"""What one sample reaches in closed form is what a search finds, and stresses in fewer coordinates are the same stresses."""

from __future__ import annotations

import shutil

import casadi as ca
import numpy as np
import pytest
from conftest import SCENARIOS
from reset_storm import compiled
from scipy.optimize import brentq

from ctrlgen import ControllerStatus, build_model, load_scenario
from ctrlgen.controller.few_coordinates import few_coordinates
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.controller.own_drives import has_own_drives
from ctrlgen.firmware.c.real import Real
from ctrlgen.numerics.proven_polynomial import proven_inverse

V = ca.SX.sym("v")


@pytest.fixture(scope="module")
def controller():
    scenario = load_scenario(SCENARIOS / "circle20")
    return controller_of(build_model(scenario.device), "pose", scenario.sample_time)


def test_one_sample_goes_as_far_toward_a_target_as_bisection_finds(controller, rng):
    kernels = controller.kernels
    m, k = kernels.nominal, kernels.moving
    low, high = m.z_bounds
    assert kernels.own_drives
    pose = ca.Function("pose", [m.z], [m.signals["pose"].expr])
    state, limited = controller.rest(), 0
    for _ in range(60):
        share = rng.uniform(0.02, 0.98, 6)
        wanted = low + (high - low) * share
        wanted /= max(1.0, 1.001 * float(kernels.composite_ratio(m.rest, 0 * wanted, wanted)))
        x, z = state
        step = controller.step(state, pose(wanted).full().ravel())

        def beyond(fraction, x=x, z=z, wanted=wanted):
            d = z + fraction * (wanted - z)
            u = controller.drive(k, (x, z), d, k.state(x, z, d).full().ravel())
            return float(np.max(np.maximum(m.u_bounds[0] - u, u - m.u_bounds[1])))

        if beyond(1.0) > 1e-6:
            limited += 1
            farthest = brentq(beyond, 1e-3, 1.0, xtol=1e-13)  # at rest drives are at their limit
            gone = (step.displacement - z) / (wanted - z)
            assert ControllerStatus.DRIVE in step.status
            assert np.ptp(gone) < 1e-7 and farthest * (1 - 2**-13) < gone[0] <= farthest
            assert np.all((step.drive >= m.u_bounds[0]) & (step.drive <= m.u_bounds[1]))
        state = step.state
    assert limited > 30


@pytest.mark.parametrize("real", list(Real))
def test_an_axis_that_rests_but_for_rounding_holds_no_other(real, controller, tmp_path):
    """Whatever is left of heat: with one axis at home the others go as far as from rest, in C as in Python."""
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: the C was not tried")
    c, m = compiled(tmp_path)[real], controller.kernels.nominal
    pose = ca.Function("pose", [m.z], [m.signals["pose"].expr])
    wanted = np.array([0, 8e-6, 12e-6, 30e-6, 12e-6, 30e-6])
    target, moved = pose(wanted).full().ravel(), np.arange(6) > 0
    for left in (0.0, *(10.0**-k for k in range(18, 8, -1))):  # W for a sample
        x, z = controller.rest()
        x = controller.kernels.moving.advance(x, z, np.full(6, left)).full().ravel()
        z = controller.kernels.static.settle(x, z, np.zeros(6)).full().ravel()
        step = controller.step((x, z), target)
        c.c_init(c.at)
        c.elapsed(1, np.full(6, left))
        assert ControllerStatus.DRIVE in step.status and c.step(target) == step.status
        gone = np.array([step.displacement, c.out.displacement])[:, moved] / wanted[moved]
        assert gone.min() > 0.8793 and gone.max() < 0.8794, left


@pytest.mark.parametrize("start", [1.0, 0.2])
def test_a_target_that_is_held_is_reached_and_home_too(controller, start):
    m = controller.kernels.nominal
    pose = ca.Function("pose", [m.z], [m.signals["pose"].expr])
    state = controller.rest()
    for wanted in (start * np.array([20e-6, 30e-6, 20e-6, 30e-6, 20e-6, 30e-6]), np.zeros(6)):
        for _ in range(160):
            step = controller.step(state, pose(wanted).full().ravel())
            state = step.state
        assert np.abs(step.displacement - wanted).max() < 1e-15 + 1e-9 * 55e-6


def test_drives_are_their_own_only_where_each_is_monotonic_in_one_displacement(controller):
    kernels = controller.kernels
    assert has_own_drives(kernels.nominal, kernels.static) and has_own_drives(kernels.nominal, kernels.moving)
    coupled = load_scenario(SCENARIOS / "lever_circle")
    other = controller_of(build_model(coupled.device), coupled.file.follow, coupled.sample_time).kernels
    assert not other.own_drives


@pytest.mark.parametrize("expression", [V + V**3 / 3, 3 - V - V**3])
def test_an_inverse_is_off_by_less_than_is_proved(expression):
    f = ca.Function("f", [V], [expression])
    inverse = proven_inverse(f, 0.0, 1.0, 1e-6)
    assert inverse is not None and 0 < inverse.off <= 1e-6
    error = ca.Function("e", [V], [inverse.of(f(V)) - V])
    errors = np.array([float(error(v)) for v in np.linspace(0, 1, 801)])
    assert 0.2 * inverse.off < np.abs(errors).max() <= inverse.off + 1e-15
    assert max(abs(errors[0]), abs(errors[-1])) < 1e-13


def test_what_turns_has_no_inverse():
    assert proven_inverse(ca.Function("f", [V], [(V - 0.5) ** 2]), 0.0, 1.0, 1e-6) is None


def test_the_displacements_that_heaters_lead_to_are_off_by_what_their_slack_allows(controller):
    kernels = controller.kernels
    reach = kernels.quick_reach(kernels.slacks(4e-6)[2] / 2)
    assert reach is not None and reach.off < 5e-7 * 55e-6
    assert kernels.quick_reach(1e-3 * kernels.slacks(4e-6)[2]) is None
    z = np.linspace(0.0, 1.0, 301)[:, None] * kernels.nominal.z_bounds[1]
    states = [kernels.static.state(kernels.nominal.rest, np.zeros(6), each).full().ravel() for each in z]
    found = np.array([reach.displacement(x).full().ravel() for x in states])
    assert np.abs(found - z).max() <= reach.off * 1.01 + 1e-17
    assert np.array_equal(reach.displacement(states[-1] + 50).full().ravel(), found[-1])


def test_stresses_in_fewer_coordinates_are_the_same(controller, rng):
    kernels, m = controller.kernels, controller.kernels.nominal
    few = kernels.few_shares
    assert few is not None and few.function.size1_in(0) == 4  # no translation in the plane of the stages strains a wire
    squares = [(limit.expr / limit.upper) ** 2 for limit in kernels.guarded_limits]
    share = ca.Function("share", [m.x, m.z], [ca.vertcat(*squares)])
    for z in rng.uniform(*m.z_bounds, (50, 6)):
        expected = share(m.rest, z).full().ravel()
        assert few.function(few.coordinates(z)).full().ravel() == pytest.approx(expected, rel=1e-9)


def test_what_depends_on_every_displacement_has_no_fewer_coordinates():
    x, z, wanted = ca.SX.sym("x", 2), ca.SX.sym("z", 3), ca.SX.sym("wanted", 3)

    def found(f):
        arguments = [x, z, wanted], [f], ["x", "z", "wanted"], ["f"]
        return few_coordinates(ca.Function("f", *arguments), np.zeros(3), np.ones(3))

    assert found(ca.vertcat(wanted[0] ** 2, wanted[1] * wanted[2])) is None
    assert found((wanted[0] - wanted[1]) ** 2 + x[0]) is None
    few = found((wanted[0] - wanted[1] + 2 * wanted[2]) ** 2)
    assert few is not None and few.function.size1_in(0) == 1

"""Polynomials in place of roots and quotients: their error is below what is proved, and what they promise of their ends holds."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen import build_model, load_scenario
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.controller.quick_state import SHARE
from ctrlgen.numerics import proven_polynomial as module
from ctrlgen.numerics.proven_polynomial import proven_inverse, proven_polynomial
from ctrlgen.numerics.taylor_intervals import taylor_intervals

V = ca.SX.sym("v")
SMOOTH = {
    "root": ca.sqrt(V + 2),
    "quotient": 1 / (V + 3) + V,
    "exponential": ca.exp(V / 2),
    "larger": ca.sqrt(ca.fmax(4 - V, 0)),
    "square": (V + 2) ** 2,
}


@pytest.mark.parametrize("name", SMOOTH)
def test_taylor_coefficients_over_a_cell_enclose_those_at_every_point_of_it(name):
    f, order, radius = ca.Function("f", [V], [SMOOTH[name]]), 5, 0.1
    over = taylor_intervals(f, np.array([0.2]), np.array([0.4]), radius, order)
    derivative, factorial = SMOOTH[name], 1.0
    for k in range(order + 1):
        at = ca.Function("d", [V], [derivative])
        values = np.array([float(at(v)) for v in np.linspace(0.2, 0.4, 41)]) * radius**k / factorial
        assert over.low[k, 0] <= values.min() + 1e-15 and values.max() <= over.high[k, 0] + 1e-15, k
        derivative, factorial = ca.gradient(derivative, V), factorial * (k + 1)


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("low", [0.0, -0.7])
def test_a_polynomial_is_off_by_less_than_is_proved_and_exact_at_the_ends(name, low):
    f = ca.Function("f", [V], [SMOOTH[name]])
    polynomial = proven_polynomial(f, low, 1.0, 1e-6)
    assert polynomial is not None and polynomial.off <= 1e-6 * (1 - low)
    p, slope = ca.Function("p", [V], [polynomial.of(V)]), ca.Function("s", [V], [ca.gradient(SMOOTH[name], V)])
    points = np.linspace(low, 1.0, 2001)
    error = np.array([float(p(v) - f(v)) for v in points])
    steepness = min(abs(float(slope(v))) for v in points)
    assert np.abs(error).max() <= polynomial.off * steepness * (1 + 1e-6) + 1e-14  # roundings of numbers of about ten
    assert max(abs(error[0]), abs(error[-1])) < 1e-13
    assert np.abs(error).max() > 0.2 * polynomial.off * steepness or name == "square"  # the bound is no idle one


def test_an_inverse_is_enclosed_only_at_degrees_that_no_point_refutes_and_is_the_same(monkeypatch):
    f, enclosed = ca.Function("f", [V], [ca.exp(V / 2)]), []
    monkeypatch.setattr(
        module, "taylor_intervals", lambda *given: enclosed.append(given[-1]) or taylor_intervals(*given)
    )
    inverse = proven_inverse(f, 0.0, 1.0, 1e-7)
    few = len(enclosed)
    monkeypatch.setattr(module, "REFUTED", np.inf)
    every = proven_inverse(f, 0.0, 1.0, 1e-7)
    assert inverse is not None and every is not None and inverse.off == every.off <= 1e-7
    assert np.array_equal(inverse.coefficients, every.coefficients)
    assert few <= 6 < len(enclosed) - few  # two for f, two a degree
    points, q = np.linspace(0, 1, 501), ca.Function("q", [V], [inverse.of(V)])
    assert max(abs(float(q(f(v)) - v)) for v in points) <= inverse.off


def test_what_turns_or_has_a_corner_has_no_polynomial():
    for expression in (V**2, ca.sqrt(V), ca.fmax(V, 0.5), ca.floor(V), ca.sqrt(ca.sqrt(V + 1e-9))):
        assert proven_polynomial(ca.Function("f", [V], [expression]), 0.0, 1.0, 1e-6) is None


def test_the_hexapods_temperatures_are_off_by_less_than_six_picometres_and_rise_with_the_displacement():
    scenario = load_scenario(SCENARIOS / "circle20")
    kernels = controller_of(build_model(scenario.device), "pose", scenario.sample_time).kernels
    z = np.linspace(0.0, 1.0, 501)[:, None] * kernels.nominal.z_bounds[1]
    x, none = kernels.nominal.rest, np.zeros(6)
    assert kernels.quick is not None and kernels.quick.off <= SHARE * 55e-6
    quick, exact = (
        np.array([state(x, none, each).full().ravel() for each in z])
        for state in (kernels.quick.state, kernels.static.state)
    )
    slope = np.diff(exact, axis=0).min() / (z[1, 0] - z[0, 0])
    assert np.all(np.abs(quick - exact) <= kernels.quick.off * slope * 1.01 + 1e-12)
    assert np.all(np.diff(quick, axis=0) > 0) and np.all(quick[0] >= x - 1e-12)

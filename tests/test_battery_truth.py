"""True shares of dominant causes: energies of exact models whose stated numbers are refitted as far as their file lets them."""

from __future__ import annotations

import numpy as np
import pytest

from battery import truth


def test_shares_of_causes_that_have_nothing_in_common_are_their_energies():
    t = np.arange(4000) / 4000
    waves = [a * np.sin(2 * np.pi * f * t)[:, None] for a, f in ((300.0, 5), (200.0, 9), (30.0, 17))]
    column = 1e3 * np.cos(2 * np.pi * 3 * t)[:, None]

    def model(present, x, record):
        return sum((waves[k] for k in present), x[0] * column)

    observed = sum(waves) + 0.02 * column + 50
    stated = truth.Stated(np.array([0.01]), np.array([0.02]))
    for zeros, rest in ((True, 450), (False, 450 + 2500)):
        found = truth.attribute((observed, observed), model, column, stated, 2, zeros)
        assert found.shares == pytest.approx(np.array([45000, 20000]) / (65000 + rest), rel=1e-3)
        assert found.error == pytest.approx(np.sqrt(rest), rel=1e-3)
        assert found.before == pytest.approx(np.sqrt(65000 + rest), rel=1e-3)


def test_numbers_that_the_file_states_do_not_bend_to_take_a_cause():
    """A number stated to 0.3 % that could take four fifths of the error by moving a hundred deviations; free, it would."""
    t = np.arange(200) / 200
    column, rest = 1e4 * np.sin(2 * np.pi * 3 * t)[:, None], 1.5e3 * np.cos(2 * np.pi * 3 * t)[:, None]
    cause = 0.3 * column + rest

    def model(present, x, record):
        return cause * (0 in present) + x[0] * column

    stated = truth.Stated(np.array([0.005]), np.array([0.003]))
    found = truth.attribute((cause, cause), model, column, stated, 1, False)
    assert found.before == pytest.approx(np.sqrt(np.mean(cause**2)), rel=0.03)
    assert found.error < 1 and found.shares[0] > 0.9999
    free = truth.Stated(np.array([0.005]), np.array([1e3]))
    assert truth.attribute((cause, cause), model, column, free, 1, False).before < 0.5 * found.before


def test_a_refit_ends_at_the_optimum_where_numbers_act_by_their_ratio_alone():
    """Force over stiffness, with sensitivities by difference quotients as `size.sensitivities` has them: both alike change nothing but
    what these err by, and a law that is missing must not send the numbers there."""
    t = np.arange(2000) / 2000
    a, b, missing = (np.sin(2 * np.pi * f * t)[:, None] for f in (3, 7, 11))

    def model(x):
        ratio = (1 + x[0]) / (1 + x[1])
        return 100 * (ratio * a + ratio**3 * b)

    steps = 1e-4 * np.eye(2)
    columns = np.column_stack([((model(s) - model(-s)) / 2e-4).ravel() for s in steps])
    observed = model(np.array([0.1, 0.0])) + 30 * missing
    x = truth.refit(observed, model, columns, truth.Stated(np.zeros(2), np.full(2, 0.5)))
    assert (1 + x[0]) / (1 + x[1]) == pytest.approx(1.1, abs=2e-3)
    assert np.abs(x).max() < 0.2


def test_a_share_is_the_mean_over_orders():
    energy = {frozenset(): 10.0, frozenset({0}): 4.0, frozenset({1}): 7.0, frozenset({0, 1}): 2.0}
    assert truth.shapley(energy, 0, 2) == pytest.approx((6 + 5) / 2)
    assert truth.shapley(energy, 0, 2) + truth.shapley(energy, 1, 2) == pytest.approx(8.0)


def test_parts_of_channels_are_those_of_the_whole():
    """Two channels, one twice as loud; the second cause acts in the second alone."""
    t = np.arange(400)[:, None]
    wave, other = np.sin(t) * np.array([1.0, 2.0]), np.cos(1.7 * t) * np.array([0.0, 3.0])

    def model(present, x, record):
        return sum(((wave, other)[k] for k in present), np.zeros_like(wave))

    nothing = truth.Stated(np.zeros(0), np.zeros(0))
    found = truth.attribute((wave + other,) * 2, model, np.zeros((800, 0)), nothing, 2, False)
    assert found.parts[0] == pytest.approx([0.5 / 7, 2 / 7], rel=0.02) and found.parts[1] == pytest.approx(
        [0, 4.5 / 7], rel=0.02
    )
    assert found.before_parts == pytest.approx([0.5 / 7, 6.5 / 7], rel=0.02) and sum(
        found.before_parts
    ) == pytest.approx(1)
    assert found.shares == pytest.approx(np.sum(found.parts, axis=1))

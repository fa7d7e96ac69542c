"""Noise and discrepancy: correlation time, robust loss, what weighs a residual, and the squares that candidates are compared by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import record
from misfits import noise_of
from scipy.integrate import quad
from scipy.signal import lfilter
from scipy.stats import norm

from ctrlgen.estimation.error_model import ErrorModel, correlation_time, error_model, huber, huber_curvature
from ctrlgen.estimation.misfit import misfit

CORNER = np.array([3.0])


def red(a: float, n: int, seed: int = 1) -> np.ndarray:
    """Autoregressive noise of first order, deviation one."""
    e = np.random.default_rng(seed).standard_normal(n + 500)
    return (np.sqrt(1 - a**2) * lfilter([1.0], [1.0, -a], e))[500:]


@pytest.mark.parametrize("a", [0.5, 0.8, 0.95])
def test_the_correlation_time_is_that_of_the_closed_form(a):
    """rho_k = a^k, summed to where it is below a twentieth; (1 + a)/(1 - a) but for that tail."""
    k = np.arange(1, 1000)
    kept = a**k
    tau = 1 + 2 * np.sum(kept[kept >= 0.05])
    assert correlation_time([red(a, 400_000)]) == pytest.approx(tau, rel=0.05)
    assert 0.9 * (1 + a) / (1 - a) < tau <= (1 + a) / (1 - a)


def test_an_offset_has_no_correlation_time_and_white_noise_one_sample():
    e = red(0.0, 100_000)
    assert correlation_time([e]) == pytest.approx(1.0, abs=0.05) == correlation_time([e + 100.0])
    assert correlation_time([np.zeros(50)]) == 1.0 == correlation_time([]) == correlation_time([np.ones(1)])


def test_a_correlation_time_is_at_most_a_thirtieth_of_all_samples():
    drift = np.linspace(-1, 1, 600)
    assert correlation_time([drift]) == pytest.approx(600 / 30) and correlation_time([drift, drift]) == 1200 / 30


def test_stretches_are_correlated_within_each():
    """Two stretches whose ends do not fit; lags beyond the shorter one come of the longer."""
    both = correlation_time([red(0.8, 200_000, 2), red(0.8, 100_000, 3)])
    assert both == pytest.approx(correlation_time([red(0.8, 300_000, 4)]), rel=0.05)


@pytest.mark.parametrize("r, loss", [(0.0, 0.0), (2.0, 4.0), (-3.0, 9.0), (5.0, 21.0), (-10.0, 51.0)])
def test_hubers_loss_is_square_up_to_the_corner_and_linear_beyond(r, loss):
    value, slope = huber(np.array([[r]]), CORNER)
    assert value[0, 0] ** 2 == pytest.approx(loss) and np.sign(value[0, 0]) == np.sign(r)
    step = 1e-6
    ends = [huber(np.array([[r + side]]), CORNER)[0][0, 0] for side in (-step, step)]
    if abs(r) != 3.0:  # at the corner the slope of the root changes
        assert slope[0, 0] == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-6)


@pytest.mark.parametrize("r", [1.0, 4.0, -50.0])
def test_the_parabola_of_a_step_touches_the_loss_and_lies_above_it(r):
    """With the loss' own slope at r, and its minimum at zero: no sample is thrown to the other side."""
    white = np.array([[r]])
    (value, slope), more = huber(white, CORNER), huber_curvature(white, CORNER)
    gradient, curvature = float((value * slope)[0, 0]), float((more * slope**2)[0, 0])
    assert r - gradient / curvature == pytest.approx(0.0, abs=1e-12)
    x = np.linspace(-60, 60, 241)
    parabola = value[0, 0] ** 2 + 2 * gradient * (x - r) + curvature * (x - r) ** 2
    assert np.all(parabola >= huber(x[:, None], CORNER)[0][:, 0] ** 2 - 1e-9)


def test_without_discrepancy_errors_are_the_noise_exactly():
    """Also of coloured noise, with gaps."""
    rng = np.random.default_rng(3)
    noise = replace(noise_of(2), sd=np.array([0.5, 2.0]), ar=(np.array([0.4, -0.1]), np.zeros(0)))
    values, valid = rng.standard_normal((300, 2)), rng.random((300, 2)) > 0.05
    errors = ErrorModel.of_noise(noise)
    assert errors.is_noise and errors.corner == pytest.approx([3.0, 3.0])
    assert np.array_equal(errors.whiten(values, valid), noise.whiten(values, valid))
    assert np.array_equal(errors.whiten_channel(values[:, 0], 0), noise.whiten_channel(values[:, 0], 0))
    assert np.array_equal(errors.usable(valid), noise.usable(valid))
    assert np.array_equal(errors.effective(valid), noise.usable(valid).sum(axis=0))
    residual = np.column_stack([red(0.0, 5000), red(0.0, 5000, 2)])
    given = record(np.zeros(5000), np.zeros((5000, 2)), "fit")
    assert error_model(noise_of(2), [given], [residual]).is_noise


def test_a_channel_with_discrepancy_counts_its_independent_samples_and_is_not_whitened():
    """The other one keeps its noise."""
    n = 20_000
    residual = np.column_stack([10 * red(0.8, n), red(0.0, n)])
    noise = replace(noise_of(2), ar=(np.array([0.5]), np.zeros(0)))
    given = record(np.zeros(n), np.zeros((n, 2)), "fit")
    errors = error_model(noise, [given], [residual])
    assert errors.rms == pytest.approx([np.sqrt(np.mean(residual[:, 0] ** 2)), 0.0]) and errors.tau[1] == 1.0
    assert errors.tau[0] == pytest.approx(correlation_time([residual[:, 0]])) and errors.tau[0] > 7
    assert not errors.is_noise and [len(a) for a in errors.ar] == [0, 0]
    white = errors.whiten(residual, given.valid)
    assert white[:, 0] == pytest.approx(residual[:, 0] / (errors.rms[0] * np.sqrt(errors.tau[0])))
    assert np.sum(white[:, 0] ** 2) == pytest.approx(n / errors.tau[0]) == errors.effective(given.valid)[0]
    assert errors.corner == pytest.approx([3 / np.sqrt(errors.tau[0]), 3.0])


@pytest.mark.parametrize("count", [np.inf, 200.0])
@pytest.mark.parametrize("side, discrepant", [(-1e-3, False), (1e-3, True)])
def test_more_than_noise_is_a_tenth_more_and_what_the_noise_is_unsure_of(count, side, discrepant):
    n = 5000
    limit = 1.1 * (1 + 2.6 / np.sqrt(2 * count))
    e = red(0.0, n)
    e *= (limit + side) / np.sqrt(np.mean(e**2))
    found = error_model(noise_of(count=count), [record(np.zeros(n), np.zeros(n), "fit")], [e[:, None]])
    assert found.is_noise != discrepant
    unknown = error_model(noise_of(known=False), [record(np.zeros(n), np.zeros(n), "fit")], [100 * e[:, None]])
    assert unknown.is_noise  # only the misfit tells that noise


def test_slow_physics_beside_slow_noise_is_discrepancy():
    """Whitening by its colour takes the physics away too; its size tells."""
    n, a = 20_000, 0.95
    noise = replace(noise_of(), sd=np.array([np.sqrt(1 - a**2)]), ar=(np.array([a]),))
    given = record(np.zeros(n), np.zeros(n), "fit")
    slow = 2 * np.sin(2 * np.pi * 1e-3 * np.arange(n))
    assert error_model(noise, [given], [red(a, n)[:, None]]).is_noise
    assert not error_model(noise, [given], [(red(a, n) + slow)[:, None]]).is_noise


def test_the_squares_of_a_misfit_are_sums_over_twenty_blocks():
    n, rng = 1000, np.random.default_rng(1)
    e = rng.uniform(-2, 2, (n, 2))
    valid = np.ones((n, 2), bool)
    valid[:100] = False  # a lead-in is no block
    valid[500:520, 1] = False
    given = replace(record(np.zeros(n), np.zeros((n, 2)), "fit"), valid=valid)
    found = misfit(replace(noise_of(2), sd=np.array([1.0, 0.5])), [given], [e])
    assert found.plain.shape == found.white.shape == found.n_plain.shape == (20, 2)
    blocks = e[100:].reshape(20, 45, 2) * np.array([1.0, 2.0])
    inside = valid[100:].reshape(20, 45, 2)
    assert found.plain == pytest.approx(np.sum(np.where(inside, blocks**2, 0.0), axis=1))
    assert np.array_equal(found.n_plain, inside.sum(axis=1)) and np.array_equal(found.n_white, found.n_plain)
    assert found.plain_mean == pytest.approx(found.plain.sum(axis=0) / [900, 880])
    assert found.excess == pytest.approx(found.plain[:, 1].sum() - 880 + found.plain[:, 0].sum() - 900)


def test_the_loss_of_normal_noise_has_mean_one_and_a_spike_pulls_no_further():
    n = 400_000
    e = red(0.0, n)[:, None]
    given = record(np.zeros(n), np.zeros(n), "fit")
    clean = misfit(noise_of(), [given], [e])
    assert clean.white_mean[0] == pytest.approx(1.0, abs=0.01)
    mean = quad(lambda r: (r * r if abs(r) <= 3 else 6 * abs(r) - 9) * norm.pdf(r), -12, 12, points=[-3, 3])[0]
    even = misfit(noise_of(), [given], [np.ones((n, 1))])
    assert even.white_mean[0] == pytest.approx(1 / mean, rel=1e-9) and abs(mean - 1) > 1e-4
    e[77] = 1e6
    struck = misfit(noise_of(), [given], [e])
    assert struck.white_mean[0] == pytest.approx(clean.white_mean[0] + 6e6 / n, rel=1e-2)
    assert struck.plain_mean[0] > 1e6


def test_each_settled_pose_is_a_block_and_what_has_diverged_a_finite_number():
    given = record(np.zeros(4), np.zeros(4), "fit", h=np.inf)
    e = np.array([[1.0], [2.0], [np.nan], [np.inf]])
    found = misfit(noise_of(), [given], [e])
    assert found.plain[:2, 0] == pytest.approx([1.0, 4.0]) and found.plain.shape == (4, 1)
    assert np.isfinite(found.plain).all() and np.isfinite(found.white).all() and found.excess > 1e29
    assert misfit(noise_of(), [], []).plain.shape == (0, 1)

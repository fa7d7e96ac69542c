"""Samples of one channel that must not count, and motion that must."""

from __future__ import annotations

import numpy as np
import pytest

from ctrlgen.recordings.outliers import outliers, stuck_samples


@pytest.mark.parametrize("at", [1, 2, 3, 100, -4, -3, -2])
def test_a_spike_beside_the_end_of_a_record_is_one_too(at, rng):
    n = 400
    t = np.arange(n)
    y = np.sin(0.02 * t) + 1e-3 * rng.standard_normal(n)
    y[at] += 0.1
    assert np.array_equal(np.flatnonzero(outliers(y, np.cos(0.02 * t)[:, None])), [at % n])


@pytest.mark.parametrize("apart", [2, 3, 4, 5])
@pytest.mark.parametrize("sizes", [(0.1, 0.1), (0.1, -0.1), (0.1, 0.03)])
def test_two_spikes_close_together_are_two(apart, sizes, rng):
    t = np.arange(1000)
    y = np.sin(0.02 * t) + 1e-3 * rng.standard_normal(1000)
    y[[600, 600 + apart]] += sizes
    assert np.array_equal(np.flatnonzero(outliers(y, np.cos(0.02 * t)[:, None])), [600, 600 + apart])


@pytest.mark.parametrize("pole", [0.3, 0.9, 0.97 * np.exp(0.9j), 0.97 * np.exp(2.2j)])
def test_a_record_may_begin_in_motion(pole, rng):
    n = 400
    y = np.real(pole ** np.arange(n)) + 1e-4 * rng.standard_normal(n)
    assert not outliers(y, np.zeros((n, 1))).any()


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("shape", ["steps", "pulse", "ringing", "staircase"])
def test_motion_of_the_device_is_no_spike(shape, noise, rng):
    n = 4000
    u = np.repeat(rng.uniform(-1, 1, n // 200), 200)
    if shape == "pulse":
        u = (np.arange(n) % 400 < 2).astype(float)
    y = np.zeros(n)
    pole = {"steps": 0.3, "pulse": 0.3, "ringing": 0.97 * np.exp(0.9j), "staircase": 0.0}[shape]
    state = 0j
    for k in range(n):
        state = pole * state + (1 - pole) * u[k - (k > 0)]
        y[k] = state.real
    assert not outliers(y + noise * rng.standard_normal(n), u[:, None]).any()


def test_beside_a_jump_of_the_drive_nothing_is_an_outlier(rng):
    y = 1e-3 * rng.standard_normal(1000)
    y[500] += 0.1
    drive = (np.arange(1000) >= 495).astype(float)[:, None]
    assert not outliers(y, drive).any()
    assert np.flatnonzero(outliers(y, np.zeros((1000, 1)))).tolist() == [500]


def test_one_step_of_a_coarse_sensor_at_rest_is_no_outlier():
    y = np.zeros(100)
    y[[20, 50, 80]] = 1.0  # the noise is below the step and shows three times: its local deviation is zero
    assert not outliers(y, np.zeros((len(y), 1))).any()
    y[50] = 5.0
    assert np.flatnonzero(outliers(y, np.zeros((len(y), 1)))).tolist() == [50]


def test_rounding_is_no_outlier():
    y = np.repeat([0.0, 1.0, np.pi], 300)  # no common step, no noise
    y[450] += 1e-13
    assert not outliers(y, np.zeros((len(y), 1))).any()
    y[450] += 1e-3
    assert np.flatnonzero(outliers(y, np.zeros((len(y), 1)))).tolist() == [450]


def test_coloured_noise_has_no_spikes(rng):
    from scipy.signal import lfilter

    drive = np.sin(0.01 * np.arange(20_000))[:, None]
    for denominator in ([1.0], [1, -0.95], [1, -1.9, 0.9025]):
        assert not outliers(lfilter([1], denominator, rng.standard_normal(20_000)), drive).any()


def test_a_channel_that_runs_into_its_end_is_clipped(rng):
    t = np.arange(4000)
    drive = np.sin(0.3 * t)[:, None]  # too fast to stay in the end for the eight samples of a frozen channel
    reading = np.sin(0.3 * t) + 1e-3 * rng.standard_normal(4000)
    clipped = np.minimum(reading, 0.7)
    marked = stuck_samples(clipped, drive)
    assert np.array_equal(marked, reading >= 0.7)  # what stands there for a sample or two as well
    assert not stuck_samples(reading, drive).any()


def test_what_comes_to_the_end_slowly_is_clipped_as_what_ran_into_it_is(rng):
    """Near the turn of a slow drive it moves too little for a stretch of its own."""
    t = np.arange(4000)
    drive = np.sin(0.3 * t) * (t < 2000) + 0.72 * np.sin(2e-3 * t) * (t >= 2000)
    reading = drive + 1e-3 * rng.standard_normal(4000)
    marked = stuck_samples(np.clip(reading, -0.7, 0.7), drive[:, None])
    assert np.array_equal(marked, np.abs(reading) >= 0.7) and marked[2000:].sum() > 100


def test_a_coarse_sensor_at_rest_is_not_stuck():
    drive = np.clip(np.sin(0.01 * np.arange(4000)), -0.5, 0.5)
    reading = np.round(drive * 200 + 0.1 * np.random.default_rng(0).standard_normal(4000))
    assert not stuck_samples(reading, drive[:, None]).any()


@pytest.mark.parametrize("every", [2, 4])
def test_a_channel_read_at_some_rows_alone_is_judged_by_its_readings(every, rng):
    """Between them it is known nowhere, and no reading is taken for an outlier of straight lines."""
    t = np.arange(400 * every)
    y = np.sin(0.02 * t / every) + 1e-3 * rng.standard_normal(len(t))
    y[t % every != 0] = np.nan
    drive = np.cos(0.02 * t / every)[:, None]
    assert not outliers(y, drive).any()
    y[200 * every] += 0.05
    assert np.array_equal(np.flatnonzero(outliers(y, drive)), [200 * every])
    drive[200 * every :] += 5.0  # where the drive jumps, the device may too
    assert not outliers(y, drive).any()

"""Peaks of a spectrum: where a sinusoid shows, what a line does to the level around it, which maxima count."""

from __future__ import annotations

import numpy as np
import pytest

from ctrlgen.numerics.spectral_peaks import highest_peaks, local_floor, periodogram


@pytest.mark.parametrize("cycles", [20.0, 20.37, 101.5])
def test_the_highest_bin_of_a_padded_periodogram_is_next_to_the_sinusoid(cycles):
    n, padding = 1000, 8
    y = np.sin(2 * np.pi * cycles * np.arange(n) / n + 0.3)
    (best,) = highest_peaks(periodogram(y, np.hanning(n), padding), 1, distance=4 * padding)
    assert abs(best / padding - cycles) <= 0.5 / padding  # the nearest bin: the window's main lobe has no other maximum


def test_an_unpadded_periodogram_keeps_the_energy(rng):
    y = rng.standard_normal((256, 3))
    power = periodogram(y)
    both_sides = power[0] + power[-1] + 2 * power[1:-1].sum(axis=0)
    assert both_sides == pytest.approx(256 * np.sum(y**2, axis=0), rel=1e-12)  # Parseval's theorem, rounding


def test_every_channel_is_windowed_alike(rng):
    y, window = rng.standard_normal((100, 2)), np.hanning(100)
    assert np.array_equal(periodogram(y, window, 4)[:, 1], periodogram(y[:, 1], window, 4))


def test_a_line_does_not_raise_the_level_around_it(rng):
    power = rng.exponential(size=400)
    line = power.copy()
    line[200] = 1e6
    # One rank of 31, not a millionth of the line
    assert np.all(np.abs(local_floor(line, 31) - local_floor(power, 31)) < 0.5)


def test_the_highest_peaks_come_first_and_apart():
    power = np.zeros(100)
    power[[10, 13, 50, 80]] = [5.0, 4.0, 9.0, 1.0]
    assert highest_peaks(power, 9, distance=1).tolist() == [50, 10, 13, 80]
    assert highest_peaks(power, 9, distance=5).tolist() == [50, 10, 80]  # 13 is beside the higher one at 10
    assert highest_peaks(power, 2, distance=5).tolist() == [50, 10]
    assert highest_peaks(power, 9, distance=5, height=2.0).tolist() == [50, 10]

"""What drives that are held over a sample leave of a smooth path, beside what a mass on a spring does, sample by sample."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from ctrlgen.controller.held_drives import PARTS, left_by_held_drives

SIZE = np.array([2.0, 3.0])  # of speed and displacement
POSITIONS, TOLD = np.array([1]), np.array([False, True])
B = np.array([1.0, 0.0])


def stage(rate: float, damping: float) -> np.ndarray:
    """A of y = (v, z)."""
    return np.array([[-2 * damping * rate, -(rate**2)], [1.0, 0.0]])


def held_for(A: np.ndarray, time: float) -> np.ndarray:
    """(3, 3) the step of (v, z, drive) under a drive that is held for `time`."""
    rows = np.zeros((3, 3))
    rows[:2, :2], rows[:2, 2] = A, B
    return expm(time * rows)


@pytest.mark.parametrize(("turn", "damping"), [(0.5, 0.05), (3.0, 0.1), (3.0, 0.8)])
def test_behind_a_drive_that_rises_steadily_it_is_what_a_mass_does(turn, damping):
    """Where the smooth path is straight, y = g t + q, A g = -B, A q = g, nothing is left out of the formula."""
    rate, h = 5.0, turn / 5.0
    A = stage(rate, damping)
    g = -np.linalg.solve(A, B)
    y = q = np.linalg.solve(A, g)
    whole = held_for(A, h)
    for k in range(1000):
        y = (whole @ np.append(y, (k + 0.5) * h))[:2]
    times = h * np.arange(PARTS + 1) / PARTS
    after = [(held_for(A, t) @ np.append(y, 1000.5 * h))[:2] for t in times]
    off = max(abs(a - g * (1000 * h + t) - q)[1] for a, t in zip(after, times, strict=True))
    left = left_by_held_drives(A, POSITIONS, TOLD, SIZE, h)
    assert left[1] * g[1] * h / SIZE[1] == pytest.approx(off / SIZE[1], rel=1e-6)


def test_a_free_mass_has_the_mean_of_the_path_over_a_sample():
    """Of z = R sin w t, by forces that are held, sinc(w h/2) R."""
    h, w = 0.1, 0.5
    missing = 1 - np.sinc(w * h / 2 / np.pi)
    changed = w**2 * h  # of the speed in a sample, at most
    left = left_by_held_drives(stage(0.0, 0.0), POSITIONS, TOLD, SIZE, h)
    assert left[0] * changed / SIZE[0] == pytest.approx(missing / SIZE[1], rel=1e-3)
    assert left[1] == 0

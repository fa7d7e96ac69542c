"""Where the steps of a fit end: bounds, dead numbers, wrong slopes, bent valleys."""

from __future__ import annotations

import numpy as np
import pytest

from ctrlgen.numerics.levenberg_marquardt import levenberg_marquardt


class Kinked:
    """Two numbers; the slope by the second, which promises much, is that of another place."""

    k, step_limit, bounds = 2, np.full(2, np.inf), (np.full(2, -1e3), np.full(2, 1e3))

    def residual(self, x: np.ndarray) -> np.ndarray:
        return np.array([x[0] - 7.0, 5.0 + abs(x[1])])

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.residual(x), np.array([[1.0, 0.0], [0.0, 1.0]])

    def normal_matrix(self, J: np.ndarray) -> np.ndarray:
        return J.T @ J


def test_a_number_that_lies_about_its_slope_does_not_hold_the_others():
    assert levenberg_marquardt(Kinked(), np.zeros(2), 40)[0] == pytest.approx(7.0)


class Still:
    """No number at all: what is left is left."""

    k, step_limit, bounds = 0, np.zeros(0), (np.zeros(0), np.zeros(0))

    def residual(self, x: np.ndarray) -> np.ndarray:
        return np.array([3.0])

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.residual(x), np.zeros((1, 0))

    def normal_matrix(self, J: np.ndarray) -> np.ndarray:
        return J.T @ J


@pytest.mark.parametrize("negligible", [0.0, 1e-6])
def test_without_a_number_there_is_no_step(negligible):
    assert levenberg_marquardt(Still(), np.zeros(0), 40, negligible=negligible).shape == (0,)


class Linear:
    """A x - b, with what each number may step at once."""

    def __init__(self, A, b, low, high, most=np.inf) -> None:
        self.A, self.b, self.bounds = np.array(A), np.array(b), (np.array(low), np.array(high))
        self.k = len(low)
        self.step_limit = np.broadcast_to(most, (self.k,))

    def residual(self, x: np.ndarray) -> np.ndarray:
        return self.A @ x - self.b

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.residual(x), self.A

    def normal_matrix(self, J: np.ndarray) -> np.ndarray:
        return J.T @ J


def test_a_number_that_nothing_holds_does_not_shorten_the_step_of_the_others():
    dead = Linear([[10.0, 0.0], [0.0, 1e-12]], [30.0, 1e-6], [-1e3, -1e9], [1e3, 1e9], (np.inf, 1.5))
    assert levenberg_marquardt(dead, np.zeros(2), 2)[0] == pytest.approx(3.0, rel=1e-4)


def test_a_number_that_meets_its_bound_stops_there_and_the_others_go_on():
    tight = Linear([[1.0, 1.0], [0.0, 0.1]], [2.0, 0.5], [0.0, -9.0], [9.0, 9.0])  # free: (-3, 5)
    assert levenberg_marquardt(tight, np.ones(2), 1) == pytest.approx([0.0, 2.05 / 1.01], rel=1e-4)


@pytest.mark.parametrize(("enough", "reached"), [(np.inf, 3.0), (2500.5, 3.0), (1.0, 0.0)])
def test_a_fit_ends_where_it_cannot_win(enough, reached):
    floor = Linear([[1.0], [0.0]], [3.0, 50.0], [-9.0], [9.0])  # at best 2500
    assert levenberg_marquardt(floor, np.zeros(1), 40, enough)[0] == pytest.approx(reached, abs=1e-4)


class Product:
    """A force constant and a gain, of which the readings know the product and the data sheet the first."""

    k, step_limit, bounds = 2, np.full(2, np.inf), (np.full(2, -9.0), np.full(2, 9.0))

    def residual(self, x: np.ndarray) -> np.ndarray:
        return np.array([3e4 * (x[0] * (1 + x[1]) - 1.2), (x[0] - 1) / 0.02])

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.residual(x), np.array([[3e4 * (1 + x[1]), 3e4 * x[0]], [50.0, 0.0]])

    def normal_matrix(self, J: np.ndarray) -> np.ndarray:
        return J.T @ J


def test_a_bent_valley_is_followed():
    """From where the force constant bears it all, at a hundred squares."""
    assert levenberg_marquardt(Product(), np.array([1.2, 0.0]), 20) == pytest.approx([1.0, 0.2], rel=0.02)

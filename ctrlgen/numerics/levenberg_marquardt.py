"""Damped least squares within bounds."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import scipy

NEGLIGIBLE = 0.01  # squared standard deviations: a step that promises less ends the search
GENEROUS = (
    4.0  # a step along a curved valley may bring several times what the quadratic model of its beginning promises
)
PROBE = 0.1  # share of a step from which the curvature along it is taken
FIRST_DAMPING = 1e-6
FAILING = 1e-2  # damping above which three steps in a row have failed: 1e-6, 1e-4, 3e-3
LEAST_DAMPING, MOST_DAMPING = 1e-9, 1e8
RELAX, STIFFEN, FIRST_STIFFENING = 10, 30, 1e-4  # damping after a good step, after a failed one, and at least then


class Problem(Protocol):
    """A residual (m,) as a function of variables x (n,) of order one.

    The first `k` variables are parameters, the others nuisance variables (initial states of records). `step_limit` (n,)
    bounds how far each may move in one step.
    """

    k: int
    step_limit: np.ndarray

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest x."""

    def residual(self, x: np.ndarray) -> np.ndarray:
        """The residual (m,), whose squares are summed."""

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The residual (m,) and its Jacobian (m, n)."""

    def normal_matrix(self, J: np.ndarray) -> np.ndarray:
        """What stands for half the Hessian (n, n) of the objective where `J`, one of the last two, was evaluated: J'J, or more of it."""


def levenberg_marquardt(
    problem: Problem, x: np.ndarray, steps: int, enough: float = np.inf, negligible: float = NEGLIGIBLE
) -> np.ndarray:
    """The x (n,) of least |residual|^2 within the bounds, from a starting `x`, in at most so many steps.

    Marquardt's damping (D. W. Marquardt, J. SIAM 11 (1963) 431). A step that does not lower the objective is tried again: first along the
    curved valley of the objective; then with the nuisance variables fixed, along which the residual may have a kink; then, when the
    damping has already grown, without the parameter that promises most, for the derivative by the moment of an event between two samples
    may be wrong. Without a variable there is no step. Ends when a step promises less than is `negligible`, and where all that are left,
    each with `GENEROUS` times what the next one promises, would not bring |residual|^2 down to what is `enough`.
    """
    if len(x) == 0:
        return x
    low, high = problem.bounds
    parameters = np.arange(len(x)) < problem.k
    x, damping = np.clip(x, low, high), FIRST_DAMPING
    r, J = problem.evaluate(x)
    gradient, H = J.T @ r, problem.normal_matrix(J)
    at_once = True  # whether the last step was good as it was
    for left in range(steps, 0, -1):
        least, most = np.maximum(low - x, -problem.step_limit), np.minimum(high - x, problem.step_limit)
        step = _damped_step(H, gradient, least, most, damping)
        promised = -(gradient @ step + 0.5 * step @ H @ step)
        if promised < negligible or (at_once and r @ r - left * GENEROUS * promised > enough):
            break
        # its derivatives are needed next where it is good, as it mostly is after a good one
        better = _if_better(problem, r, np.clip(x + step, low, high), with_slopes=at_once)
        at_once = better is not None
        if better is None and damping <= FAILING:
            better = _along_valley(problem, x, r, J, H, step, damping)
        if better is None and 0 < np.count_nonzero(step[parameters]) < np.count_nonzero(step):
            step = _damped_step(H, gradient, least, most, damping, parameters)
            better = _if_better(problem, r, np.clip(x + step, low, high))
        if better is None and damping > FAILING:
            others = parameters & (step != 0)
            others[np.argmax(np.where(others, np.abs(gradient * step), -1.0))] = False
            step = _damped_step(H, gradient, least, most, FIRST_DAMPING, others)
            better = _if_better(problem, r, np.clip(x + step, low, high))
        if better is not None:
            x, damping = better, max(damping / RELAX, LEAST_DAMPING)
            r, J = problem.evaluate(x)
            gradient, H = J.T @ r, problem.normal_matrix(J)
        else:
            damping = max(damping * STIFFEN, FIRST_STIFFENING)
            if damping > MOST_DAMPING:
                break
    return x


def _damped_step(
    H: np.ndarray,
    gradient: np.ndarray,
    least: np.ndarray,
    most: np.ndarray,
    damping: float,
    movable: np.ndarray | bool = True,
) -> np.ndarray:
    """Marquardt's step (n,) of the `movable` variables, the best within the box from `least` to `most`.

    A bounded least-squares problem, so that a variable that the residual does not depend on, or that meets its bound, does
    not shorten the step of the others.
    """
    step = np.zeros_like(gradient)
    free = (np.diag(H) > 0) & (least < most) & movable
    if free.any():
        scale = np.sqrt(np.diag(H)[free])  # the conditioning does not depend on units
        w, V = np.linalg.eigh(H[np.ix_(free, free)] / np.outer(scale, scale))
        root = np.sqrt(np.maximum(w, 0.0) + damping)
        A, b = root[:, None] * V.T, -(V.T @ (gradient[free] / scale)) / root
        step[free] = scipy.optimize.lsq_linear(A, b, (least[free] * scale, most[free] * scale), method="bvls").x / scale
    return step


def _along_valley(
    problem: Problem, x: np.ndarray, r: np.ndarray, J: np.ndarray, H: np.ndarray, step: np.ndarray, damping: float
) -> np.ndarray | None:
    """x + t step + t^2 bend for t = 1 or 1/3, the first that lowers |r|^2; None where neither does.

    The bend takes back half the second derivative of the residual along the step, found by a finite difference (geodesic
    acceleration, M. K. Transtrum, J. P. Sethna, arXiv:1201.5885).
    """
    low, high = problem.bounds
    curvature = ((problem.residual(np.clip(x + PROBE * step, low, high)) - r) / PROBE - J @ step) / PROBE
    if not np.isfinite(curvature).all():
        return None
    bend = _damped_step(H, J.T @ curvature, low - x, high - x, damping)
    tried = (_if_better(problem, r, np.clip(x + t * step + t**2 * bend, low, high)) for t in (1.0, 1 / 3))
    return next((better for better in tried if better is not None), None)


def _if_better(problem: Problem, r: np.ndarray, x: np.ndarray, with_slopes: bool = False) -> np.ndarray | None:
    """x where its residual is smaller than `r`, else None; `with_slopes` it is evaluated with its Jacobian, which the problem keeps."""
    residual = problem.evaluate(x)[0] if with_slopes else problem.residual(x)
    return x if residual @ residual < r @ r else None

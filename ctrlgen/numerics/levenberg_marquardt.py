"""Damped least squares within bounds."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.optimize import lsq_linear

NEGLIGIBLE = 0.01  # of one squared standard deviation
PART = 0.1  # of a step, from which its curvature is taken
BEGIN, FAILED = 1e-6, 1e-2  # Marquardt's damping at first, and where a step has failed twice


class Problem(Protocol):
    """Numbers x of order one, of which the first `k` are the structure's own and the others the records' starts; each may
    step by its `most` at once."""

    k: int
    most: np.ndarray

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest x."""

    def residual(self, x: np.ndarray) -> np.ndarray:
        """What is squared and summed."""

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same with its slopes by x."""


def levenberg_marquardt(problem: Problem, x: np.ndarray, steps: int) -> np.ndarray:
    """The minimum of |residual|^2 within bounds (D. W. Marquardt, J. SIAM 11 (1963) 431).

    A step that fails is tried along the valley that it left, then without its part in the records' starts: those may bend
    within a gap or a fringe. One that fails however short it is, without the number that promises most: the moment of an
    event between two samples lies about its slope. Ends when a step promises less than `NEGLIGIBLE` of one squared standard
    deviation.
    """
    low, high = problem.bounds
    own = np.arange(len(x)) < problem.k
    x, damping = np.clip(x, low, high), BEGIN
    r, J = problem.evaluate(x)
    for _ in range(steps):
        gradient, H = J.T @ r, J.T @ J
        least, most = np.maximum(low - x, -problem.most), np.minimum(high - x, problem.most)
        step = _damped(H, gradient, least, most, damping)
        if -(gradient @ step + 0.5 * step @ H @ step) < NEGLIGIBLE:
            break
        better = _better(problem, r, np.clip(x + step, low, high))
        if better is None and damping <= FAILED:
            better = _along_valley(problem, x, r, J, H, step, damping)
        if better is None and 0 < np.count_nonzero(step[own]) < np.count_nonzero(step):
            step = _damped(H, gradient, least, most, damping, own)
            better = _better(problem, r, np.clip(x + step, low, high))
        if better is None and damping > FAILED:
            others = own & (step != 0)
            others[np.argmax(np.where(others, np.abs(gradient * step), -1.0))] = False
            step = _damped(H, gradient, least, most, BEGIN, others)
            better = _better(problem, r, np.clip(x + step, low, high))
        if better is not None:
            x, damping = better, max(damping / 10, 1e-9)
            r, J = problem.evaluate(x)
        else:
            damping = max(damping * 30, 1e-4)
            if damping > 1e8:
                break
    return x


def _damped(
    H: np.ndarray,
    gradient: np.ndarray,
    least: np.ndarray,
    most: np.ndarray,
    damping: float,
    movable: np.ndarray | bool = True,
) -> np.ndarray:
    """Marquardt's step of the `movable` numbers, the best in the box from `least` to `most`: a number that nothing holds, or
    that meets its bound, does not shorten the step of the others."""
    step = np.zeros_like(gradient)
    open_ = (np.diag(H) > 0) & (least < most) & movable
    if open_.any():
        scale = np.sqrt(np.diag(H)[open_])  # no number's unit decides what can be solved for
        w, V = np.linalg.eigh(H[np.ix_(open_, open_)] / np.outer(scale, scale))
        root = np.sqrt(np.maximum(w, 0.0) + damping)
        A, b = root[:, None] * V.T, -(V.T @ (gradient[open_] / scale)) / root
        step[open_] = lsq_linear(A, b, (least[open_] * scale, most[open_] * scale), method="bvls").x / scale
    return step


def _along_valley(
    problem: Problem, x: np.ndarray, r: np.ndarray, J: np.ndarray, H: np.ndarray, step: np.ndarray, damping: float
) -> np.ndarray | None:
    """x + t step + t^2 bend, t = 1 or 1/3, the first that leaves less than `r`: the bend takes back the curvature of the
    residual along the step, half its second derivative, from a small `PART` of it (geodesic acceleration, M. K. Transtrum,
    J. P. Sethna, arXiv:1201.5885)."""
    low, high = problem.bounds
    curved = ((problem.residual(np.clip(x + PART * step, low, high)) - r) / PART - J @ step) / PART
    if not np.isfinite(curved).all():
        return None
    bend = _damped(H, J.T @ curved, low - x, high - x, damping)
    tried = (_better(problem, r, np.clip(x + t * step + t**2 * bend, low, high)) for t in (1.0, 1 / 3))
    return next((better for better in tried if better is not None), None)


def _better(problem: Problem, r: np.ndarray, tried: np.ndarray) -> np.ndarray | None:
    """`tried`, where it leaves less than `r`."""
    left = problem.residual(tried)
    return tried if left @ left < r @ r else None

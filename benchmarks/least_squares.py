"""Peer: `scipy.optimize.least_squares` with bounds, one sample after the other."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
from scipy.optimize import least_squares

from benchmarks.samples import Answers, Samples

NAME = "scipy least_squares"
INSIDE = 1e-9  # a start on a bound is refused


def solver(samples: Samples, targets: np.ndarray) -> Callable[[], Answers]:
    """A function that solves all `targets`: each from the one before, bounds on z and T, exact Jacobian.

    `dogbox` with a stop on the gradient is the fastest of scipy's settings that stays within 0.01 nm. CasADi's
    functions are called through buffers, which costs a microsecond instead of ten.
    """
    y, _, target = samples.symbols
    residual = ca.vertcat(samples.pose_error, samples.balance)
    sizes = y.numel(), target.numel()
    value = _buffered(ca.Function("value", [y, target], [residual], {"cse": True}), sizes)
    slope = _buffered(ca.Function("slope", [y, target], [ca.densify(ca.jacobian(residual, y))], {"cse": True}), sizes)
    low, high = samples.bounds
    drives = samples.drive.map(len(targets))

    def one(guess: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        start = np.clip(guess, low + INSIDE, high - INSIDE)
        options = {"bounds": (low, high), "method": "dogbox", "ftol": None, "xtol": None, "gtol": 1e-7}
        return least_squares(value, start, jac=slope, args=(wanted,), **options).x

    before_first = one(np.ones(y.numel()), targets[-1])

    def solve_all() -> Answers:
        rows = [before_first]
        for wanted in targets:
            rows.append(one(rows[-1], wanted))
        table = np.array(rows)
        u = drives(table[1:].T, table[:-1, samples.axes :].T).full().T
        return samples.answers(table[1:], u)

    return solve_all


def _buffered(function: ca.Function, sizes: tuple[int, ...]) -> Callable[..., np.ndarray]:
    """`function` (dense, one result) on arrays, without CasADi's conversions."""
    buffer, trigger = function.buffer()
    inputs = [np.zeros(size) for size in sizes]
    rows, columns = function.size_out(0)
    result = np.zeros((columns, rows))
    for i, array in enumerate(inputs):
        buffer.set_arg(i, memoryview(array))
    buffer.set_res(0, memoryview(result.reshape(-1)))

    def call(*values: np.ndarray, _keep: object = buffer) -> np.ndarray:
        for array, given in zip(inputs, values, strict=True):
            array[:] = given
        trigger()
        return result.T.copy() if columns > 1 else result[0].copy()

    return call

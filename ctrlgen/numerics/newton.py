"""Newton's method: a fixed number of steps written out as an expression, or iterated until it converges; of many rows at once.

Written out it has no branches, can be differentiated, and prints as C whose running time is known. Two solvers of the
library are no case of it and say why: `ctrlgen.model.inverse` takes the closed form of linear and quadratic equations,
`ctrlgen.model.integrators.ImplicitRadau` keeps a velocity from passing through zero under dry friction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

CONVERGED = 1e-14  # residual and step, in units of order one: some tens of roundings

STEPS = 8  # of many rows at once, at most: for maps near the identity three reach rounding
CLOSE = (
    1e-9  # of the size of an unknown, by which a last step may still change it: the error that it leaves is its square
)


class NoRoot(ValueError):
    """Newton's method has found none."""


def newton_rows(
    at: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], wanted: np.ndarray, start: np.ndarray, size: np.ndarray
) -> np.ndarray:
    """(n, k) the unknowns at which `at` gives the values `wanted` (n, k), every row by itself, from `start` (n, k); k of a typical `size`.

    `at`: unknowns (n, k) -> values (n, k) and slopes (n, k, k). Raises numpy.linalg.LinAlgError where a slope is singular, NoRoot where
    `STEPS` do not suffice.
    """
    found = start
    for _ in range(STEPS):
        value, slope = at(found)
        step = np.linalg.solve(slope, (wanted - value)[:, :, None])[:, :, 0]
        found = found + step
        if np.all(np.abs(step) <= CLOSE * np.maximum(size, np.abs(found))):
            return found
    raise NoRoot(f"Newton's method finds no root in {STEPS} steps")


def newton_root(residual: ca.SX, unknown: ca.SX, start: ca.SX, steps: int) -> ca.SX:
    """The `unknown` (n,) after `steps` Newton steps on residual(unknown) = 0 from `start`, as an expression."""
    slope, root = ca.jacobian(residual, unknown), start
    for _ in range(steps):
        root = root - ca.solve(*ca.substitute([slope, residual], [unknown], [root]))  # a diagonal slope: divisions
    return root


def steps_needed(residual: ca.SX, unknown: ca.SX, most: int) -> int:
    """One step where the `residual` is linear in the `unknown`, else `most`."""
    return most if ca.depends_on(ca.jacobian(residual, unknown), unknown) else 1


class ImplicitRoots:
    """Roots of equations r(z, q) = 0 as symbols, so that what follows from them is differentiated by the implicit function theorem,

        dz/dq = -(dr/dz)^-1 dr/dq,

    and not through the steps that find them: z* - (dr/dz)^-1 r(z*, q) stands for a root, in which z* and the slope are `symbols`, which
    keep still while an expression is differentiated, and `values` are what they stand for.
    """

    def __init__(self) -> None:
        self.symbols: list[ca.SX] = []
        self.values: list[ca.SX] = []

    def __call__(self, residual: ca.SX, unknown: ca.SX, start: ca.SX, steps: int) -> ca.SX:
        """`newton_root` and one step more, of which alone the derivatives are taken; arguments as there."""
        slope = ca.jacobian(residual, unknown)
        root = ca.SX.sym("root", unknown.numel())
        self._keep(root, newton_root(residual, unknown, start, steps))
        slope, residual = ca.substitute([slope, residual], [unknown], [root])
        entries = ca.SX.sym("slope", slope.nnz())
        self._keep(entries, ca.vertcat(*slope.nonzeros()))
        return root - ca.solve(ca.SX(slope.sparsity(), entries), residual)

    def _keep(self, symbol: ca.SX, value: ca.SX) -> None:
        self.symbols.append(symbol)
        self.values.append(value)

    def inserted(self, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """The `expressions` with the values of the roots in the place of their symbols."""
        return list(ca.substitute_inplace(self.symbols, self.values, list(expressions), False)[1])


def newton_solver(
    name: str,
    residual: ca.SX | ca.MX,
    unknown: ca.SX | ca.MX,
    parameters: ca.SX | ca.MX,
    *,
    residual_below: float = CONVERGED,
    step_below: float = CONVERGED,
    most_steps: int,
) -> ca.Function:
    """(start, parameters) -> the root (n,), iterated until the residual or the step is below its bound.

    `residual` and `unknown` are to be scaled to order one. The function raises RuntimeError where `most_steps` do not
    suffice.
    """
    problem = {"x": unknown, "p": parameters, "g": residual}
    return ca.rootfinder(
        name, "newton", problem, {"abstol": residual_below, "abstolStep": step_below, "max_iter": most_steps}
    )

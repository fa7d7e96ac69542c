"""A cheap upper bound of how far a displacement uses limits on stress or rotation.

The followed signal's own directions v_k (to first order at home) are a basis, z = sum_k lambda_k v_k, and for a convex f with
f(s z) = |s| f(z), as stresses of a linear structure are, f(z) <= sum_k |lambda_k| f(v_k).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import casadi as ca
import numpy as np

from ctrlgen.devices import Limit
from ctrlgen.model.model import Model

NEGLIGIBLE = 1e-6  # of a limit: a direction that uses less of it over the whole range is left out of the bound
ROUNDED = 1e-12  # of the largest term of a bound: terms below it are what rounding left of nothing


@dataclass(frozen=True)
class CompositeBound:
    """sum_k |rows_k z| + `rest` of a displacement z: an upper bound of the largest share of a limit."""

    rows: np.ndarray
    rest: float

    @property
    def of_displacement(self) -> ca.Function:
        """wanted (n,) -> the bound."""
        wanted = ca.SX.sym("wanted", self.rows.shape[1])
        bound = ca.sum1(ca.fabs(ca.mtimes(ca.DM(self.rows), wanted))) + self.rest
        return ca.Function("composite_bound", [wanted], [bound], ["wanted"], ["bound"], {"cse": True})

    def of_target(self, displacement: np.ndarray, largest: np.ndarray) -> ca.Function:
        """target (m,) -> the bound at z = `displacement` target, where no target is larger than `largest` (m,). Most directions of a pose
        are a target's own: what rounding leaves of the others is taken at its largest."""
        rows = self.rows @ displacement
        small = np.abs(rows) * largest < ROUNDED * np.max(np.abs(rows) * largest, initial=0.0)
        rest = self.rest + float(np.sum(np.abs(rows * small) * largest))
        target = ca.SX.sym("target", rows.shape[1])
        bound = ca.sum1(ca.fabs(ca.mtimes(ca.sparsify(ca.DM(np.where(small, 0.0, rows))), target))) + rest
        return ca.Function("target_bound", [target], [bound], ["target"], ["bound"], {"cse": True})


def composite_bound(model: Model, follow: str, ratios: Callable[[np.ndarray], np.ndarray]) -> CompositeBound | None:
    """A bound of `ratios`, which gives the largest share of a limit at each column of displacements (n, k); None where they are not of the
    first degree. `follow` names the followed signal."""
    slope = ca.Function("W", [model.x, model.z], [ca.jacobian(model.signals[follow].expr, model.z)])
    W = slope(model.rest, 0 * model.z_scale).full()
    if W.shape[0] != W.shape[1] or np.linalg.matrix_rank(W) < len(W):
        W = np.eye(model.z.numel())
    reach = np.abs(W) @ np.max(np.abs(model.z_bounds), axis=0)  # of lambda_k over the range
    V = np.linalg.inv(W) * reach  # columns v_k, scaled to where lambda_k = reach_k
    shares = np.max([ratios(side * V) for side in (-1.0, 1.0)], axis=0)
    if not all(np.allclose(ratios(s * V), abs(s) * shares, rtol=1e-6, atol=1e-6) for s in (-0.5, 0.1)):
        return None
    few = shares > NEGLIGIBLE
    return CompositeBound(shares[few, None] / reach[few, None] * W[few], float(shares[~few].sum()) + NEGLIGIBLE)


def worst_in_range(model: Model, limit: Limit) -> float:
    """The largest ratio of a convex limit's value to its bound over the displacement range, which is at a corner of it."""
    corners = np.array(list(product(*zip(*model.z_bounds, strict=True)))).T
    count = corners.shape[1]
    shares = ca.Function("shares", [model.x, model.z], [limit.expr / limit.upper]).map(count)
    return float(np.max(shares(np.tile(model.rest[:, None], (1, count)), corners).full()))

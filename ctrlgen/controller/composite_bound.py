"""A cheap upper bound of how far a displacement uses limits on stress or rotation.

The followed signal's own directions v_k (to first order at home) are a basis, z = sum_k lambda_k v_k, and for a convex f with
f(s z) = |s| f(z), as stresses of a linear structure are, f(z) <= sum_k |lambda_k| f(v_k).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import casadi as ca
import numpy as np

from ctrlgen.devices import Limit
from ctrlgen.model.model import Model

NEGLIGIBLE = 1e-6  # of a limit: a direction that uses less of it over the whole range is left out of the bound


def composite_bound(model: Model, follow: str, ratios: Callable[[np.ndarray], np.ndarray]) -> ca.Function | None:
    """wanted (n,) -> a bound of `ratios`, which gives the largest share of a limit at each column of displacements (n, k); None where
    they are not of the first degree. `follow` names the followed signal."""
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
    wanted = ca.SX.sym("wanted", model.z.numel())
    bound = ca.sum1(ca.fabs(ca.mtimes(ca.DM(shares[few, None] / reach[few, None] * W[few]), wanted)))
    return ca.Function(
        "composite_bound", [wanted], [bound + shares[~few].sum() + NEGLIGIBLE], ["wanted"], ["bound"], {"cse": True}
    )


def worst_in_range(model: Model, limit: Limit) -> float:
    """The largest ratio of a convex limit's value to its bound over the displacement range, which is at a corner of it."""
    corners = np.array(list(product(*zip(*model.z_bounds, strict=True)))).T
    count = corners.shape[1]
    shares = ca.Function("shares", [model.x, model.z], [limit.expr / limit.upper]).map(count)
    return float(np.max(shares(np.tile(model.rest[:, None], (1, count)), corners).full()))

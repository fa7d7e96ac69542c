"""The displacement in range whose followed signal is nearest to that of one beyond it, in a fixed number of operations.

Minimises |W (z - beyond)|^2 over the box of displacements, W the slope of the followed signal at home in its typical sizes, by `SWEEPS`
of projected coordinate descent from the clipped displacement, each axis in turn at its optimum clipped to its range,

    z_i = beyond_i - sum_{j != i} H_ij / H_ii (z_j - beyond_j),   H = W^T W;

to first order in the displacement, and exact where one displacement moves one channel. Source: C. Hildreth, Naval Res. Logist. Quart. 4
(1957) 79.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.model.model import Model

# On the shipped devices it ends 0.5 % farther than the optimum at most; clipping alone ends 50 to 85 % farther.
SWEEPS = 3


def coupling(model: Model, follow: str) -> np.ndarray | None:
    """(n, n) H_ij / H_ii of H = W^T W for the signal named `follow`; None where H is diagonal: then one displacement moves one
    channel."""
    signal = model.signals[follow]
    slope = ca.Function("W", [model.x, model.z], [ca.jacobian(signal.expr, model.z)])(model.rest, 0 * model.z_scale)
    W = slope.full() / np.array(signal.scale)[:, None]
    H = W.T @ W
    return None if np.array_equal(H, np.diag(np.diag(H))) else H / np.diag(H)[:, None]


def nearest_displacement(bounds: tuple[np.ndarray, np.ndarray], P: np.ndarray | None) -> ca.Function:
    """beyond (n,) -> z (n,) within `bounds` (low, high); `P` as `coupling` gives it."""
    low, high = bounds
    n = len(low)
    beyond = ca.SX.sym("beyond", n)
    z = ca.fmin(ca.fmax(beyond, low), high)
    if P is not None:
        off = z - beyond
        for _ in range(SWEEPS):
            for i in range(n):
                others = sum(P[i, j] * off[j] for j in range(n) if j != i)
                z[i] = ca.fmin(ca.fmax(beyond[i] - others, low[i]), high[i])
                off[i] = z[i] - beyond[i]
    return ca.Function("nearest", [beyond], [z], ["beyond"], ["z"], {"cse": True})

"""How far from a path a device is between set-points, while its drives are held."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.model.discretisation import one_step_map
from ctrlgen.path_timing.curve import Curve
from ctrlgen.trajectory.solution import LOOKED_AT_BETWEEN, Solution

CHORDS = 16  # of the curve from one set-point to the next, to which distances are measured


def error_between(curve: Curve, solution: Solution, share: np.ndarray) -> np.ndarray:
    """(channels,) the largest distance [SI] from the curve in each channel between samples at these shares (N + 1,), at the place of the
    curve that is nearest in typical sizes, wherever it is in time."""
    model, h, n = solution.model, solution.scenario.sample_time or 0.0, len(share) - 1
    signal = model.signals[curve.scenario.file.follow]
    scale, p = np.array(signal.scale), np.tile(model.p_nominal[:, None], (1, n))
    x, z, u = solution.trace.x[:n].T, solution.trace.z[:n].T, solution.drive[:n].T
    inner = share[:-1, None] + np.diff(share)[:, None] * np.linspace(-0.5, 1.5, 2 * CHORDS + 1)
    inner = inner % 1.0 if curve.closed else np.clip(inner, 0.0, 1.0)
    points = curve.samples(inner.ravel()).reshape(n, 2 * CHORDS + 1, -1) / scale
    chord = np.diff(points, axis=1)
    worst = np.zeros(len(scale))
    for k in range(1, LOOKED_AT_BETWEEN):
        after = one_step_map(model, k / LOOKED_AT_BETWEEN * h)
        reached = ca.substitute(signal.expr, ca.vertcat(model.x, model.z), ca.vertcat(after.x, after.z))
        reached = ca.substitute(reached, after.u_next, model.u)  # where it acts without delay: the drive that is held
        function = ca.Function("between", [model.x, model.z, model.u, model.p], [reached])
        at = function.map(n)(x, z, u, p).full().T / scale
        off = at[:, None] - points[:, :-1]
        along = np.sum(off * chord, axis=2) / np.maximum(np.sum(chord**2, axis=2), 1e-300)
        off = off - np.clip(along, 0.0, 1.0)[:, :, None] * chord
        nearest = np.argmin(np.sum(off**2, axis=2), axis=1)
        worst = np.maximum(worst, np.abs(off[np.arange(n), nearest]).max(axis=0))
    return worst * scale

"""The model at one operating point as a linear system of its drives: x' = A x + B u, y = C x + D u, all SI."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.linalg import expm

from ctrlgen.model.model import Model


@dataclass(frozen=True)
class LinearSystem:
    """`A` (m, m), `B` (m, n_u), `C` (n_y, m), `D` (n_y, n_u). Without inertia the m states are those of the model, and its force balance
    is eliminated; with inertia its displacements follow them."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray

    def gain(self) -> np.ndarray | None:
        """(n_y, n_u) where it has settled, D - C A^-1 B; None where it never does."""
        if not len(self.A):
            return self.D
        if not np.isfinite(np.linalg.cond(self.A)):
            return None
        return self.D - self.C @ np.linalg.solve(self.A, self.B)

    def responses(self, u: np.ndarray, sample_time: float, linear: bool) -> np.ndarray:
        """What each drive alone makes of each output, (n, n_y, n_u), of the drives `u` (n, n_u), each held for one `sample_time` [s] or
        `linear` between samples. It begins settled under the first row, where it settles; an infinite sample time is a list of
        settled rows. NaN where it grows beyond all numbers."""
        gain = self.gain()
        if np.isinf(sample_time) or not len(self.A):
            return np.full((len(u), *self.D.shape), np.nan) if gain is None else u[:, None, :] * gain
        held, ramp = self._steps(sample_time)
        X = np.zeros(self.B.shape) if gain is None else -np.linalg.solve(self.A, self.B * u[0])
        slopes = np.diff(u, axis=0, append=u[-1:]) if linear else np.zeros_like(u)
        along = np.empty((len(u), *self.B.shape))
        step = expm(self.A * sample_time)
        for k in range(len(u)):
            along[k] = X
            X = step @ X + held * u[k] + ramp * slopes[k]
        along[~np.isfinite(along)] = np.nan
        return self.C @ along + self.D * u[:, None, :]

    def _steps(self, h: float) -> tuple[np.ndarray, np.ndarray]:
        """(m, n_u) what one sample of a drive of 1, and one of a drive that rises from 0 to 1, adds to the states."""
        m, n = self.B.shape
        block = np.zeros((m + 2 * n, m + 2 * n))
        block[:m, :m], block[:m, m : m + n] = self.A * h, self.B * h
        block[m : m + n, m + n :] = np.eye(n)
        e = expm(block)
        return e[:m, m : m + n], e[:m, m + n :]


def linear_system(model: Model, outputs: ca.SX, x: np.ndarray, z: np.ndarray, u: np.ndarray) -> LinearSystem:
    """The slopes of `outputs` (n_y,) about the states x (n_x,), displacements z (n_axes,) and drives u (n_u,), SI.

    Without inertia 0 = g(x, z, u) is eliminated: dz = -g_z^-1 (g_x dx + g_u du). With inertia x' = f(x, z, u), z' = v; a feedback loop
    acts without the delay of its samples.
    """
    if model.inertial:
        state = ca.vertcat(model.x, model.z)
        rates = model.closed(ca.vertcat(model.rates, model.v))
        return LinearSystem(*_slopes(model, (rates, outputs), (state, model.u), x, z, u))
    f_x, f_z, f_u, g_x, g_z, g_u, y_x, y_z, y_u = _slopes(
        model, (model.rates, model.balance, outputs), (model.x, model.z, model.u), x, z, u
    )
    z_x, z_u = -np.linalg.solve(g_z, g_x), -np.linalg.solve(g_z, g_u)
    return LinearSystem(f_x + f_z @ z_x, f_u + f_z @ z_u, y_x + y_z @ z_x, y_u + y_z @ z_u)


def _slopes(
    model: Model,
    expressions: tuple[ca.SX, ...],
    arguments: tuple[ca.SX, ...],
    x: np.ndarray,
    z: np.ndarray,
    u: np.ndarray,
) -> list[np.ndarray]:
    """The derivatives of each expression by each argument at x, z, u, in the order of both."""
    blocks = [ca.jacobian(model.closed(e), s) for e in expressions for s in arguments]
    function = ca.Function("jacobians", [model.x, model.z, model.u, model.p, model.ambient_symbol], blocks)
    return [block.full() for block in function(x, z, u, model.p_nominal, 0)]

"""One sample of a model, symbolic: from x, z under the drive to x, z at the next sample.

A stage in balance: x by its exact lag, z by Newton's method on 0 = g(x, z, u). A stage with inertia: an
exponential Runge-Kutta method, exact for the nominal linear part.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy.linalg import expm

from ctrlgen.model import Model

SUBSTEP = 0.8  # of the fastest nominal eigenvalue, per step; what is not linear is then right to 1e-3 of itself
FASTEST = 5.0  # eigenvalue times sample time beyond which a lag is over within a sample, and exact
MOST_SUBSTEPS = 16
SETTLED = 14.0  # time constants: e^-14 is a millionth


class Sample(NamedTuple):
    """Symbols of the drive at the next sample, and x, z there."""

    u_next: ca.SX
    x: ca.SX
    z: ca.SX


def next_sample(model: Model, sample_time: float, linear: bool = False, newton_steps: int = 4) -> Sample:
    """x and z one `sample_time` [s] on, with the drive held, or `linear` between samples.

    An infinite sample time gives the settled pose (clocks then count poses). Raises InputError where the sample
    time is too long for a model whose states act on one another.
    """
    u_next = ca.SX.sym("u_next", model.u.numel())
    if model.inertial:
        x, z = _integrate(model, sample_time, u_next, linear)
        return Sample(u_next, x, z)
    if not np.isfinite(sample_time):
        x, z = _settle(model, u_next, newton_steps)
        return Sample(u_next, x, z)
    x = model.step(sample_time)
    if linear:
        x = ca.substitute(x, model.u, (model.u + u_next) / 2)
    return Sample(u_next, x, balanced(model, x, u_next, newton_steps))


def balanced(model: Model, x: ca.SX, u: ca.SX, newton_steps: int = 4) -> ca.SX:
    """The displacement that balances the forces at `x` and `u`, by Newton's method from model.z; one step if linear."""
    g = ca.substitute(ca.substitute(model.balance, model.x, x), model.u, u)
    slope = ca.jacobian(g, model.z)
    diagonal = slope.sparsity().is_diag()
    z = model.z
    for _ in range(newton_steps if ca.depends_on(slope, model.z) else 1):
        residual, S = (ca.substitute(e, model.z, z) for e in (g, slope))
        z = z - (residual / ca.diag(S) if diagonal else ca.solve(S, residual))
    return z


def _settle(model: Model, u: ca.SX, newton_steps: int) -> tuple[ca.SX, ca.SX]:
    """Actuators, then displacement, then memories at rest under `u`."""
    rates = ca.substitute(model.rates, model.u, u)
    A = ca.jacobian(rates, model.x)
    x, z = model.x, model.z
    for _ in range(2):  # memories rest on the displacement, which rests on the actuators
        slope, rate = (ca.substitute(ca.substitute(e, model.x, x), model.z, z) for e in (A, rates))
        moved = [_rested(slope, rate, i, x) for i in range(model.x.numel())]
        x = ca.vertcat(ca.SX(0, 1), *moved)
        z = balanced(model, x, u, newton_steps)
    for i in model.clocks:
        x[i] = model.x[i] + 1.0
    for i, value in model.stepped.items():
        x[i] = ca.substitute(value, ca.vertcat(model.z, model.u), ca.vertcat(z, u))
    return x, z


def _rested(slope: ca.SX, rate: ca.SX, i: int, x: ca.SX) -> ca.SX:
    own = slope[i, i]
    return x[i] if own.is_zero() else x[i] - rate[i] / own


def _integrate(model: Model, sample_time: float, u_next: ca.SX, linear: bool) -> tuple[ca.SX, ca.SX]:
    """y' = f(y, u) = A y + N: e^(A h) exactly with A the nominal slope at home, N to fourth order.

    S. M. Cox, P. C. Matthews, J. Comput. Phys. 176 (2002) 430, eqs. (26)-(29).
    """
    state = ca.vertcat(model.x, model.z)
    given = [state, model.held, model.u, model.p, model.ambient_symbol]
    f = ca.Function("f", given, [ca.vertcat(model.sampled_rates, model.v)])
    A = _home_slope(model)
    count = substeps(A, sample_time)
    h, y = sample_time / count, state
    half, whole = _phis(A * h / 2), _phis(A * h)
    E2, Q, E = half[0], h / 2 * half[1], whole[0]
    weights = [
        h * (whole[1] - 3 * whole[2] + 4 * whole[3]),
        h * (2 * whole[2] - 4 * whole[3]),
        h * (4 * whole[3] - whole[2]),
    ]
    E2, Q, E, W1, W2, W3 = (ca.sparsify(ca.DM(np.where(np.abs(M) < 1e-300, 0.0, M))) for M in (E2, Q, E, *weights))
    A = ca.sparsify(ca.DM(A))

    def N(y: ca.SX, share: float) -> ca.SX:
        u = model.u + share * (u_next - model.u) if linear else model.u
        return f(y, model.held_value, u, model.p, model.ambient_symbol) - A @ y

    for k in range(count):
        first = N(y, k / count)
        a = E2 @ y + Q @ first
        second = N(a, (k + 0.5) / count)
        b = E2 @ y + Q @ second
        third = N(b, (k + 0.5) / count)
        c = E2 @ a + Q @ (2 * third - first)
        y = E @ y + W1 @ first + W2 @ (second + third) + W3 @ N(c, (k + 1) / count)
    x, z = y[: model.x.numel()], y[model.x.numel() :]
    for i, value in model.stepped.items():
        x[i] = value
    return x, z


def _home_slope(model: Model) -> np.ndarray:
    """df/dy of the nominal model near home, the drive held, where a law with a corner at home is on one side of it."""
    state = ca.vertcat(model.x, model.z)
    A = ca.jacobian(ca.vertcat(model.sampled_rates, model.v), state)
    at = ca.Function("A", [state, model.held, model.u, model.p, model.ambient_symbol], [A])
    here = np.concatenate([model.rest, 1e-3 * model.z_scale])
    return at(here, 0, 0, model.p_nominal, 0).full()


def settling_time(model: Model) -> float:
    """How long [s] the actuators and the stage itself go on after a change of drive, to a millionth of it."""
    if model.inertial:
        state = ca.vertcat(model.x, model.z)
        A = ca.Function(
            "A", [state, model.u, model.p, model.ambient_symbol], [ca.jacobian(ca.vertcat(model.rates, model.v), state)]
        )  # fmt: skip
        here = np.concatenate([model.rest, 1e-3 * model.z_scale])
        slow = np.abs(np.linalg.eigvals(A(here, 0, model.p_nominal, 0).full()).real)
    else:
        A = ca.Function(
            "A", [model.x, model.z, model.u, model.p, model.ambient_symbol], [ca.jacobian(model.rates, model.x)]
        )
        slow = np.abs(np.diag(A(model.rest, 1e-3 * model.z_scale, 0, model.p_nominal, 0).full())[: model.n_states])
    slow = slow[slow > 1e-6]
    return float(SETTLED / slow.min()) if slow.size else 0.0


def substeps(A: np.ndarray, sample_time: float) -> int:
    """Steps a sample, from the eigenvalues of the nominal motion."""
    fastest = np.abs(np.linalg.eigvals(A)).max(initial=0.0)
    return int(np.clip(np.ceil(sample_time * min(fastest, FASTEST / sample_time) / SUBSTEP), 1, MOST_SUBSTEPS))


def _phis(M: np.ndarray) -> list[np.ndarray]:
    """e^M, phi_1, phi_2, phi_3 with phi_k(M) = sum_j M^j/(j + k)!: the first row of blocks of one larger exponential."""
    n = len(M)
    large = np.zeros((4 * n, 4 * n))
    large[:n, :n] = M
    for k in range(3):
        large[k * n : (k + 1) * n, (k + 1) * n : (k + 2) * n] = np.eye(n)
    return np.split(expm(large)[:n], 4, axis=1)

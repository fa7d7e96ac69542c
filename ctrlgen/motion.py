"""One sample of a model, symbolic: from x, z under the drive to x, z at the next sample.

A stage in balance: x by its exact lag, z by Newton's method on 0 = g(x, z, u). A stage with inertia: the classical
Runge-Kutta method in substeps short against every nominal time constant.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np

from ctrlgen.model import Model

SUBSTEP = 0.125  # of the fastest nominal eigenvalue, per substep; the phase error is then 2e-7 a radian
MOST_SUBSTEPS = 64


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
    state = ca.vertcat(model.x, model.z)
    rate = ca.Function("rate", [state, model.u, model.p, model.ambient_symbol], [ca.vertcat(model.rates, model.v)])
    count = substeps(model, sample_time)
    h, y = sample_time / count, state

    def f(y: ca.SX, share: float) -> ca.SX:
        u = model.u + share * (u_next - model.u) if linear else model.u
        return rate(y, u, model.p, model.ambient_symbol)

    for k in range(count):
        a = f(y, k / count)
        b = f(y + h / 2 * a, (k + 0.5) / count)
        c = f(y + h / 2 * b, (k + 0.5) / count)
        d = f(y + h * c, (k + 1) / count)
        y = y + h / 6 * (a + 2 * b + 2 * c + d)
    x, z = y[: model.x.numel()], y[model.x.numel() :]
    for i, value in model.stepped.items():
        x[i] = value
    return x, z


def substeps(model: Model, sample_time: float) -> int:
    """Runge-Kutta steps a sample, from the eigenvalues of the nominal model at home."""
    state = ca.vertcat(model.x, model.z)
    A = ca.jacobian(ca.vertcat(model.rates, model.v), state)
    at = ca.Function("A", [state, model.u, model.p, model.ambient_symbol], [A])
    here = np.concatenate([model.rest, 1e-3 * model.z_scale])
    fastest = np.abs(np.linalg.eigvals(at(here, 0, model.p_nominal, 0).full())).max(initial=0.0)
    return int(np.clip(np.ceil(sample_time * fastest / SUBSTEP), 1, MOST_SUBSTEPS))

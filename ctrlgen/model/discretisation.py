"""One sample of a model, symbolic: from x, z under the drive to x, z at the next sample.

A stage in balance: x by its exact lag, under a drive held (zero-order hold) or linear between samples (first-order hold), z by
Newton's method on 0 = g(x, z, u). A stage with inertia: exponential
steps, exact for the nominal linear part.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import casadi as ca
import numpy as np
import scipy

from ctrlgen.model.integrators import integrator_of
from ctrlgen.model.model import Model

CHAINED = 3  # memories on memories on heaters whose power depends on their temperature
SETTLED = 14.0  # time constants: e^-14 is a millionth


class Sample(NamedTuple):
    """Symbols of the drive at the next sample, and x, z there."""

    u_next: ca.SX
    x: ca.SX
    z: ca.SX


def one_step_map(model: Model, sample_time: float, linear: bool = False, newton_steps: int = 4) -> Sample:
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
    x = _ramped(model, sample_time, u_next, newton_steps) if linear else model.step(sample_time)
    return Sample(u_next, x, balanced(model, x, u_next, newton_steps))


def _ramped(model: Model, sample_time: float, u_next: ca.SX, newton_steps: int) -> ca.SX:
    """x after a sample in which the drive goes linearly to `u_next`, and the displacement that balances it goes along."""
    A, rates = ca.jacobian(model.rates, model.x), [model.rates]
    carried = ca.depends_on(model.rates, model.z)
    bending = ca.vertcat(model.rates, model.balance) if carried else model.rates
    bent = any(ca.which_depends(bending, ca.vertcat(model.u, model.z), 2, True))
    if carried:
        slope = ca.solve(ca.jacobian(model.balance, model.z), ca.jacobian(model.balance, model.x))
        A -= ca.mtimes(ca.jacobian(model.rates, model.z), slope)
    for share in (0.5, 1.0) if bent else (1.0,):
        u = model.u + share * (u_next - model.u)
        z = balanced(model, model.x, u, newton_steps) if carried else model.z
        here = ca.vertcat(model.z, model.u), ca.vertcat(z, u)
        rates.append(ca.substitute(model.rates, *here))
    return model.ramp(sample_time, A, rates)


def balanced(model: Model, x: ca.SX, u: ca.SX, newton_steps: int = 4) -> ca.SX:
    """The displacement that balances the forces at `x`, a function of z or not, and `u`, by Newton's method from model.z; one
    step if linear."""
    g = ca.substitute(
        model.balance, ca.vertcat(model.x, model.u), ca.vertcat(x, u)
    )  # at once: x depends on the drive before
    slope = ca.jacobian(g, model.z)
    diagonal = slope.sparsity().is_diag()
    z = model.z
    for _ in range(newton_steps if ca.depends_on(slope, model.z) else 1):
        residual, S = (ca.substitute(e, model.z, z) for e in (g, slope))
        z = z - (residual / ca.diag(S) if diagonal else ca.solve(S, residual))
    return z


def _settle(model: Model, u: ca.SX, newton_steps: int) -> tuple[ca.SX, ca.SX]:
    """Actuators and memories at rest under `u`, as the displacement has it, and the displacement that balances with them."""
    rates = ca.substitute(model.rates, model.u, u)
    A = ca.jacobian(rates, model.x)
    x, groups = model.x, _together(A)
    for _ in range(CHAINED):
        slope, rate = (ca.substitute(e, model.x, x) for e in (A, rates))
        moved = ca.SX(x)
        for group in groups:
            moved[group] = x[group] - ca.solve(slope[group, group], rate[group])
        x = moved
    z = balanced(model, x, u, newton_steps)
    x = ca.substitute(x, model.z, z)
    for i in model.clocks:
        x[i] = model.x[i] + 1.0
    for i, value in model.stepped.items():
        x[i] = ca.substitute(value, ca.vertcat(model.z, model.u), ca.vertcat(z, u))
    return x, z


def _together(A: ca.SX) -> list[list[int]]:
    """The states that come to rest, those together that act on one another (the two of a second-order filter)."""
    sparsity = A.sparsity()
    acts = np.zeros(A.shape, dtype=bool)
    acts[sparsity.row(), sparsity.get_col()] = True
    count, label = scipy.sparse.csgraph.connected_components(acts, connection="strong")
    groups = [np.flatnonzero(label == k).tolist() for k in range(count)]
    return [g for g in groups if len(g) > 1 or acts[g[0], g[0]]]


def _integrate(model: Model, sample_time: float, u_next: ca.SX, linear: bool) -> tuple[ca.SX, ca.SX]:
    """x and z one sample on, with inertia."""
    state = ca.vertcat(model.x, model.z)
    steps = integrator_of(model, sample_time)
    own = [model.held, model.p, model.ambient_symbol]
    rest = ca.Function("N", [state, model.u, *own], [steps.rest(model)])
    y, drives = state, steps.drives(model.u, u_next, linear)
    for u, u_end in pairwise(drives):
        y = steps.step(lambda y, u: rest(y, u, model.held_value, *own[1:]), y, u, u_end)
    x, z = y[: model.x.numel()], y[model.x.numel() :]
    for i, value in model.stepped.items():
        x[i] = value
    return x, z


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

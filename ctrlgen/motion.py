"""One sample of a model, symbolic: from x, z under the drive to x, z at the next sample.

A stage in balance: x by its exact lag, z by Newton's method on 0 = g(x, z, u). A stage with inertia: an
exponential Runge-Kutta method, exact for the nominal linear part.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy.linalg import expm

from ctrlgen.model import Model

SUBSTEP = 0.8  # of the fastest nominal eigenvalue, per step; what is not linear is then right to 1e-3 of itself
FASTEST = 5.0  # eigenvalue times sample time beyond which a lag is over within a sample, and exact
MOST_SUBSTEPS = 16
Point = tuple[ca.SX, ca.SX]  # y, u
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


class Exponential:
    """Steps of y' = A y + N(y, u): e^(A h) exactly with A the nominal slope at home, N to fourth order; `count` a sample.

    S. M. Cox, P. C. Matthews, J. Comput. Phys. 176 (2002) 430, eqs. (26)-(29). N has the rows `acting` of y alone: a step
    is from y to E y + sum_i W_i N_i, through the points half y + Q N_1, half y + Q N_2 and E y + R N_1 + 2 Q N_3.
    """

    def __init__(self, model: Model, sample_time: float) -> None:
        A = home_slope(model)
        self.count = substeps(A, sample_time)
        self.A = _sparse(A)
        rest = self._rest(model)
        self.acting = [i for i in range(len(A)) if not rest[i].is_zero()]
        h = sample_time / self.count
        (half, phi, *_), whole = _phis(A * h / 2), _phis(A * h)
        Q = h / 2 * phi
        self.half, self.E = _sparse(half), _sparse(whole[0])
        self.Q, self.R = (_sparse(M[:, self.acting]) for M in (Q, half @ Q - Q))
        middle = h * (2 * whole[2] - 4 * whole[3])
        ends = h * (whole[1] - 3 * whole[2] + 4 * whole[3]), h * (4 * whole[3] - whole[2])
        self.W = [_sparse(M[:, self.acting]) for M in (ends[0], middle, middle, ends[1])]

    def rest(self, model: Model) -> ca.SX:
        """N, its rows `acting`."""
        return self._rest(model)[self.acting]

    def _rest(self, model: Model) -> ca.SX:
        return ca.vertcat(model.sampled_rates, model.v) - self.A @ ca.vertcat(model.x, model.z)

    def step(self, N: Callable[[ca.SX, ca.SX], ca.SX], y: ca.SX, u: ca.SX, u_end: ca.SX) -> tuple[ca.SX, list[Point]]:
        """y one step on, the drive going from `u` to `u_end`, and the four points where N was evaluated."""
        middle = (u + u_end) / 2
        half, whole = self.half @ y, self.E @ y
        first = N(y, u)
        a = half + self.Q @ first
        second = N(a, middle)
        b = half + self.Q @ second
        third = N(b, middle)
        c = whole + self.R @ first + 2 * (self.Q @ third)
        values = first, second, third, N(c, u_end)
        after = whole + sum(W @ value for W, value in zip(self.W, values, strict=True))
        return after, [(y, u), (a, middle), (b, middle), (c, u_end)]

    def drives(self, u: ca.SX, u_next: ca.SX, linear: bool) -> list[ca.SX]:
        """The drive at the beginning of each step of a sample, and at its end."""
        return [u + k / self.count * (u_next - u) if linear else u for k in range(self.count + 1)]


def _sparse(M: np.ndarray) -> ca.DM:
    return ca.sparsify(ca.DM(np.where(np.abs(M) < 1e-300, 0.0, M)))


def _integrate(model: Model, sample_time: float, u_next: ca.SX, linear: bool) -> tuple[ca.SX, ca.SX]:
    """x and z one sample on, by the steps of `Exponential`."""
    state = ca.vertcat(model.x, model.z)
    steps = Exponential(model, sample_time)
    own = [model.held, model.p, model.ambient_symbol]
    rest = ca.Function("N", [state, model.u, *own], [steps.rest(model)])
    y, drives = state, steps.drives(model.u, u_next, linear)
    for u, u_end in pairwise(drives):
        y, _ = steps.step(lambda y, u: rest(y, u, model.held_value, *own[1:]), y, u, u_end)
    x, z = y[: model.x.numel()], y[model.x.numel() :]
    for i, value in model.stepped.items():
        x[i] = value
    return x, z


def home_slope(model: Model) -> np.ndarray:
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

"""Inverse dynamics of a model with inertia, symbolically: a target with its derivatives -> states and drive, in continuous time.

With y = (x, z) and y' = F(y, u) the followed signal h(y) is differentiated along the motion until the drive appears in it,

    h_0 = h(y),   h_k+1 = (dh_k/dy) F(y, u),

for channel i after rho_i times, its relative degree: 2 for a force on the mass, 3 where the force lags behind the drive. Then

    h_i,k(y) = r_i^(k),  k = 0 ... rho_i - 1,      h_i,rho_i(y, u) = r_i^(rho_i)

are solved for states and drive by `ctrlgen.model.inverse.solve_by_blocks`. Where axes share a matrix of masses M, M^-1 makes each of these
equations one of every axis's force. There the accelerations a and their derivatives by time stay unknowns beside states and drive, with

    M a^(k) = d^k g/dt^k (y, u, a, a', ..., a^(k-1)),   k = 0 ... max rho - 2,

g being the net forces: the matrices are then solved once, as constant blocks, and each actuator's law by itself.

States that no such equation determines (memories of effects, flexible modes, an integrator of a feedback loop) are internal: here they
stay at rest, and `ctrlgen.trajectory.inverse.sampled` finds them.
Source: A. Isidori, Nonlinear Control Systems, 3rd ed. (1995), section 5.1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.model.allocation import allocate
from ctrlgen.model.inverse import ExpansionPoint, solve_by_blocks
from ctrlgen.model.model import Model
from ctrlgen.model.state_vector import TYPICAL_RATE

NONE = ca.SX(0, 1)  # a vector without components


@dataclass(frozen=True)
class InverseDynamics:
    """`kernel` (channels, order + 1), the target and its derivatives by time [SI], -> x (n_x,), z (n_axes,), u (n_u,).

    `degrees`: the relative degree of each channel. `internal`: places in (x, z) of the states that the target does not determine; the
    kernel leaves them at rest.
    """

    kernel: ca.Function
    degrees: tuple[int, ...]
    internal: tuple[int, ...]

    @property
    def order(self) -> int:
        """The number of derivatives of the target that are needed: the largest relative degree, or what a kernel `after` takes."""
        return self.kernel.size2_in(0) - 1

    def after(self, first: ca.Function) -> InverseDynamics:
        """The same of the target that `first` makes of another one, (channels, .) both."""
        target = first.sx_in(0)
        results = self.kernel(first(target))
        kernel = ca.Function("inverse_dynamics", [target], list(results), ["target"], ["x", "z", "u"], {"cse": True})
        return replace(self, kernel=kernel)


def relative_degrees(model: Model, follow: str) -> tuple[int, ...]:
    """How often each channel of the signal `follow` is differentiated until the drive appears. Raises InputError for a channel that
    the drive does not move, or moves without delay."""
    return tuple(len(chain) - 1 for chain in _chains(model, follow))


def inverse_dynamics(model: Model, follow: str) -> InverseDynamics:
    """The inverse dynamics of `model` for the signal `follow`; free parameters take their nominal values.

    Raises InputError where the drives do not move the channels independently, so that no motion has one drive.
    """
    if model.redundant:
        return _of_least_effort(model, follow)
    chains = _chains(model, follow)
    degrees = tuple(len(chain) - 1 for chain in chains)
    target = ca.SX.sym("target", len(chains), max(degrees) + 1)
    motion, accelerations = _implicit(model, follow, degrees) or (chains, [])
    equations = ca.vertcat(
        *(h - target[i, k] for i, chain in enumerate(motion) for k, h in enumerate(chain)),
        *(e for _, e in accelerations),
    )
    x, z, u = (ca.SX.sym(name, v.numel()) for name, v in (("x1", model.x), ("z1", model.z), ("u1", model.u)))
    equations = ca.substitute(equations, ca.vertcat(model.x, model.z, model.u), ca.vertcat(x, z, u))
    equations = ca.substitute(equations, model.p, ca.DM(model.p_nominal))
    states, last = range(model.n_states), model.x.numel() - model.v.numel()
    orders = ca.vertcat(NONE, *(symbol for symbol, _ in accelerations))
    candidates = ca.vertcat(u, z, x[last:, :], orders, x[list(states)], x[model.n_states : last, :])
    chosen = _determined(equations, candidates)
    if len(chosen) < equations.numel() or not set(range(model.u.numel())) <= set(chosen):
        what = f"does not move the channels of the {follow} independently of one another"
        raise InputError(model.name, [Fault("drive", f"{what}; follow the displacement, or fewer channels")])
    unknowns = candidates[chosen]
    hashes = {symbol.element_hash() for symbol in ca.vertsplit(unknowns)}
    y, rest = ca.vertcat(x, z), ca.SX(ca.DM(np.concatenate([model.rest, np.zeros(z.numel())])))
    internal = tuple(i for i in range(y.numel()) if y[i].element_hash() not in hashes)
    held, at_rest = (ca.vertcat(NONE, *(v[i] for i in internal)) for v in (y, rest))
    equations = ca.substitute(equations, held, at_rest)
    if ca.sprank(ca.jacobian(equations, unknowns).sparsity()) < equations.numel():
        kinds = ", ".join(sorted({e.kind for e in model.device.effect if e.states}))
        what = f"of the device ({kinds}) keep the drive from moving the {follow} near rest: there is no inverse; leave them out"
        raise InputError(model.name, [Fault("effect", what)])
    known = ExpansionPoint.of(
        (x, model.rest, model.x_scale),
        (z, 0 * model.z_scale, model.z_scale),
        (u, 0 * model.u_scale, model.u_scale),
        (ca.vec(target), np.zeros(target.numel()), np.zeros(target.numel())),
        *((a, 0 * model.z_scale, model.z_scale * TYPICAL_RATE ** (k + 2)) for k, (a, _) in enumerate(accelerations)),
    )
    solution = solve_by_blocks(known, equations, unknowns)
    result = [ca.substitute(ca.substitute(e, unknowns, solution), held, at_rest) for e in (x, z, u)]
    kernel = ca.Function("inverse_dynamics", [target], result, ["target"], ["x", "z", "u"], {"cse": True})
    return InverseDynamics(kernel, degrees, internal)


def _of_least_effort(model: Model, follow: str) -> InverseDynamics:
    """The drives of least effort among all that give the same motion, where there are more of them than axes."""
    allocation = allocate(model)
    dynamics = inverse_dynamics(allocation.ganged, follow)
    target = ca.SX.sym("target", *dynamics.kernel.size_in(0))
    x, z, f = dynamics.kernel(target)
    results = [x, z, allocation.drive(z, f)]
    kernel = ca.Function("inverse_dynamics", [target], results, ["target"], ["x", "z", "u"], {"cse": True})
    return InverseDynamics(kernel, dynamics.degrees, dynamics.internal)


def _chains(model: Model, follow: str) -> list[list[ca.SX]]:
    """For each channel the signal and its derivatives by time, up to the first that depends on the drive."""
    y, F = ca.vertcat(model.x, model.z), ca.vertcat(model.rates, model.v)
    signal, chains = model.signals[follow], []
    for i, channel in enumerate(signal.channels):
        chain = [signal.expr[i]]
        while not ca.depends_on(chain[-1], model.u) and len(chain) <= y.numel():
            chain.append(ca.jtimes(chain[-1], y, F))
        if not ca.depends_on(chain[-1], model.u):
            what = f"does not move {channel} of the {follow}; follow a signal that it moves"
            raise InputError(model.name, [Fault("drive", what)])
        if len(chain) == 1:
            what = f"moves {channel} of the {follow} without inertia; follow the displacement"
            raise InputError(model.name, [Fault("drive", what)])
        chains.append(chain)
    return chains


def _implicit(
    model: Model, follow: str, degrees: tuple[int, ...]
) -> tuple[list[list[ca.SX]], list[tuple[ca.SX, ca.SX]]] | None:
    """The chains in terms of the accelerations and their derivatives, and each of those with its equation; None where the axes do not
    share their masses, or not every channel is moved after as many derivatives."""
    if model.mass.sparsity().is_diag() or len(set(degrees)) > 1:
        return None
    n, degree = len(model.axes), degrees[0]
    state_rates = model.rates[: model.x.numel() - n, :]
    force = ca.substitute(model.balance, model.heat, model.heat_of_drive)
    symbols = [ca.SX.sym(f"a{k}", n) for k in range(degree)]
    y, F = ca.vertcat(model.x, model.z, *symbols[:-1]), ca.vertcat(state_rates, symbols[0], model.v, *symbols[1:])
    equations: list[tuple[ca.SX, ca.SX]] = []
    for k, a in enumerate(symbols[:-1]):
        if k and ca.depends_on(force, model.u):
            return None
        force = ca.jtimes(force, y, F) if k else force
        equations.append((a, ca.mtimes(model.mass, a) - force))
    chains = []
    for channel in ca.vertsplit(model.signals[follow].expr):
        chain = [channel]
        while len(chain) <= degree:
            chain.append(ca.jtimes(chain[-1], y, F))
        chains.append(chain)
    return chains, equations


def _determined(equations: ca.SX, candidates: ca.SX) -> list[int]:
    """Places of the first of the `candidates` for which the equations can be solved, by structure."""
    pattern = ca.jacobian(equations, candidates).sparsity()
    chosen: list[int] = []
    for i in range(candidates.numel()):
        if len(chosen) == equations.numel():
            break
        sub, _ = pattern.sub(list(range(equations.numel())), [*chosen, i])
        if ca.sprank(sub) > len(chosen):
            chosen.append(i)
    return chosen

"""One sample of a model, symbolic: from x, z and the drive to x, z at the next sample.

A stage in balance: x by the exact step of its lags, under a drive held (zero-order hold) or linear between samples
(first-order hold), then z by Newton's method on 0 = g(x, z, u). A stage with inertia: the steps of
`ctrlgen.model.integrators`, exact for the nominal linear part.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import ceil, log2
from typing import NamedTuple

import casadi as ca
import numpy as np
import scipy

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.model.integrators import NEAR_HOME, integrator_of
from ctrlgen.model.model import Model
from ctrlgen.numerics.newton import newton_root, steps_needed
from ctrlgen.numerics.phi_functions import held_gain, increment, lag_increment, varied_gain

NEWTON_STEPS = 4  # from the displacement one sample before, each step doubles the digits
JUMP_NEWTON_STEPS = 8  # from one end of the drive to the other: 4 pm at most, of a coil's stage that stiffens
SETTLING_SWEEPS = 3  # memories that follow memories that follow heaters whose power depends on their temperature
SETTLING_TIME_CONSTANTS = 14.0  # e^-14 is a millionth
# Sample time times the fastest rate of coupled states, beyond which the sample time is refused; 20 doublings of the phi functions
# leave 1e-10 of rounding.
LONGEST_STEP = 2.0**20
LONGEST_HELD_STEP = 1024.0  # beyond it a sample under a held drive, such as the dwell of a pose, is divided
DWELL_STEPS = 4  # parts of such a sample: for states that settle in each, as many steps of Newton's method
SLOWEST_RATE = 1e-6  # [1/s] a slower state is taken to stand: an integrator, not a lag


Root = Callable[[ca.SX, ca.SX, ca.SX, int], ca.SX]
"""(residual, unknown, start, steps) -> the unknown at which the residual is zero, as `newton_root`."""


class Sample(NamedTuple):
    """Symbols of the drive at the next sample, and x, z there."""

    u_next: ca.SX
    x: ca.SX
    z: ca.SX


def one_step_map(
    model: Model,
    sample_time: float,
    linear: bool = False,
    newton_steps: int = NEWTON_STEPS,
    poses: bool = False,
    finer: int = 1,
    root: Root = newton_root,
) -> Sample:
    """x and z one `sample_time` [s] on, with the drive held, or `linear` between samples; with inertia in `finer` times the steps of
    its integrator. A displacement in balance is found by `root`.

    With `poses` the drive jumps to the next one first and is held for the sample time, the dwell; memories see the displacement
    of its end, which the actuators reach in a small part of it.

    An infinite sample time gives the settled pose (clocks then count poses). Raises InputError where the sample
    time is too long for a model whose states act on one another.
    """
    u_next = ca.SX.sym("u_next", model.u.numel())
    if model.inertial:
        x, z = _integrate(model, sample_time, u_next, linear, finer)
        return Sample(u_next, x, z)
    if not np.isfinite(sample_time):
        x, z = _settle(model, u_next, newton_steps, root)
        return Sample(u_next, x, z)
    if poses:
        x, held = model.x, held_step(model, sample_time)
        for _ in range(2):
            z = balanced(model, x, u_next, newton_steps, root)
            x = ca.substitute(held, ca.vertcat(model.z, model.u), ca.vertcat(z, u_next))
        return Sample(u_next, x, balanced(model, x, u_next, newton_steps, root))
    x = _ramp_step(model, sample_time, u_next, newton_steps, root) if linear else held_step(model, sample_time)
    return Sample(u_next, x, balanced(model, x, u_next, newton_steps, root))


def held_step(model: Model, sample_time: float, rates: ca.SX | None = None) -> ca.SX:
    """x (n_x,) after one `sample_time` h [s] with u and z held: x + h phi_1(h A) f(x), A = df/dx.

    `rates` f are those of the model unless given. Exact where f is linear in x. A sample of more than `LONGEST_HELD_STEP` time
    constants is divided, so that states which are not linear settle too. Raises InputError where h is more than `LONGEST_STEP`
    times the fastest rate of states that act on one another.
    """
    rates, h = model.rates if rates is None else rates, sample_time
    A = ca.jacobian(rates, model.x)
    if _uncoupled(A):
        gain = ca.vertcat(*(held_gain(rate, h) for rate in ca.vertsplit(ca.diag(A))))
        return _with_sampled_states(model, model.x + gain * rates)
    parts = 1 if _fastest(model, A) * h <= LONGEST_HELD_STEP else DWELL_STEPS
    doublings, x = _doublings(model, A, h / parts), model.x
    for _ in range(parts):
        slope, rate = ca.substitute([A, rates], [model.x], [x])
        x = x + increment(slope, [rate], h / parts, doublings)
    return _with_sampled_states(model, x)


def jumps(model: Model, x_then: ca.SX) -> bool:
    """Whether states that have come to `x_then` remember the displacement of a stage in balance that its drives put elsewhere at once, and
    do not act on it."""
    if model.inertial or not ca.depends_on(model.balance, model.u):
        return False
    remember = [i for i in range(model.x.numel()) if i not in model.stepped and ca.depends_on(x_then[i], model.z)]
    return bool(remember) and not ca.depends_on(model.balance, model.x[remember])


def at_displacement(model: Model, x_then: ca.SX, displaced: ca.SX) -> ca.SX:
    """`x_then`, after a sample, with what has rates (creep, lags of readings) at the displacement `displaced` [SI] that the drive gives the
    stage in the whole sample, for that of the sample before, model.z, which states that change once a sample keep."""
    return _with_sampled_states(model, ca.substitute(x_then, model.z, displaced))


def driven_step(model: Model, sample_time: float) -> ca.SX:
    """`held_step` where model.z is the displacement before the drive acts, and what remembers it is given that under the drive."""
    x = held_step(model, sample_time)
    return at_displacement(model, x, balanced(model, x, model.u, JUMP_NEWTON_STEPS)) if jumps(model, x) else x


def varied_step(model: Model, sample_time: ca.SX, longest: float, rates: ca.SX) -> ca.SX:
    """`held_step` of states that do not act on one another (`acts_alone`), over a `sample_time` [s] that is a symbol: at most `longest`."""
    A = ca.jacobian(rates, model.x)
    gain = ca.vertcat(*(varied_gain(rate, sample_time, longest) for rate in ca.vertsplit(ca.diag(A))))
    return _with_sampled_states(model, model.x + gain * rates)


def acts_alone(model: Model) -> bool:
    """Whether no state's rate depends on another state, so that each has an exponential of its own."""
    return _uncoupled(ca.jacobian(model.rates_of_heat, model.x))


def _ramp_step(model: Model, sample_time: float, u_next: ca.SX, newton_steps: int, root: Root) -> ca.SX:
    """x after a sample in which the drive goes linearly from u to `u_next` and the balanced displacement with it.

    x + h (phi_1(hA) f_0 + phi_2(hA) f' + phi_3(hA) f''), f' and f'' those of the parabola through the rates at the present x
    under the drive at the beginning, the middle and the end of the sample. Exact for rates linear in x and quadratic in u.
    Where the rates depend on the displacement, A includes what x does through it: df/dx - df/dz (dg/dz)^-1 dg/dx.
    """
    A, h = ca.jacobian(model.rates, model.x), sample_time
    through_z = ca.depends_on(model.rates, model.z)
    if through_z:
        z_by_x = ca.solve(ca.jacobian(model.balance, model.z), ca.jacobian(model.balance, model.x))
        A -= ca.mtimes(ca.jacobian(model.rates, model.z), z_by_x)

    def rates_at(share: float) -> ca.SX:
        u = model.u + share * (u_next - model.u)
        z = balanced(model, model.x, u, newton_steps, root) if through_z else model.z
        return ca.substitute(model.rates, ca.vertcat(model.z, model.u), ca.vertcat(z, u))

    followed = ca.vertcat(model.rates, model.balance) if through_z else model.rates
    first = model.rates
    if any(ca.which_depends(followed, ca.vertcat(model.u, model.z), 2, True)):  # not linear in the drive
        middle, last = rates_at(0.5), rates_at(1.0)
        values = [first, 4 * middle - 3 * first - last, 4 * (first - 2 * middle + last)]
    else:
        values = [first, rates_at(1.0) - first]
    lags = _uncoupled(A)
    step = lag_increment(ca.diag(A), values, h) if lags else increment(A, values, h, _doublings(model, A, h))
    return _with_sampled_states(model, model.x + step)


def _with_sampled_states(model: Model, x: ca.SX) -> ca.SX:
    """`x` with the states that change once a sample at their new values."""
    for i, value in model.stepped.items():
        x[i] = value
    return x


def _uncoupled(A: ca.SX) -> bool:
    """Whether no state's rate depends on another state."""
    return (A.sparsity() + ca.Sparsity.diag(A.size1())).is_diag()


def _fastest(model: Model, A: ca.SX) -> float:
    """|A| [1/s] at rest, in the states' typical sizes."""
    at_rest = ca.Function("A", [model.x, model.z, model.u, model.p], [A])(model.rest, 0, 0, model.p_nominal)
    return float(ca.norm_inf(at_rest * (model.x_scale[None, :] / model.x_scale[:, None])))


def _doublings(model: Model, A: ca.SX, h: float) -> int:
    """How often the sample time `h` [s] must be halved until |h A| is at most 1, at rest; refuses |h A| above `LONGEST_STEP`."""
    norm = _fastest(model, A)
    if h * norm > LONGEST_STEP:
        what = f"{h:g} s is too long for the fastest coupled state; use {LONGEST_STEP / norm:.2g} s or less"
        raise InputError(model.name, [Fault("sample time", what)])
    return max(0, ceil(log2(h * norm))) if norm else 0


def balanced(model: Model, x: ca.SX, u: ca.SX, newton_steps: int = NEWTON_STEPS, root: Root = newton_root) -> ca.SX:
    """The displacement (n_axes,) that balances the forces at `x` and `u`, by Newton's method from model.z, written out by `root`.

    `x` may be an expression in model.z. One step where the balance is linear in z.
    """
    # Both at once: x may hold the drive of the sample before
    balance = ca.substitute(model.balance, ca.vertcat(model.x, model.u), ca.vertcat(x, u))
    return root(balance, model.z, model.z, steps_needed(balance, model.z, newton_steps))


def _settle(model: Model, u: ca.SX, newton_steps: int, root: Root) -> tuple[ca.SX, ca.SX]:
    """x at rest under `u`, and the displacement that balances with it.

    Newton's method by blocks: only states that act on one another are solved together, in `SETTLING_SWEEPS` sweeps, since a
    memory such as a play operator has no rate of its own to solve for.
    """
    rates = ca.substitute(model.rates, model.u, u)
    A = ca.jacobian(rates, model.x)
    x, blocks = model.x, _coupled_blocks(A)
    for _ in range(SETTLING_SWEEPS):
        slope, rate = (ca.substitute(e, model.x, x) for e in (A, rates))
        corrected = ca.SX(x)
        for block in blocks:
            corrected[block] = x[block] - ca.solve(slope[block, block], rate[block])
        x = corrected
    for i, value in model.resting.items():
        x[i] = ca.substitute(value, model.u, u)
    z = balanced(model, x, u, newton_steps, root)
    x = ca.substitute(x, model.z, z)
    for i in model.clocks:
        x[i] = model.x[i] + 1.0
    for i in model.stepped.keys() - model.resting.keys():
        x[i] = ca.substitute(model.stepped[i], ca.vertcat(model.z, model.u), ca.vertcat(z, u))
    return x, z


def _coupled_blocks(A: ca.SX) -> list[list[int]]:
    """Places of the states that come to rest; those that act on one another (the two of a second-order filter) together."""
    sparsity = A.sparsity()
    acts_on = np.zeros(A.shape, dtype=bool)
    acts_on[sparsity.row(), sparsity.get_col()] = True
    count, label = scipy.sparse.csgraph.connected_components(acts_on, connection="strong")
    blocks = [np.flatnonzero(label == k).tolist() for k in range(count)]
    return [block for block in blocks if len(block) > 1 or acts_on[block[0], block[0]]]


def _integrate(model: Model, sample_time: float, u_next: ca.SX, linear: bool, finer: int) -> tuple[ca.SX, ca.SX]:
    """x and z one sample on, with inertia, by the steps of the model's integrator."""
    state = ca.vertcat(model.x, model.z)
    integrator = integrator_of(model, sample_time, finer)
    p, ambient = model.p, model.ambient_symbol
    nonlinear = ca.Function("N", [state, model.u, model.held, p, ambient], [integrator.nonlinear_rates(model)])

    def N(y: ca.SX, u: ca.SX) -> ca.SX:
        return nonlinear(y, u, model.held_value, p, ambient)

    y = state
    for u, u_end in pairwise(integrator.drives(model.u, u_next, linear)):
        y = integrator.step(N, y, u, u_end)
    return _with_sampled_states(model, y[: model.x.numel()]), y[model.x.numel() :]


def settling_time(model: Model) -> float:
    """How long [s] actuators and stage keep moving after a change of drive, to a millionth of the change; by the slopes near
    rest. 0 where nothing lags."""
    A = _slopes_near_rest(model)
    decay = np.abs(np.linalg.eigvals(A).real) if model.inertial else np.abs(np.diag(A)[: model.n_states])
    decay = decay[decay > SLOWEST_RATE]
    return float(SETTLING_TIME_CONSTANTS / decay.min()) if decay.size else 0.0


def shortest_half_period(model: Model) -> float:
    """Half a period [s] of the fastest mode of a model with inertia, by the slopes near rest; infinite where nothing oscillates."""
    fastest = float(np.abs(np.linalg.eigvals(_slopes_near_rest(model)).imag).max(initial=0.0))
    return np.pi / fastest if model.inertial and fastest else np.inf


def _slopes_near_rest(model: Model) -> np.ndarray:
    """Derivatives of the rates by the states; of a stage with inertia by its displacement too."""
    rates, state = model.rates, model.x
    if model.inertial:
        rates, state = ca.vertcat(model.rates, model.v), ca.vertcat(model.x, model.z)
    slope = ca.Function("A", [model.x, model.z, model.u, model.p, model.ambient_symbol], [ca.jacobian(rates, state)])
    return np.asarray(slope(model.rest, NEAR_HOME * model.z_scale, 0, model.p_nominal, 0).full())

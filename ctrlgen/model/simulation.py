"""Model and drives -> signals over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import casadi as ca
import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError, SolverError
from ctrlgen.core.tabular import Column, Drawn, Tabular
from ctrlgen.core.units import from_si
from ctrlgen.devices import Signal
from ctrlgen.model.discretisation import at_displacement, held_step, jumps, one_step_map
from ctrlgen.model.model import Model
from ctrlgen.numerics.batched_evaluation import evaluate, in_blocks
from ctrlgen.numerics.newton import newton_solver

PERIODIC = 1e-9  # typical sizes by which a period may end elsewhere than it began
MOST_NEWTON_STEPS = 50  # from a displacement far off; the sample before needs three


@dataclass(frozen=True, repr=False)
class Trace(Tabular, Drawn):
    """Signals of a model at sample times, SI: `time` (n,) [s]; `signals` name -> (n, channels); `x` (n, n_x); `z` (n, n_axes).
    `described`: the channels and units of the signals by their names."""

    time: np.ndarray
    signals: dict[str, np.ndarray]
    x: np.ndarray
    z: np.ndarray
    described: Mapping[str, Signal] = field(default_factory=dict)

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "samples": len(self.time),
            "length": f"{self.time[-1]:.6g} s" if len(self.time) else "none",
            "signals": ", ".join(self.signals),
        }

    def columns(self) -> tuple[Column, ...]:
        """Time, then a column a channel, named role.channel, in the unit of its signal."""
        return (
            Column("time", "s", self.time),
            *(
                Column(f"{role}.{channel}", unit, from_si(self.signals[role][:, i], unit))
                for role, signal in self.described.items()
                for i, (channel, unit) in enumerate(zip(signal.channels, signal.units, strict=True))
            ),
        )


def first_samples(of: Trace, n: int) -> Trace:
    """The first n samples of a trace."""
    return Trace(of.time[:n], {k: v[:n] for k, v in of.signals.items()}, of.x[:n], of.z[:n], of.described)


def trace(model: Model, time: np.ndarray, x: np.ndarray, z: np.ndarray, u: np.ndarray) -> Trace:
    """Every signal at given states x (n, n_x), displacements z (n, n_axes) and drives u (n, n_u), SI."""
    n = len(time)
    values = evaluate(model.evaluate.map(n), x, z, u, np.tile(model.p_nominal, (n, 1)))
    return Trace(time, dict(zip(model.signals, map(np.asfortranarray, values), strict=True)), x, z, model.signals)


def balance_solver(model: Model) -> ca.Function:
    """(z_guess, x, u, p) -> z with balance(x, z, u, p) = 0, by Newton's method; RuntimeError where it finds none."""
    scaled = ca.substitute(model.balance, model.z, model.z * model.z_scale) / model.force_scale
    given = ca.vertcat(model.x, model.u, model.p)
    newton = newton_solver(f"{model.name}_balance", scaled, model.z, given, most_steps=MOST_NEWTON_STEPS)
    z, x, u, p = (ca.MX.sym(n, s.numel()) for n, s in (("z", model.z), ("x", model.x), ("u", model.u), ("p", model.p)))
    root = newton(z / model.z_scale, ca.vertcat(x, u, p)) * model.z_scale
    return ca.Function("balance", [z, x, u, p], [root])


def simulate(
    model: Model, u: np.ndarray, sample_time: float, x_0: np.ndarray | None = None, z_0: np.ndarray | None = None
) -> Trace:
    """The model driven by `u` (n, n_u) [SI], each row held for one `sample_time` [s].

    It starts at rest unless `x_0` (n_x,) is given, and at the displacement that balances the first drive, with inertia
    at home, unless `z_0` (n_axes,) is given. Sample k of the result is the state at k sample_time, before row k of `u`
    acts; there are n + 1 samples, the last with the last drive. Raises SolverError where no displacement balances the
    force, or where the motion grows beyond all numbers; InputError for drives of another shape, or that are not finite.
    """
    u = _checked(model, u, sample_time)
    if model.inertial:
        return _simulate_inertial(model, u, sample_time, x_0, z_0)
    steps, p = len(u), ca.DM(model.p_nominal)
    balance, one = _balanced_step(model, sample_time)
    start_x = model.rest if x_0 is None else x_0
    try:
        start_z = balance(model.z_scale, start_x, u[0], p) if z_0 is None else ca.DM(z_0)
        start = ca.vertcat(start_x, start_z).full().ravel()
        states = in_blocks(one, start, u)
    except RuntimeError as error:
        raise SolverError(
            "no stage displacement balances the actuator force; check the drive and the stiffness"
        ) from error
    if not np.all(np.isfinite(states)):
        raise SolverError("the simulated states are not finite; check the drive against the device's limits")
    states = np.vstack([start, states])
    drives = np.vstack([u, u[-1:]])
    n = model.x.numel()
    return trace(model, sample_time * np.arange(steps + 1), states[:, :n], states[:, n:], drives)


@lru_cache(maxsize=16)  # a player is measured, and a budget drawn, on one model many times
def _balanced_step(model: Model, sample_time: float) -> tuple[ca.Function, ca.Function]:
    """`balance_solver`, and (x and z, u) -> x and z one sample later, in balance."""
    x, z, u = (ca.MX.sym(n, s.numel()) for n, s in (("x", model.x), ("z", model.z), ("u", model.u)))
    p, balance = ca.DM(model.p_nominal), balance_solver(model)
    given, held = [model.x, model.z, model.u, model.p], held_step(model, sample_time)
    x_next = ca.Function("step", given, [held])(x, z, u, p)
    z_next = balance(z, x_next, u, p)
    if jumps(model, held):
        there = ca.SX.sym("there", model.z.numel())
        x_next = ca.Function("there", [*given, there], [at_displacement(model, held, there)])(x, z, u, p, z_next)
    return balance, ca.Function("one", [ca.vertcat(x, z), u], [ca.vertcat(x_next, z_next)])


def _checked(model: Model, u: np.ndarray, sample_time: float) -> np.ndarray:
    """The drives (n, n_u), of the right shape and finite."""
    drives = np.asarray(u, dtype=float)
    channels = model.signals["drive"].channels
    faults = []
    if drives.ndim != 2 or drives.shape[1] != len(channels) or not len(drives):
        what = f"has the shape {drives.shape}; (n, {len(channels)}) is needed: a row a sample, a column a drive ({', '.join(channels)})"
        faults.append(Fault("u", what))
    elif not np.isfinite(drives).all():
        faults.append(
            Fault(
                "u",
                f"holds {number_of(int(np.sum(~np.isfinite(drives))), 'number that is', 'numbers that are')} not finite",
            )
        )
    if not 0 < sample_time < np.inf:
        faults.append(Fault("sample_time", f"is {sample_time!r}; seconds above zero are needed"))
    if faults:
        raise InputError(f"simulate {model.name}", faults)
    return drives


def _simulate_inertial(
    model: Model, u: np.ndarray, sample_time: float, x_0: np.ndarray | None, z_0: np.ndarray | None
) -> Trace:
    """`simulate` for a stage with inertia, from standstill at home."""
    n = model.x.numel()
    start = np.concatenate([model.rest if x_0 is None else x_0, 0 * model.z_scale if z_0 is None else z_0])
    after = one_step_map(model, sample_time)
    step = ca.Function("step", [ca.vertcat(model.x, model.z), model.u, model.p], [ca.vertcat(after.x, after.z)])
    state, u_k = (ca.MX.sym(n, step.numel_in(i)) for i, n in enumerate(("state", "u")))
    one = ca.Function("one", [state, u_k], [step(state, u_k, ca.DM(model.p_nominal))])
    states = in_blocks(one, start, u)
    if not np.all(np.isfinite(states)):
        raise SolverError("the simulated motion is not finite; check the drive, and the device's damping")
    states = np.vstack([start, states])
    return trace(model, sample_time * np.arange(len(u) + 1), states[:, :n], states[:, n:], np.vstack([u, u[-1:]]))


def periodic_start(model: Model, u: np.ndarray, sample_time: float, begin: np.ndarray) -> tuple[np.ndarray, int]:
    """(x, z) (n_x + n_axes,) of a `model` with inertia from which the held drives `u` (n, n_u) [SI] lead back to it, begun at `begin`, and
    how many steps of Newton's method that took. Raises SolverError where none is found, as with undamped modes."""
    after, y = one_step_map(model, sample_time), ca.vertcat(model.x, model.z)
    step = ca.vertcat(after.x, after.z)
    size, turns = y.numel(), ca.SX.sym("S", y.numel(), y.numel())  # slopes by the start
    slopes = ca.mtimes(ca.jacobian(step, y), turns)
    one = ca.Function(
        "one", [ca.vertcat(y, ca.vec(turns)), model.u, model.p], [ca.vertcat(step, ca.vec(slopes))], {"cse": True}
    )
    along, p = one.mapaccum(len(u)), np.tile(model.p_nominal[:, None], (1, len(u)))
    scale, start = np.concatenate([model.x_scale, model.z_scale]), begin
    for iteration in range(1, MOST_NEWTON_STEPS + 1):
        end = along(np.concatenate([start, np.eye(size).ravel()]), u.T, p).full()[:, -1]
        slope = end[size:].reshape(size, size).T
        try:
            change = np.linalg.solve(np.eye(size) - slope, end[:size] - start)
        except np.linalg.LinAlgError:
            break
        start = start + change
        if not np.all(np.isfinite(start)):
            break
        if np.abs(change / scale).max() < PERIODIC:
            return start, iteration
    raise SolverError("no periodic motion under these drives was found; give the device damping, or make the path open")

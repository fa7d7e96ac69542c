"""Scenario -> drives: one nonlinear programme over the whole trajectory, solved by IPOPT.

    minimise    1/2 sum_k |s_k|^2
    subject to  followed(x_k, z_k, u_k-1) = command_k + s_k      pose (or displacement), s_k the shortfall
                g(x_k, z_k, u_k-1) = 0                           force balance of the stage
                x_k+1 = step(x_k, z_k, u_k)                      actuator dynamics (static: rates = 0)
                every limit of the device

in variables divided by their typical size; derivatives are exact and sparse. Closed paths are
periodic; open ones start in equilibrium at their first sample and hold the last one. With s = 0 the
trajectory is followed; otherwise the solution is the nearest one and `solve` says so.
Reference: A. Waechter, L. T. Biegler, Math. Program. 106 (2006) 25 (IPOPT).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.controller import Controller
from ctrlgen.errors import SolverError, Unreachable
from ctrlgen.model import Limit, Model, Signal
from ctrlgen.scenario import Scenario
from ctrlgen.simulate import Trace, trace
from ctrlgen.units import from_si, show

REACHED = 1e-5  # shortfall, in typical sizes (1 um, or 1 um at the platform's rim), that counts as none: 0.01 nm
WEIGHT = 1e6  # of the shortfall against the barrier, which otherwise pushes it off an active bound by sqrt(mu)
KEPT = 1e-7  # of a limit: what IPOPT's relaxed bounds (1e-8) may leave


@dataclass(frozen=True)
class Margin:
    """Distance of a limited quantity to its nearer bound: `value` where it is closest, all SI.

    `share` is the distance over the admissible range (over the bound itself where only one is given; None
    for a one-sided bound at zero).
    """

    limit: Limit
    channel: str
    sample: int
    value: float
    bound: float
    distance: float
    share: float | None


@dataclass(frozen=True)
class Shortfall:
    """What keeps a trajectory from being followed: samples, and the nearest admissible trajectory."""

    samples: tuple[int, ...]
    worst: int
    command: np.ndarray
    nearest: np.ndarray


@dataclass(frozen=True)
class Solution:
    """A solved scenario, SI. `trace` holds the samples; `drive` (n, axes) acts from sample k to k + 1."""

    scenario: Scenario
    model: Model
    command: np.ndarray
    trace: Trace
    drive: np.ndarray
    margins: tuple[Margin, ...]
    iterations: int
    rows_added: tuple[str, ...]

    @property
    def tightest(self) -> Margin:
        """The limit that leaves least of its range."""
        return min((m for m in self.margins if m.share is not None), key=lambda m: m.share or 0.0)


def solve(scenario: Scenario, model: Model, progress: Callable[[str], None] = lambda _: None) -> Solution:
    """The drives of `scenario`. Raises Unreachable when it cannot be followed, SolverError when IPOPT fails.

    Composite limits (stress, rotation) are first left out; those that the solution breaks are added and
    the problem is solved again. A relaxed optimum that keeps all limits is the optimum.
    """
    command = scenario.command(model)
    programme = _Programme(model, scenario, command)
    rows: list[Limit] = []
    while True:
        progress(f"IPOPT, {len(command)} samples" + (f", with {', '.join(r.label for r in rows)}" if rows else ""))
        result = programme.run(rows)
        short = np.linalg.norm(result.shortfall, axis=1)
        if short.max() > REACHED:
            raise _unreachable(scenario, model, command, result, short, rows)
        margins = _margins(model, result)
        broken = [m.limit for m in margins if m.distance < -KEPT * max(abs(m.bound), abs(m.value)) and m.limit not in rows]
        if not broken:
            return Solution(
                scenario, model, command, result.trace, result.u, tuple(margins), result.iterations, tuple(r.name for r in rows)
            )
        rows += broken


@dataclass(frozen=True)
class _Result:
    x: np.ndarray
    z: np.ndarray
    u: np.ndarray
    shortfall: np.ndarray
    trace: Trace
    iterations: int


class _Programme:
    """The nonlinear programme of one scenario; `run` solves it with a choice of composite limits."""

    def __init__(self, model: Model, scenario: Scenario, command: np.ndarray) -> None:
        self.model, self.scenario, self.command = model, scenario, command
        self.signal = model.signals[scenario.file.follow]
        self.n = len(command)
        self.sizes = (model.x.numel(), model.z.numel(), model.u.numel(), self.signal.expr.numel())

    def _rows(self, limits: Sequence[Limit]) -> tuple[ca.Function, np.ndarray, np.ndarray]:
        """One sample's constraints (x, z, u_before, u, s, x_next, command) and their bounds."""
        m, h = self.model, self.scenario.sample_time
        x, z, v, u, s, x_1 = (
            ca.SX.sym(name, size) for name, size in zip("xzvusX", [*self.sizes[:2], self.sizes[2], *self.sizes[2:], self.sizes[0]], strict=True)
        )
        wanted = ca.SX.sym("c", self.sizes[3])
        physical = (x * m.x_scale + m.rest, z * m.z_scale)

        def at(expression: ca.SX, drive: ca.SX) -> ca.SX:
            values = ca.vertcat(*physical, drive * m.u_scale, ca.DM(m.p_nominal))
            return ca.substitute(expression, ca.vertcat(m.x, m.z, m.u, m.p), values)

        motion = at(m.rates, u) / m.x_scale if h is None else x_1 - (at(m.step(h), u) - m.rest) / m.x_scale
        equal = [at(self.signal.expr, v) / self.signal.scale - wanted - s, at(m.balance, v) / m.force_scale, motion]
        low, high, rows = [np.zeros(e.numel()) for e in equal], [np.zeros(e.numel()) for e in equal], list(equal)
        for limit in limits:
            unit = limit.upper or m.force_scale
            rows.append(at(limit.expr, v) / unit)
            low.append(np.full(limit.expr.numel(), -np.inf if limit.lower is None else limit.lower / unit))
            high.append(np.full(limit.expr.numel(), np.inf if limit.upper is None else limit.upper / unit))
        function = ca.Function("sample", [x, z, v, u, s, x_1, wanted], [ca.vertcat(*rows)], {"cse": True})
        return function, np.concatenate(low), np.concatenate(high)

    def run(self, limits: Sequence[Limit]) -> _Result:
        m, n, static, closed = self.model, self.n, self.scenario.sample_time is None, self.scenario.closed
        rows, row_low, row_high = self._rows(limits)
        variables = ca.MX.sym("w", sum(self.sizes), n)
        X, Z, U, S = ca.vertsplit(variables, list(np.cumsum([0, *self.sizes])))
        extra, extra_low, extra_high, extra_rows = [], [], [], []
        if static:
            U_before, X_next = U, X
        elif closed:
            U_before, X_next = ca.horzcat(U[:, -1], U[:, :-1]), ca.horzcat(X[:, 1:], X[:, 0])
        else:  # settled before the first sample by u_start; the last pose is held for one more sample
            u_start, x_end = ca.MX.sym("u0", self.sizes[2]), ca.MX.sym("x1", self.sizes[0])
            U_before, X_next = ca.horzcat(u_start, U[:, :-1]), ca.horzcat(X[:, 1:], x_end)
            extra = [u_start, x_end]
            settled = m.dynamics(X[:, 0] * m.x_scale + m.rest, Z[:, 0] * m.z_scale, u_start * m.u_scale, ca.DM(m.p_nominal))[0]
            acting = len(m.axes)
            extra_rows = [settled / m.x_scale, x_end[:acting] - X[:acting, -1]]
            (xl, xh), (ul, uh) = self._bounds("x"), self._bounds("u")
            extra_low, extra_high = [ul, xl], [uh, xh]
        command = self.command / self.signal.scale
        G = rows.map(n)(X, Z, U_before, U, S, X_next, command.T)
        w, g = ca.vertcat(ca.vec(variables), *extra), ca.vertcat(ca.vec(G), *extra_rows)
        low, high = zip(*(self._bounds(s) for s in "xzus"), strict=True)
        guess = np.concatenate([np.ones(self.sizes[0]), np.ones(self.sizes[1]), np.full(self.sizes[2], 0.2), np.zeros(self.sizes[3])])
        start = [np.tile(guess, n)] + [np.full(e.numel(), 0.2) for e in extra]
        zeros = np.zeros(sum(e.numel() for e in extra_rows))
        options = {
            "print_time": False,
            "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-10, "mu_strategy": "adaptive", "max_iter": 300, "nlp_scaling_method": "none"},
        }
        solver = ca.nlpsol("trajectory", "ipopt", {"x": w, "f": 0.5 * WEIGHT * ca.sumsqr(S), "g": g}, options)
        answer = solver(
            x0=np.concatenate(start),
            lbx=np.concatenate([np.tile(np.concatenate(low), n), *extra_low]),
            ubx=np.concatenate([np.tile(np.concatenate(high), n), *extra_high]),
            lbg=np.concatenate([np.tile(row_low, n), zeros]),
            ubg=np.concatenate([np.tile(row_high, n), zeros]),
        )
        stats = solver.stats()
        if stats["return_status"] == "User_Requested_Stop":
            raise KeyboardInterrupt
        if not stats["success"]:
            raise SolverError(
                f"IPOPT stopped with {stats['return_status']} after {stats['iter_count']} iterations; "
                "the physics may have no solution near the command: check the device's limits and the sample rate"
            )
        values = answer["x"].full().ravel()
        table = values[: n * sum(self.sizes)].reshape(n, -1)
        x, z, u, s = np.split(table, np.cumsum(self.sizes[:3]), axis=1)
        x, z, u = x * m.x_scale + m.rest, z * m.z_scale, u * m.u_scale
        before = u if static else np.vstack([u[-1:] if closed else values[None, table.size : table.size + self.sizes[2]] * m.u_scale, u[:-1]])
        time = np.arange(n) * (self.scenario.sample_time or 1.0)
        result = trace(m, time, x, z, u)
        if not static:
            reached = trace(m, time, x, z, before)
            result.signals.update({role: reached.signals[role] for role in ("displacement", "pose", "reading")})
        return _Result(x, z, u, s, result, stats["iter_count"])

    def _bounds(self, symbol: str) -> tuple[np.ndarray, np.ndarray]:
        """Scaled bounds of x, z, u or the shortfall s of one sample."""
        m = self.model
        if symbol == "s":
            return np.full(self.sizes[3], -np.inf), np.full(self.sizes[3], np.inf)
        (low, high), scale, origin = {
            "x": (m.x_bounds, m.x_scale, m.rest), "z": (m.z_bounds, m.z_scale, 0.0), "u": (m.u_bounds, m.u_scale, 0.0),
        }[symbol]  # fmt: skip
        return (low - origin) / scale, (high - origin) / scale


def _margins(model: Model, result: _Result) -> list[Margin]:
    """The smallest distance to each side of each limit, one Margin per limit."""
    n = len(result.u)
    values = model.evaluate_limits.map(n)(result.x.T, result.z.T, result.u.T, np.tile(model.p_nominal[:, None], (1, n)))
    margins = []
    for limit, value in zip(model.limits, values, strict=True):
        table = value.full().T
        sides = []
        for bound, sign in ((limit.lower, 1.0), (limit.upper, -1.0)):
            if bound is None:
                continue
            distance = sign * (table - bound)
            k, i = np.unravel_index(int(np.argmin(distance)), distance.shape)
            span = (limit.upper - limit.lower) if limit.lower is not None and limit.upper is not None else abs(bound)
            share = float(distance[k, i]) / span if span else None
            sides.append(Margin(limit, limit.channels[i], int(k), float(table[k, i]), bound, float(distance[k, i]), share))
        margins.append(min(sides, key=lambda side: side.distance))
    return margins


def _unreachable(
    scenario: Scenario, model: Model, command: np.ndarray, result: _Result, short: np.ndarray, rows: Sequence[Limit]
) -> Unreachable:
    """An error that says which samples, which actuators, by how much, and what is nearest."""
    signal = model.signals[scenario.file.follow]
    samples = tuple(int(k) for k in np.flatnonzero(short > REACHED))
    worst = int(np.argmax(short))
    nearest = result.trace.signals[scenario.file.follow]
    kernel = Controller(model, scenario.file.follow, None).static.displacement
    needed = kernel.map(len(command))(result.x.T, result.z.T, command.T).full().T
    low, high = model.z_bounds
    lines = [f"cannot follow {len(samples)} of {len(command)} samples; the worst is sample {worst}: {_point(signal, command[worst])}"]
    causes = []
    for i, axis in enumerate(model.axes):
        bad = np.flatnonzero((needed[:, i] < low[i] - 1e-12) | (needed[:, i] > high[i] + 1e-12))
        if bad.size:
            k = int(bad[np.argmax(np.maximum(low[i] - needed[bad, i], needed[bad, i] - high[i]))])
            value = needed[k, i]
            why = "the actuator only pushes" if value < low[i] else "its stroke ends there"
            bound = low[i] if value < low[i] else high[i]
            causes.append(
                f"  actuator {axis}: needs {show(value, 'um')}, {show(abs(value - bound), 'um')} beyond {show(bound, 'um')} ({why}), "
                f"worst at sample {k}, in {bad.size} of {len(command)}"
            )
    if not causes:
        causes += _dynamic_causes(model, result, samples) + [f"  {limit.label} is at its limit of {show(limit.upper or 0.0, limit.unit)}" for limit in rows]
    lines += causes or ["  the limits of several actuators together"]
    lines.append(f"  nearest reachable there: {_point(signal, nearest[worst])}")
    lines.append("  move or shrink the path (a hexapod that only pushes needs height first: raise delta_z), or slow it down")
    return Unreachable("\n".join(lines), Shortfall(samples, worst, command, nearest))


def _dynamic_causes(model: Model, result: _Result, samples: Sequence[int]) -> list[str]:
    """Actuators whose drive or state sits on a bound around the samples that fall short."""
    around = sorted({max(k + shift, 0) for k in samples for shift in (-1, 0)})
    causes = []
    for values, bounds, what, low_reason in (
        (result.u, model.u_bounds, model.signals["drive"], "it cannot cool faster than passively"),
        (result.x[:, : len(model.axes)], model.x_bounds, model.signals["state"], "it cannot go below ambient"),
    ):
        low, high = bounds
        for i, axis in enumerate(model.axes):
            for bound, reason in ((low[i], low_reason), (high[i], "that is its maximum")):
                if np.isfinite(bound) and np.any(np.abs(values[around, i] - bound) < 1e-6 * max(abs(high[i]), abs(low[i]))):
                    causes.append(f"  actuator {axis}: {what.label} is held at {show(bound, what.units[i])}; {reason}")
    return causes


def _point(signal: Signal, values: np.ndarray) -> str:
    """A sample with its non-zero channels in the reader's units."""
    parts = [
        f"{c} = {from_si(v, u):.4g} {u}" for c, u, v in zip(signal.channels, signal.units, values, strict=True)
        if abs(v) > 1e-6 * signal.scale[signal.channels.index(c)]
    ]  # fmt: skip
    return ", ".join(parts) or "home"

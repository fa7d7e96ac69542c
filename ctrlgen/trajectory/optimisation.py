"""Trajectory optimisation: scenario -> drives by one nonlinear programme over the whole trajectory, solved by IPOPT.

    minimise    1/2 sum_k |s_k|^2
    subject to  followed(x_k, z_k, u_k-1) = command_k + s_k      pose (or displacement); s_k is a slack
                g(x_k, z_k, u_k-1) = 0                           force balance of the stage
                x_k+1 = step(x_k, z_k, u_k)                      actuator dynamics (static: rates = 0)
                every limit of the device, those on the rate of a drive as bounds of u_k - u_k-1

in variables divided by their typical sizes; derivatives are exact and sparse. Closed paths are periodic; open ones
start in equilibrium at their first sample. With s = 0 the trajectory is followed; otherwise the solution is the nearest
admissible one, and `solve` raises Unreachable. IPOPT begins at the inverse of the path (`path_inverse`). Where that satisfies all
equations within the limits it is an optimum without IPOPT: the slack is zero, so the cost has no slope there and all multipliers vanish.
Reference: A. Waechter, L. T. Biegler, Math. Program. 106 (2006) 25 (IPOPT).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ctrlgen.core.errors import SolverError
from ctrlgen.devices import Limit
from ctrlgen.model.discretisation import driven_step
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import Trace, trace
from ctrlgen.numerics.ipopt import IpoptOptions, NonlinearProgramme, solve_nlp
from ctrlgen.trajectory.inverse.clock import Clock, Sampled, Settled
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.inverse.path_inverse import InverseTrajectory
from ctrlgen.trajectory.inverse.violations import Before, violations

SLACK_WEIGHT = 1e8  # against IPOPT's barrier, which otherwise keeps the solution sqrt(mu) off an active bound
OPTIONS = IpoptOptions(
    tol=1e-10,
    max_iter=120,
    mu_strategy="adaptive",
    nlp_scaling_method="none",
    # IPOPT relaxes the bounds by 1e-8 while it works
    honor_original_bounds="yes",
)
# From a solution that only needs confirming: where kinks keep IPOPT from it, more iterations do not help.
FROM_EXACT = replace(OPTIONS, max_iter=30)
DRIVE_GUESS = 0.2  # of its typical size, where IPOPT begins
# Samples that IPOPT solves for where the inverse of the path says the same. It takes about 0.8 ms and 60 kB for each of them (six axes),
# 3 s and 0.4 GB for so many.
MOST_CONFIRMED = 4000
# Typical sizes by which equations may be unsatisfied in a solution that IPOPT has not confirmed: 1 fm of a micrometre, and what
# memories may be off after the period that they repeat (`balanced.REPEATS`); Newton's method leaves 1e-12
SATISFIED = 1e-9


@dataclass(frozen=True)
class OptimisationResult:
    """IPOPT's solution in SI, one row a sample: states `x`, displacements `z`, drives `u`, those held `before` where time passes, and
    their `trace`.

    `unreachable_by`: the slack, by which the followed signal is off the command, in its typical sizes.
    """

    x: np.ndarray
    z: np.ndarray
    u: np.ndarray
    before: Before | None
    unreachable_by: np.ndarray
    trace: Trace
    iterations: int


class TrajectoryProgramme:
    """The nonlinear programme of one path, the `motion` of the signal `follow` whose samples are where the `clock` says; `run` solves it
    with the composite limits that are chosen."""

    def __init__(self, model: Model, follow: str, motion: Motion, clock: Clock) -> None:
        self.model, self.clock, self.closed = model, clock, motion.closed
        self.signal = model.signals[follow]
        self.n_command, self.command = len(motion), motion.position
        if isinstance(clock, Sampled) and not motion.closed:
            # an open path is held for one more sample, so that its last drive is determined
            self.command = np.vstack([self.command, self.command[-1:]])
        self.n = len(self.command)
        self.sizes = (model.x.numel(), model.z.numel(), model.u.numel(), self.signal.expr.numel())

    def _rows(self, limits: Sequence[Limit]) -> tuple[ca.Function, np.ndarray, np.ndarray]:
        """One sample's constraints (x, z, u_before, u, s, x_next, command) and their bounds."""
        m, clock = self.model, self.clock
        x, z, v, u, s, x_1 = (
            ca.SX.sym(name, size)
            for name, size in zip(
                "xzvusX", [*self.sizes[:2], self.sizes[2], *self.sizes[2:], self.sizes[0]], strict=True
            )
        )
        commanded = ca.SX.sym("c", self.sizes[3])
        physical = (x * m.x_scale + m.rest, z * m.z_scale)

        def at(expression: ca.SX, drive: ca.SX) -> ca.SX:
            values = ca.vertcat(*physical, drive * m.u_scale, ca.DM(m.p_nominal))
            return ca.substitute(expression, ca.vertcat(m.x, m.z, m.u, m.p), values)

        if isinstance(clock, Sampled):
            motion = x_1 - (at(driven_step(m, clock.sample_time), u) - m.rest) / m.x_scale
        else:
            motion = at(m.settling, u) / m.x_scale
        equal = [at(self.signal.expr, v) / self.signal.scale - commanded - s, at(m.balance, v) / m.force_scale, motion]
        low, high, rows = [np.zeros(e.numel()) for e in equal], [np.zeros(e.numel()) for e in equal], list(equal)
        for i, limit in zip(m.rate_places, m.rate_limits, strict=True):
            if isinstance(clock, Sampled) and limit.lower is not None and limit.upper is not None:
                rows.append((u[i] - v[i]) * m.u_scale[i] / (clock.sample_time * limit.span))
                low.append(np.array([limit.lower / limit.span]))
                high.append(np.array([limit.upper / limit.span]))
        for limit in limits:
            unit = limit.upper or m.force_scale
            rows.append(at(limit.expr, v) / unit)
            low.append(np.full(limit.expr.numel(), limit.bounds[0] / unit))
            high.append(np.full(limit.expr.numel(), limit.bounds[1] / unit))
        function = ca.Function("sample", [x, z, v, u, s, x_1, commanded], [ca.vertcat(*rows)], {"cse": True})
        return function, np.concatenate(low), np.concatenate(high)

    def run(self, limits: Sequence[Limit], begin: InverseTrajectory | None = None) -> OptimisationResult:
        """IPOPT's solution with the composite `limits` as rows, begun at what the path needs where that is given.

        Raises SolverError, and KeyboardInterrupt on a signal.
        """
        m, n, static, closed = self.model, self.n, isinstance(self.clock, Settled), self.closed
        rows, row_low, row_high = self._rows(limits)
        variables = ca.MX.sym("w", sum(self.sizes), n)
        X, Z, U, S = ca.vertsplit(variables, list(np.cumsum([0, *self.sizes])))
        extra, extra_low, extra_high, extra_rows = [], [], [], []
        if static:
            U_before, X_next = U, X
        elif closed:
            U_before, X_next = ca.horzcat(U[:, -1], U[:, :-1]), ca.horzcat(X[:, 1:], X[:, 0])
        else:  # settled before the first sample by u_start; nothing follows the last
            u_start, x_end = ca.MX.sym("u0", self.sizes[2]), ca.MX.sym("x1", self.sizes[0])
            U_before, X_next = ca.horzcat(u_start, U[:, :-1]), ca.horzcat(X[:, 1:], x_end)
            extra = [u_start, x_end]
            settled = ca.Function("settled", [m.x, m.z, m.u, m.p], [m.starting])(
                X[:, 0] * m.x_scale + m.rest, Z[:, 0] * m.z_scale, u_start * m.u_scale, ca.DM(m.p_nominal)
            )
            extra_rows = [settled / m.x_scale, x_end[: m.n_states, 0] - X[: m.n_states, -1]]
            (xl, xh), (ul, uh) = self._bounds("x"), self._bounds("u")
            extra_low, extra_high = [ul, xl], [uh, xh]
        command = self.command / self.signal.scale
        G = rows.map(n)(X, Z, U_before, U, S, X_next, command.T)
        w, g = ca.vertcat(ca.vec(variables), *extra), ca.vertcat(ca.vec(G), *extra_rows)
        low, high = zip(*(self._bounds(s) for s in "xzus"), strict=True)
        start = self._start(begin, bool(extra))
        zeros = np.zeros(sum(e.numel() for e in extra_rows))
        row_bounds = np.concatenate([np.tile(row_low, n), zeros]), np.concatenate([np.tile(row_high, n), zeros])
        least = np.concatenate([np.tile(np.concatenate(low), n), *extra_low])
        most = np.concatenate([np.tile(np.concatenate(high), n), *extra_high])
        programme = NonlinearProgramme(w, 0.5 * SLACK_WEIGHT * ca.sumsqr(S), g, row_bounds, (least, most))
        solution = solve_nlp(programme, start, FROM_EXACT if begin is not None and begin.exact else OPTIONS)
        if not solution.converged:
            raise SolverError(
                f"IPOPT stopped with {solution.status} after {solution.iterations} iterations; "
                "the model may have no solution near the command: check the device's limits and the sample rate"
            )
        values = solution.unknowns
        table = values[: n * sum(self.sizes)].reshape(n, -1)
        x, z, u, s = np.split(table, np.cumsum(self.sizes[:3]), axis=1)
        x, z, u = x * m.x_scale + m.rest, z * m.z_scale, u * m.u_scale
        before = u
        if not static:
            first = u[-1:] if closed else values[None, table.size : table.size + self.sizes[2]] * m.u_scale
            before = np.vstack([first, u[:-1]])
        keep = slice(0, self.n_command)
        x, z, u, s, before = x[keep], z[keep], u[keep], s[keep], before[keep]
        return self._result(x, z, u, before, s, solution.iterations)

    def optimum(
        self, begin: InverseTrajectory | None = None, progress: Callable[[Sequence[Limit]], None] = lambda _: None
    ) -> tuple[OptimisationResult, list[Limit]]:
        """The solution that keeps every limit, and the composite limits that were added as rows. Raises SolverError.

        Composite limits (stress, rotation) are left out at first; those that the solution breaks are added and the problem is
        solved again. An optimum without them that keeps all of them is the optimum with them. `progress` is called before each.
        """
        rows: list[Limit] = []
        while True:
            progress(rows)
            result = self.run(rows, begin)
            broken = {e.limit.name: e.limit for e in violations(self.model, result.x, result.z, result.u)}
            added = [limit for limit in broken.values() if limit not in rows]
            if not added:
                return result, rows
            rows += added

    def residual(self, needed: InverseTrajectory) -> float:
        """The largest residual of the programme's equations [typical sizes] at what the path needs, with no slack. An open path's last
        drive leads beyond its samples and is not looked at."""
        m, n = self.model, self.n_command
        x, z = (needed.x - m.rest) / m.x_scale, needed.z / m.z_scale
        u, before = needed.u / m.u_scale, needed.drive_before / m.u_scale
        then = x if isinstance(self.clock, Settled) else np.roll(x, -1, axis=0)
        one = self._rows(())[0].map(n)
        command = self.command[:n] / self.signal.scale
        rows = one(x.T, z.T, before.T, u.T, np.zeros((self.sizes[3], n)), then.T, command.T).full()
        rows = np.abs(rows[: self.sizes[3] + self.sizes[1] + self.sizes[0]])  # those after them are of rates
        if self.closed or isinstance(self.clock, Settled):
            return float(rows.max())
        rows[-self.sizes[0] or len(rows) :, -1] = 0.0
        starting = ca.Function("starting", [m.x, m.z, m.u, m.p], [m.starting])
        start = starting(needed.x[0], needed.z[0], needed.u_start, m.p_nominal).full().ravel() / m.x_scale
        return float(max(rows.max(), np.abs(start).max(initial=0.0)))

    def exact(self, needed: InverseTrajectory) -> OptimisationResult:
        """What the path needs as the solution: an optimum where it keeps every limit, as its slack is zero."""
        none, m = np.zeros((self.n_command, self.sizes[3])), self.model
        rounded = ((needed.x, m.x_bounds), (needed.z, m.z_bounds), (needed.u, m.u_bounds))
        x, z, u = (np.clip(values, *bounds) for values, bounds in rounded)
        return self._result(x, z, u, needed.drive_before, none, 0)

    def _result(
        self, x: np.ndarray, z: np.ndarray, u: np.ndarray, before: np.ndarray, slack: np.ndarray, iterations: int
    ) -> OptimisationResult:
        """The result, with the signals that follow the drive `before` each sample where the path is in time."""
        result = trace(self.model, self.clock.times(len(x)), x, z, u)
        if isinstance(self.clock, Settled):
            return OptimisationResult(x, z, u, None, slack, result, iterations)
        reached = trace(self.model, result.time, x, z, before)
        result.signals.update({role: reached.signals[role] for role in ("displacement", "pose", "reading")})
        return OptimisationResult(x, z, u, Before(before, self.clock.sample_time), slack, result, iterations)

    def _start(self, begin: InverseTrajectory | None, starts_settled: bool) -> np.ndarray:
        """The scaled unknowns from which IPOPT begins, inside the bounds."""
        m = self.model
        if begin is None or not all(np.all(np.isfinite(v)) for v in (begin.x, begin.z, begin.u)):
            guess = [np.ones(self.sizes[0]), np.ones(self.sizes[1]), np.full(self.sizes[2], DRIVE_GUESS)]
            rows = np.tile(np.concatenate([*guess, np.zeros(self.sizes[3])]), self.n)
            return np.concatenate([rows, np.full((self.sizes[2] + self.sizes[0]) * starts_settled, DRIVE_GUESS)])
        last = np.minimum(np.arange(self.n), self.n_command - 1)
        scaled = ((begin.x - m.rest) / m.x_scale, begin.z / m.z_scale, begin.u / m.u_scale)
        slack = np.zeros((self.n, self.sizes[3]))
        rows = np.concatenate([*(v[last] for v in scaled), slack], axis=1).ravel()
        return np.concatenate([rows, begin.u_start / m.u_scale, scaled[0][-1]]) if starts_settled else rows

    def _bounds(self, symbol: str) -> tuple[np.ndarray, np.ndarray]:
        """Scaled bounds of x, z, u or the slack s of one sample."""
        m = self.model
        if symbol == "s":
            return np.full(self.sizes[3], -np.inf), np.full(self.sizes[3], np.inf)
        (low, high), scale, origin = {
            "x": (m.x_bounds, m.x_scale, m.rest),
            "z": (m.z_bounds, m.z_scale, 0.0),
            "u": (m.u_bounds, m.u_scale, 0.0),
        }[symbol]
        return (low - origin) / scale, (high - origin) / scale

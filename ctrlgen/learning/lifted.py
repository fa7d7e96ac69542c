"""One run of a path as one function of its drives: the lifted system, and its linearisation along the path.

S_k = (x, z) at sample k follows from the state before it and the drive v_k that was held until then, y is the followed signal:

    S_k = F(S_{k-1}, v_k),  y_k = H(S_k, v_k);   dS_k = A_k dS_{k-1} + B_k dv_k,  dy_k = C_k dS_k + D_k dv_k.

Of a closed path the run repeats, so that the last sample stands before the first; an open one begins at rest, whatever is learnt; of
separate equilibria each has a drive of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, inf

import casadi as ca
import numpy as np

from ctrlgen.budget.uncertain_path import holding_drive
from ctrlgen.model.discretisation import one_step_map, settling_time
from ctrlgen.numerics.batched_evaluation import Recursion, evaluate
from ctrlgen.trajectory.inverse.clock import Settled
from ctrlgen.trajectory.solution import Solution

MOST_BEFORE = 100_000  # samples that a closed path is run for until it repeats
BLOCK = 500  # samples evaluated at once


@dataclass(frozen=True)
class Linearised:
    """A run under `drive` (n, n_u): states `S` (n, n_s), signal `y` (n, n_y), limited quantities `limited` (n, n_l), and the derivatives
    `A` (n, n_s, n_s), `B` (n, n_s, n_u), `C` (n, n_y, n_s), `D` (n, n_y, n_u), `E` (n, n_l, n_s), `G` (n, n_l, n_u) of these two."""

    drive: np.ndarray
    S: np.ndarray
    y: np.ndarray
    limited: np.ndarray
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    E: np.ndarray
    G: np.ndarray


class Lifted:
    """The runs of the path of `solution`, its device under any drives (n, n_u) [SI], row k acting from sample k to k + 1."""

    def __init__(self, solution: Solution) -> None:
        self.solution, m = solution, solution.model
        self.model, self.signal = m, m.signals[solution.scenario.file.follow]
        self.n, self.closed = len(solution.command), solution.scenario.closed
        clock = solution.scenario.clock
        self.static = isinstance(clock, Settled)
        self.sample_time = inf if isinstance(clock, Settled) else clock.sample_time
        self.composite = tuple(m.composite_limits())
        sample = one_step_map(m, self.sample_time)
        S, u, at = ca.vertcat(m.x, m.z), m.u, ca.DM(m.p_nominal)
        then = ca.substitute(ca.vertcat(sample.x, sample.z), sample.u_next, u)
        limited = ca.vertcat(ca.SX(0, 1), *(limit.expr for limit in self.composite))
        then, y, limited = (ca.substitute(e, m.p, at) for e in (then, self.signal.expr, limited))
        self._step = Recursion(ca.Function("step", [S, u], [then, then], {"cse": True}))
        self._values = _function("values", S, u, y, limited)
        self._carries = _function("carries", S, u, ca.jacobian(then, S), ca.jacobian(then, u))
        self._slopes = _function("slopes", S, u, *(ca.jacobian(e, s) for e in (y, limited) for s in (S, u)))
        self.before = self._samples_before()
        self._held = None if self.static or self.closed else holding_drive(solution)

    def held(self, drive: np.ndarray) -> np.ndarray:
        """v (n, n_u): the drive that was held until each sample."""
        if self.static:
            return drive
        first = drive[-1:] if self._held is None else self._held[None]
        return np.vstack([first, drive[:-1]])

    def acting(self, held: np.ndarray, drive: np.ndarray) -> np.ndarray:
        """The drives (n, n_u) whose `held` these are; the last of an open path, which moves no sample, is that of `drive`."""
        if self.static:
            return held
        return np.vstack([held[1:], held[:1] if self.closed else drive[-1:]])

    def states(self, drive: np.ndarray) -> np.ndarray:
        """S (n, n_s), of a closed path once it repeats."""
        v, trace = self.held(drive), self.solution.trace
        ahead = v[np.arange(-self.before, 0) % self.n] if self.closed else np.tile(v[:1], (self.before, 1))
        first = -(self.before + 1) % self.n if self.closed else 0
        x = trace.x[first].copy()
        if not self.closed and not self.static:
            x[list(self.model.clocks)] -= (self.before + 1) * self.sample_time
        return self._step.run(np.concatenate([x, trace.z[first]]), np.vstack([ahead, v]))[0][self.before :]

    def run(self, drive: np.ndarray) -> np.ndarray:
        """y (n, n_y): the followed signal of a run under `drive` (n, n_u)."""
        return self._along(self._values, self.states(drive), self.held(drive))[0]

    def linearise(self, drive: np.ndarray) -> Linearised:
        """The run under `drive` and its derivatives."""
        S, v = self.states(drive), self.held(drive)
        previous = np.vstack([S[-1:] if self.closed else S[:1], S[:-1]])  # of an open path the first is at rest
        y, limited = self._along(self._values, S, v)
        A, B = self._along(self._carries, previous, v)
        return Linearised(drive, S, y, limited, A, B, *self._along(self._slopes, S, v))

    def _samples_before(self) -> int:
        """A closed path is run until it repeats: until lags have settled, and once more where something remembers."""
        if self.static:
            return 1
        settled = ceil(settling_time(self.model) / self.sample_time)
        remembers = self.model.x.numel() - self.model.v.numel() > self.model.n_states
        return min(max(settled, 1) + (self.n if remembers and self.closed else 0), MOST_BEFORE)

    def _along(self, of_sample: ca.Function, S: np.ndarray, v: np.ndarray) -> list[np.ndarray]:
        """A function of each sample's (S, v): vectors as (n, .), matrices as (n, rows, columns)."""
        parts = list[list[np.ndarray]]()
        for a in range(0, len(S), BLOCK):
            b = min(a + BLOCK, len(S))
            values = evaluate(of_sample.map(b - a), S[a:b], v[a:b]) if of_sample.n_out() else []
            parts.append(
                [
                    value.reshape(b - a, of_sample.size2_out(i), of_sample.size1_out(i)).transpose(0, 2, 1)
                    for i, value in enumerate(values)
                ]
            )
        tables = [np.concatenate(blocks) for blocks in zip(*parts, strict=True)]
        return [
            t[:, :, 0] if of_sample.size2_out(i) == 1 and of_sample is self._values else t for i, t in enumerate(tables)
        ]


def _function(name: str, S: ca.SX, u: ca.SX, *values: ca.SX) -> ca.Function:
    return ca.Function(name, [S, u], [ca.densify(value) for value in values], {"cse": True})

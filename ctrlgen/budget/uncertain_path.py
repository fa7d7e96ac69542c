"""A solved path on a device whose numbers differ: one sample after another, symbolic in everything that is uncertain.

S = (x, z) is the state at a sample, v the drive that acts until then, q the uncertain columns, y the followed signal and the
limited quantities:

    S_k = F(S_{k-1}, v_k, q),  y_k = H(S_k, v_k, q),  v_k = u_k (1 + g + g_i).
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from math import ceil, inf

import casadi as ca
import numpy as np
import scipy

from ctrlgen.budget.uncertainty import AMBIENT, Uncertainties
from ctrlgen.devices import Limit
from ctrlgen.model.assembly import model_of_numbers
from ctrlgen.model.discretisation import NEWTON_STEPS, balanced, one_step_map, settling_time
from ctrlgen.model.model import Model
from ctrlgen.numerics.batched_evaluation import Recursion, evaluate
from ctrlgen.trajectory.inverse.clock import Settled
from ctrlgen.trajectory.solution import Solution

MOST_BEFORE = 100_000  # samples before the path: a memory that has not settled by then has its described value
LEAST_BEFORE = 1


class UncertainPath:
    """The path of `solution`, with the `free` numbers of its device and the surroundings as symbols.

    `columns` (m,): the place of each column of the uncertainties in q = (numbers, surroundings, common gain, channel gains), several
    for one where it is the same for all. `idle` are the numbers that act on limits alone, or on nothing: in p of the `model` behind those
    that are `free`.
    """

    def __init__(self, solution: Solution, uncertainties: Uncertainties) -> None:
        self.solution, self.uncertainties = solution, uncertainties
        scenario, device = solution.scenario, solution.model.device
        stated = [path for line in uncertainties.lines if line.kind == "number" for path in line.paths]
        surrounded = sorted(path for path, _ in device.quantities() if path.endswith(AMBIENT) and path not in stated)
        self.rise = ca.SX.sym("surroundings")
        model = model_of_numbers(device, (*stated, *surrounded), self.rise)
        self.idle = tuple(path for path in stated if path not in model.moved_by)
        self.moving = tuple(path for path in stated if path in model.moved_by)
        self.free = (*self.moving, *(path for path in surrounded if path in model.moved_by))
        first = [i for i, path in enumerate((*stated, *surrounded)) if path in self.free]
        order = [*first, *(i for i in range(model.p.numel()) if i not in first)]
        model = replace(
            model, p=ca.vertcat(ca.SX(0, 1), *(model.p[i] for i in order)), p_nominal=model.p_nominal[order]
        )
        self.model = _warmed(model, self.free, self.rise)
        clock = scenario.clock
        self.sample_time = inf if isinstance(clock, Settled) else clock.sample_time
        m = self.model
        n, p = len(self.free), ca.vertsplit(m.p)
        self.state, self.q = ca.vertcat(m.x, m.z), ca.vertcat(*p[:n], self.rise)
        self.p_idle = ca.vertcat(ca.SX(0, 1), *p[n:])
        self.q_nominal = np.append(m.p_nominal[:n], 0.0)
        self.signal = m.signals[scenario.file.follow]
        self.limits = tuple(limit for limit in m.limits if not self._commanded(limit))
        self.constants: dict[str, ca.Function] = {}
        self.of_sample: dict[str, ca.Function] = {}
        self._add("step", self._following(NEWTON_STEPS))
        self._add("pose", self.signal.expr)
        self._add("limits", ca.vertcat(ca.SX(0, 1), *(limit.expr for limit in self.limits)))
        self.slopes: dict[str, ca.Function] = {}  # of the parts, by name, once they are needed
        self.drive, self.before = self._drives()
        self.start = self._start()

    def along(self, solution: Solution) -> UncertainPath:
        """The same device along another path."""
        other = copy(self)
        other.solution = solution
        other.drive, other.before = other._drives()
        other.start = other._start()
        return other

    def _following(self, newton_steps: int) -> ca.SX:
        sample = one_step_map(self.model, self.sample_time, newton_steps=newton_steps)
        return ca.substitute(ca.vertcat(sample.x, sample.z), sample.u_next, self.model.u)

    def apart(self) -> bool:
        """Whether states go on without the displacement, as those of heaters do: then it need be known at some samples only, and there are
        parts "states", x at the next sample, and "balanced", the displacement there, which is no number for a device beyond buckling."""
        m = self.model
        if m.inertial or not np.isfinite(self.sample_time):
            return False
        if "states" not in self.of_sample:
            x = self._following(1)[: m.x.numel()]
            if ca.depends_on(x, m.z):
                return False
            self._add("states", x)
            z = balanced(m, m.x, m.u, NEWTON_STEPS)
            rises = ca.mmax(ca.substitute(ca.diag(ca.jacobian(m.balance, m.z)), m.z, z)) < 0
            # Where the restoring force does not rise, no stage stays
            self._add("balanced", ca.if_else(rises, z, np.nan))
        return True

    def _add(self, name: str, value: ca.SX) -> None:
        """A part (S, v, c) -> value, with c(q) what depends on q alone."""
        moved = ca.substitute(value, self.p_idle, self.model.p_nominal[len(self.free) :])
        (expression,), symbols, values = ca.extract_parametric([moved], self.q, {"extract_trivial": True})
        c = ca.vertcat(ca.SX(0, 1), *symbols)
        given = [self.state, self.model.u, c]
        self.constants[name] = ca.Function(f"{name}_constants", [self.q], [ca.vertcat(ca.SX(0, 1), *values)])
        self.of_sample[name] = ca.Function(name, given, [ca.densify(expression)], {"cse": True})

    def quickest_step(self, states: np.ndarray, allowed: np.ndarray) -> str:
        """The name of the step with the fewest of Newton's iterations that takes the followed signal along the described path's `states`
        within `allowed` (n_y,) [SI]: each sample begins at the displacement of the one before."""
        exact = self.evaluate("pose", states, self.drive)
        for newton_steps in range(1, NEWTON_STEPS if not self.model.inertial else 1):
            self._add("quick_step", self._following(newton_steps))
            quick = self.evaluate("pose", self.nominal(step="quick_step"), self.drive)
            if np.all(np.abs(quick - exact).max(axis=0) <= allowed):
                return "quick_step"
        return "step"

    def _commanded(self, limit: Limit) -> bool:
        """Whether it limits the commanded drives, which are computed and hence known."""
        return all(self.model.limited_variable(limit, i) == "u" for i in range(limit.expr.numel()))

    @property
    def n(self) -> int:
        """Samples of the path."""
        return len(self.solution.command)

    @property
    def channels(self) -> list[tuple[Limit, int]]:
        """Each limited quantity: its limit and its place there."""
        return [(limit, i) for limit in self.limits for i in range(limit.expr.numel())]

    @property
    def places(self) -> list[tuple[Limit, slice]]:
        """Each limit with the places of its limited quantities."""
        ends = np.cumsum([limit.expr.numel() for limit in self.limits]).tolist()
        return [(limit, slice(end - limit.expr.numel(), end)) for limit, end in zip(self.limits, ends, strict=True)]

    def _drives(self) -> tuple[np.ndarray, int]:
        """The path's drives v (before + n, n_u), and how many of them stand before the path."""
        return self.drives_after(settling_time(self.solution.model))

    def drives_after(self, settling: float) -> tuple[np.ndarray, int]:
        """v (before + n, n_u) for a device that takes `settling` [s] to forget, and how many of them stand before the path.

        A closed path has been run for long enough to repeat; an open one begins at rest, held by the drive that holds its start.
        """
        u, scenario = self.solution.drive, self.solution.scenario
        if scenario.sample_time is None:
            return np.vstack([u[:1], u]), LEAST_BEFORE
        before = min(max(ceil(settling / scenario.sample_time), LEAST_BEFORE), MOST_BEFORE)
        if scenario.closed:
            return u[np.arange(-before - 1, self.n - 1) % self.n], before
        held = holding_drive(self.solution)
        return np.vstack([np.tile(held, (before + 1, 1)), u[:-1]]), before

    def _start(self) -> np.ndarray:
        """The state S (n_s,) before the first of the drives, taken from the solved path."""
        trace, closed = self.solution.trace, self.solution.scenario.closed
        k = -(self.before + 1) % self.n if closed else 0
        x = trace.x[k].copy()
        if not closed and np.isfinite(self.sample_time):
            x[list(self.model.clocks)] -= (self.before + 1) * self.sample_time
        return np.concatenate([x, trace.z[k]])

    def gains(self, kind: str) -> slice:
        """The places, behind q, of a gain: of the common one, or of those of the channels."""
        first = len(self.q_nominal)
        return slice(first, first + 1) if kind == "gain" else slice(first + 1, self.nothing)

    @property
    def nothing(self) -> int:
        """The place behind all gains, of what acts on no motion."""
        return len(self.q_nominal) + 1 + self.drive.shape[1]

    def nominal(self, drive: np.ndarray | None = None, step: str = "step") -> np.ndarray:
        """S (before + n, n_s) of the described device, under the path's `drive` (before + n, n_u) or another one."""
        constants, one = self.constants[step](self.q_nominal), self.of_sample[step]
        state, v = ca.MX.sym("S", self.state.numel()), ca.MX.sym("v", self.model.u.numel())
        following = one(state, v, constants)
        recursion = Recursion(ca.Function("step", [state, v], [following, following]))
        return recursion.run(self.start, self.drive if drive is None else drive)[0]

    def evaluate(self, name: str, S: np.ndarray, drive: np.ndarray) -> np.ndarray:
        """The `pose` or the `limits` (n, n_y) of the described device, at states S (n, n_s) and drives (n, n_u)."""
        one, c = self.of_sample[name], self.constants[name](self.q_nominal).full().ravel()
        if not one.numel_out(0):
            return np.zeros((len(S), 0))
        return np.asfortranarray(evaluate(one.map(len(S)), S, drive, np.tile(c, (len(S), 1)))[0])

    def lsb(self) -> np.ndarray:
        """(n_u,) one step of the converter [SI]."""
        low, high = self.solution.model.u_bounds
        return (high - low) / (2 ** (self.uncertainties.bits or 1) - 1)

    def rounded(self) -> np.ndarray:
        """The drives, each rounded to the nearest step of the converter."""
        low, _ = self.solution.model.u_bounds
        return low + np.round((self.drive - low) / self.lsb()) * self.lsb()


def holding_drive(solution: Solution) -> np.ndarray:
    """(n_u,) the drive that holds the first sample of an open path."""
    m, trace = solution.model, solution.trace
    changes = ca.vertcat(ca.SX(0, 1), m.starting) / np.maximum(m.x_scale, 1e-300)
    symbols, values = ca.vertcat(m.x, m.z, m.p), ca.vertcat(trace.x[0], trace.z[0], m.p_nominal)
    at_first = ca.substitute(ca.vertcat(changes, m.balance / m.force_scale), symbols, values)
    still = ca.Function("still", [m.u], [at_first])
    fit = scipy.optimize.least_squares(
        lambda w: still(w * m.u_scale).full().ravel(), solution.drive[0] / m.u_scale, xtol=1e-15, gtol=1e-15
    )
    return fit.x * m.u_scale


def _warmed(model: Model, free: Sequence[str], rise: ca.SX) -> Model:
    """The model with what heaters cool to warmer by `rise`: in the rates of the actuators' states, not in their force."""
    places = [i for i, path in enumerate(free) if path.endswith(AMBIENT)]
    if not places or not model.n_states:
        return model

    def warmer(rates: ca.SX) -> ca.SX:
        actuator_rates = ca.substitute(rates[: model.n_states], model.p[places], model.p[places] + rise)
        return ca.vertcat(actuator_rates, rates[model.n_states :])

    return replace(model, rates_of_heat=warmer(model.rates_of_heat), sampled_rates=warmer(model.sampled_rates))

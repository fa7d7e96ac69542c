"""A model on a record: what it reads, and how that changes with every free parameter.

State S = (x, z), drive u, ambient e, free parameters p:

    S+ = F(S, u, u+, e, p),  y = H(S, u, e, p),
    D+ = F_S D + F_p,        dy/dp = H_S D + H_p,   D = dS/dp.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.devices import Device
from ctrlgen.diagnosis.estimation.forward_sensitivities import forward_sensitivities, takes_several_steps
from ctrlgen.diagnosis.estimation.sample_equations import SampleEquations, build_sample_equations
from ctrlgen.diagnosis.settings import SIMULATION
from ctrlgen.model.assembly import build_model
from ctrlgen.model.discretisation import balanced
from ctrlgen.model.model import Model
from ctrlgen.numerics.batched_evaluation import Recursion, evaluate
from ctrlgen.recordings.recording import Record


class Simulator:
    """The readings `channels` of `device` with the parameters `free`, for records of one sample time."""

    def __init__(
        self, device: Device, free: Sequence[str], channels: Sequence[str], sample_time: float, linear: bool
    ) -> None:
        self.free, self.channels, self.sample_time, self.linear = tuple(free), tuple(channels), sample_time, linear
        self.ambient = ca.SX.sym("ambient")
        look_back = sample_time if np.isfinite(sample_time) else None
        self.model: Model = build_model(device, free, self.ambient, look_back)
        self._with_sensitivities: dict[bool, Recursion] = {}
        self._by_pattern: dict[tuple, ca.Function] = {}
        self.n_x, self.n_s = self.model.x.numel(), self.model.x.numel() + self.model.z.numel()

    @cached_property
    def free_initial_states(self) -> tuple[int, ...]:
        """Places in S of what a record may start with: actuators' states and, with inertia, velocity and displacement."""
        m = self.model
        if not m.inertial:
            return tuple(range(m.n_states)) if np.isfinite(self.sample_time) else ()
        return (*range(m.n_states), *range(self.n_x - m.v.numel(), self.n_s))

    @cached_property
    def _observed(self) -> ca.SX:
        signals = self.model.signals
        rows = []
        for channel in self.channels:
            role, name = channel.split(".", 1)
            rows.append(signals[role].expr[signals[role].channels.index(name)])
        return ca.vertcat(*rows)

    @cached_property
    def equations(self) -> SampleEquations:
        """F and H of one sample, symbolically."""
        return build_sample_equations(self.model, self._observed, self.sample_time, self.linear)

    def linearise(self, p: np.ndarray, chosen: Sequence[int]) -> Linearised:
        """Along any motion, for the `chosen` m of the free numbers, at `p`."""
        c, by_p = self.equations.constants(p)
        given = self._symbols[:4]
        by_f = by_p[:, list(chosen)]
        slopes = self._stepped(by_f.sparsity())(*given, c, by_f) if takes_several_steps(self.equations) else None
        if slopes is None:
            F_S, F_c, H_S, H_c = self._sloped(*given, c)
            slopes = [F_S, F_c @ by_f, H_S, H_c @ by_f]
        return Linearised(ca.Function("linearised", given, slopes))

    @cached_property
    def _sloped(self) -> ca.Function:
        """`given` of the equations -> F_S, F_c, H_S, H_c."""
        q = self.equations
        slopes = [ca.jacobian(a, b) for a in (q.following, q.y) for b in (q.given[0], q.given[4])]
        return ca.Function("sloped", q.given, slopes)

    def _stepped(self, pattern: ca.Sparsity) -> ca.Function:
        """`given` of the equations, dc/df of some `pattern` -> F_S, F_f, H_S, H_f where a sample takes several steps."""
        key = (pattern.shape, tuple(pattern.find()))
        if key not in self._by_pattern:
            by_f, n_s = ca.MX.sym("by_f", pattern), self.n_s
            m = pattern.size2()
            T = ca.MX(ca.DM(np.eye(n_s + m, n_s)))  # dense: steps fill it
            seed = ca.vertcat(ca.MX(n_s, pattern.size1()), by_f.T)
            _, T, _, Y = forward_sensitivities(self.equations, T, seed, self._symbols)
            slopes = [part.T for values in (T, Y) for part in (values[:n_s, :], values[n_s:, :])]
            self._by_pattern[key] = ca.Function("stepped", [*self._symbols, by_f], slopes)
        return self._by_pattern[key]

    def initial_state(self, record: Record, p: np.ndarray) -> np.ndarray:
        """S before the first sample: actuators at rest; the stage at home, or in balance where it has no inertia."""
        m = self.model
        x = m.rest.copy()
        x[list(m.clocks)] = record.time[0] if np.isfinite(self.sample_time) else 0.0
        if m.inertial or not np.isfinite(self.sample_time):
            return np.concatenate([x, 0.0 * m.z_scale])
        z = balanced(m, m.x, m.u, SIMULATION.start_newton_steps)
        start = ca.Function("start", [m.x, m.z, m.u, m.p, self.ambient], [z])
        return np.concatenate([x, start(x, m.z_scale, record.drive[0], p, self._ambients(record)[0]).full().ravel()])

    @staticmethod
    def _ambients(record: Record) -> np.ndarray:
        return np.zeros(len(record.time)) if record.ambient is None else record.ambient

    def simulate(self, record: Record, p: np.ndarray, start: np.ndarray | None = None) -> np.ndarray:
        """Readings (n, n_y), SI; `start` is added to what a record may start with."""
        return self.simulate_states(record, p, start)[1]

    def simulate_states(
        self, record: Record, p: np.ndarray, start: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """S after each sample (n, n_s) and the readings (n, n_y), SI."""
        c = np.tile(self.equations.constants(p)[0].full().T, (len(record.time), 1))
        return self._moving.run(self.starting_state(record, p, start), *self.inputs(record), c)

    def sensitivities(
        self, record: Record, p: np.ndarray, start: np.ndarray | None = None, by_free: bool = True
    ) -> tuple[np.ndarray, np.ndarray]:
        """Readings (n, n_y) and their derivatives (n, n_y, m) by `free`, where wanted, then by what the record starts with."""
        c, by_p = self.equations.constants(p)
        k, n_i, n_y, n = len(self.free) * by_free, len(self.free_initial_states), len(self.channels), len(record.time)
        T_0 = np.zeros((k + n_i, self.n_s))
        T_0[k + np.arange(n_i), list(self.free_initial_states)] = 1.0
        begin = np.concatenate([self.starting_state(record, p, start), T_0.ravel(order="F")])
        slow = (np.tile(np.reshape(v, (1, -1)), (n, 1)) for v in (c.full(), np.array(by_p.nonzeros())))
        values = self._carrying(by_free).run(begin, *self.inputs(record), *slow)[1]
        return values[:, :n_y], values[:, n_y:].reshape(n, n_y, k + n_i)

    @cached_property
    def _moving(self) -> Recursion:
        """The sample map."""
        q = self.equations
        return Recursion(ca.Function("one", q.given, [ca.densify(q.following), ca.densify(q.y)]))

    def _carrying(self, by_free: bool) -> Recursion:
        """The sample map with its derivatives carried along; the nonzeros of dc/dp come as an argument."""
        if by_free not in self._with_sensitivities:
            n_i, pattern = len(self.free_initial_states), self.equations.constants.sparsity_out(1)
            by_p = ca.MX.sym("by_p", pattern.nnz())
            seed = ca.MX(n_i, pattern.size1())
            if by_free:
                seed = ca.vertcat(ca.MX(pattern, by_p).T, seed)
            state, others = ca.MX.sym("state", self.n_s * (1 + seed.shape[0])), self._symbols[1:]
            S, T = state[: self.n_s], ca.reshape(state[self.n_s :], seed.shape[0], self.n_s)
            after, T, y, Y = forward_sensitivities(self.equations, T, seed, [S, *others])
            values = [ca.densify(ca.vertcat(a, ca.vec(b))) for a, b in ((after, T), (y, Y))]
            self._with_sensitivities[by_free] = Recursion(ca.Function("one", [state, *others, by_p], values))
        return self._with_sensitivities[by_free]

    @cached_property
    def _symbols(self) -> list[ca.MX]:
        """S, u, u+, ambient, constants."""
        n_u, n_c = self.model.u.numel(), self.equations.constants.size1_out(0)
        return [ca.MX.sym(name, n) for name, n in (("S", self.n_s), ("u", n_u), ("u1", n_u), ("e", 1), ("c", n_c))]

    def starting_state(self, record: Record, p: np.ndarray, start: np.ndarray | None) -> np.ndarray:
        """S (n_s,) before the first sample, `start` added at `free_initial_states`."""
        S = self.initial_state(record, p)
        if start is not None:
            S[list(self.free_initial_states)] += start
        return S

    def inputs(self, record: Record) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Drive now and at the next sample (n, n_u), ambient (n, 1); for settled poses the pose's own drive comes as the next."""
        u = record.drive
        following = np.vstack([u[1:], u[-1:]]) if np.isfinite(self.sample_time) else u
        before = u if np.isfinite(self.sample_time) else np.vstack([u[:1], u[:-1]])
        return before, following, self._ambients(record)[:, None]


class Linearised:
    """F_S (n_s, n_s), F_f (n_s, m), H_S (n_y, n_s) and H_f (n_y, m) by (S, u, u+, ambient); `patterns` says which of
    their entries can differ from zero."""

    def __init__(self, one: ca.Function) -> None:
        self.patterns = [ca.DM(one.sparsity_out(i), 1).full() > 0 for i in range(one.n_out())]
        given = one.mx_in()
        self._one = ca.Function("dense", given, [ca.densify(value) for value in one(*given)])
        self._mapped: dict[int, ca.Function] = {}

    def evaluate_along(self, S: np.ndarray, *inputs: np.ndarray) -> list[np.ndarray]:
        """Each at n samples, (n, ., .); all arguments (n, .)."""
        n = len(S)
        if n not in self._mapped:
            self._mapped[n] = self._one.map(n)
        values = evaluate(self._mapped[n], S, *inputs)
        return [v.reshape(n, *p.T.shape).transpose(0, 2, 1) for v, p in zip(values, self.patterns, strict=True)]

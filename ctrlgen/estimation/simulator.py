"""Simulation of a record with a model: the readings, and their derivatives by every free parameter.

State S = (x, z), drive u, ambient e, free parameters p:

    S+ = F(S, u, u+, e, p),  y = H(S, u, e, p),
    D+ = F_S D + F_p,        dy/dp = H_S D + H_p,   D = dS/dp.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.devices import Device
from ctrlgen.estimation.forward_sensitivities import (
    LONGEST_SAMPLE,
    forward_sensitivities,
    jacobian_of,
    reached_entries,
    written_out,
)
from ctrlgen.estimation.hypothesis import nominal_physics
from ctrlgen.estimation.late_readings import effects_apart, late_readings, read_afterwards
from ctrlgen.estimation.moved_drive import with_drive_at
from ctrlgen.estimation.sample_equations import SampleEquations, build_sample_equations
from ctrlgen.estimation.settings import SIMULATION
from ctrlgen.model.assembly import build_model
from ctrlgen.model.discretisation import balanced
from ctrlgen.model.model import Model
from ctrlgen.numerics.batched_evaluation import Recursion, evaluate
from ctrlgen.recordings.recording import Record, Timing


class Simulator:
    """Simulates the readings `channels` (n_y) of `device`, compiled once for records of one `Timing`.

    `free` are the paths of the k parameters p that may change between simulations; the steps of a device with inertia are expanded
    about their values in `device`, and are `finer` times the integrator's own. A device with inertia settles in no pose:
    its readings are those of the instants at which the drive changes.
    """

    def __init__(
        self,
        device: Device,
        free: Sequence[str],
        channels: Sequence[str],
        sample_time: float,
        linear: bool = False,
        poses: bool = False,
        resumed: bool = False,
        finer: int = 1,
    ) -> None:
        self.finer, self.free, self.channels, self.resumed = finer, tuple(free), tuple(channels), resumed
        self.sample_time, self.linear = sample_time, linear
        self.ambient = ca.SX.sym("ambient")
        look_back = sample_time if np.isfinite(sample_time) else None
        clock = not poses and look_back is not None
        apart = effects_apart(device, nominal_physics(device), self.free, clock)
        self.model: Model = build_model(device, free, self.ambient, look_back, per_record=True, apart=apart)
        self.late, self._rates = late_readings(self.model, apart, self.free, self.channels)
        self.poses = not self.model.inertial and (poses or np.isinf(sample_time))
        self._with_sensitivities: dict[bool, tuple[Recursion, ca.Sparsity]] = {}
        self._by_pattern: dict[tuple[Any, ...], ca.Function] = {}
        self.n_x, self.n_s = self.model.x.numel(), self.model.x.numel() + self.model.z.numel()

    @cached_property
    def _clock(self) -> tuple[float, int | None]:
        """By how much the device's effects shift the recorded drive [s]: a fixed part, and the place in `free` of a free one."""
        fixed, place = 0.0, None
        for k, effect in enumerate(self.model.device.effect):
            if effect.shifts_drive:
                name = effect.amplitude().name
                if (path := f"effect[{k}].{name}") in self.free:
                    place = self.free.index(path)
                else:
                    fixed += effect.values[name].si
        return fixed, place

    def aligned(self, record: Record, p: np.ndarray) -> Record:
        """The record with its drive at t + tau in place of t, tau the offset of the recorders' clocks: `with_drive_at`."""
        fixed, place = self._clock
        tau = fixed + (p[place] if place is not None else 0.0)
        return record if self.poses else with_drive_at(record, tau)

    @cached_property
    def free_initial_states(self) -> tuple[int, ...]:
        """Places in S of the initial states that are fitted: actuators' states, how far dry friction is bent and plays stand
        off when a record begins, and, with inertia, velocity and displacement; of settled poses the plays alone. Of a record before
        which the device had moved also what relaxes: lags, creep, loops that have a rate."""
        m = self.model
        if not np.isfinite(self.sample_time):
            return m.free_memories
        last = self.n_x - m.v.numel()
        moving = range(last, self.n_s) if m.inertial else ()
        return (*range(m.n_states), *m.free_memories, *(self.relaxing if self.resumed else ()), *moving)

    @cached_property
    def relaxing(self) -> tuple[int, ...]:
        """Places in S of the states of laws that relax."""
        m = self.model
        kept = {*m.clocks, *m.stepped, *m.free_memories}
        return tuple(k for k in range(m.n_states, self.n_x - m.v.numel()) if k not in kept)

    @cached_property
    def plays(self) -> tuple[tuple[int, int, int], ...]:
        """Of each law with plays: the place in S of its narrowest, and among the free initial states those of the turning point before a
        record and of the side on which plays stood there."""
        names, free = self.model.x_names, {k: i for i, k in enumerate(self.free_initial_states)}
        places = {name: k for k, name in enumerate(names)}
        found = []
        for name in (name for name in names if "_turn_" in name):
            play, turn, start = (
                places.get(name.replace("_turn_", f"_{other}_")) for other in ("play1", "turn", "start")
            )
            if play is not None and turn in free and start in free:
                found.append((play, free[turn], free[start]))
        return tuple(found)

    @cached_property
    def gaps(self) -> tuple[int, ...]:
        """Of each law with one gap: the place among the free initial states of that of its driven side."""
        names = self.model.x_names
        free = ((i, names[k]) for i, k in enumerate(self.free_initial_states) if k < len(names))
        return tuple(i for i, name in free if "_start_" in name and name.replace("_start_", "_turn_") not in names)

    @cached_property
    def slews(self) -> tuple[int, ...]:
        """Of each law that limits a rate: the place among the free initial states of what was delivered before a record."""
        names, kinds = self.model.x_names, tuple(e.kind for e in self.model.device.effect if e.limits_rate)
        free = ((i, names[k]) for i, k in enumerate(self.free_initial_states) if k < len(names))
        return tuple(i for i, name in free if name.startswith(kinds))

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
        """F and H of one sample, symbolically; the readings as they are before they are late."""
        return self._equations_of(self._observed)

    @cached_property
    def _with_rates(self) -> SampleEquations:
        """The same with the rates of the readings that are late as further readings."""
        if not self._rates.numel():
            return self.equations
        return self._equations_of(ca.vertcat(self._observed, self._rates))

    def _equations_of(self, y: ca.SX) -> SampleEquations:
        # by name, so that structures with other laws, or with one number suspected, have the same function of the device's numbers
        own = [i for _, i in sorted((path, i) for i, path in enumerate(self.free) if not path.startswith("effect["))]
        return build_sample_equations(self.model, y, self.sample_time, self.linear, self.poses, self.finer, own)

    def linearise(self, p: np.ndarray, chosen: Sequence[int]) -> Linearised:
        """F_S, F_f, H_S and H_f at `p` (k,) along any motion, f the m `chosen` parameters by their places in `free`."""
        c, c_p = self.equations.constants(p)
        given = self._symbols[:4]
        c_f = c_p[:, list(chosen)]
        if self.equations.steps is not None:
            jacobians = self._jacobians_by_steps(c_f.sparsity())(*given, c, c_f)
        else:
            F_S, F_c, H_S, H_c = self._jacobians(*given, c)
            jacobians = [F_S, F_c @ c_f, H_S, H_c @ c_f]
        return Linearised(ca.Function("linearised", given, jacobians))

    @cached_property
    def _jacobians(self) -> ca.Function:
        """S, u, u+, ambient, c -> F_S, F_c, H_S, H_c, a sample differentiated as a whole."""
        q = self.equations
        jacobians = [jacobian_of(q)(value, by) for value in (q.following, q.y) for by in (q.given[0], q.given[4])]
        return q.one("jacobians", jacobians)

    def _jacobians_by_steps(self, pattern: ca.Sparsity) -> ca.Function:
        """S, u, u+, ambient, c, dc/df -> F_S, F_f, H_S, H_f from the sensitivities by S and f; dc/df of one `pattern`."""
        key = (pattern.shape, tuple(pattern.find()))
        if key not in self._by_pattern:
            c_f, n_s = ca.MX.sym("c_f", pattern), self.n_s
            m = pattern.size2()
            # dense: steps fill it
            T = ca.MX(ca.DM(np.eye(n_s + m, n_s)))
            seed = ca.vertcat(ca.MX(n_s, pattern.size1()), c_f.T)
            _, T, _, Y = forward_sensitivities(self.equations, T, seed, self._symbols)
            jacobians = [part.T for values in (T, Y) for part in (values[:n_s, :], values[n_s:, :])]
            self._by_pattern[key] = ca.Function("jacobians", [*self._symbols, c_f], jacobians)
        return self._by_pattern[key]

    def initial_state(self, record: Record, p: np.ndarray) -> np.ndarray:
        """S (n_s,) before the first sample: actuators at rest; the stage at home, or in balance where it has no inertia."""
        m = self.model
        x = m.rest.copy()
        x[list(m.clocks)] = record.time[0] if np.isfinite(self.sample_time) else 0.0
        if m.inertial or self.poses:
            return np.concatenate([x, 0.0 * m.z_scale])
        z = self._balance(x, m.z_scale, record.drive[0], p, self.ambient_of(record)[0])
        return np.concatenate([x, z.full().ravel()])

    @cached_property
    def _balance(self) -> ca.Function:
        """x, z, u, p, ambient -> the displacement (n_axes,) in balance, from z."""
        m = self.model
        z = balanced(m, m.x, m.u, SIMULATION.start_newton_steps)
        return ca.Function("balance", [m.x, m.z, m.u, m.p, self.ambient], [z])

    @cached_property
    def _slopes_of_balance(self) -> ca.Function:
        """The same arguments -> dz/dx (n_axes, n_x) and dz/dp (n_axes, k)."""
        given = self._balance.sx_in()
        z = self._balance(*given)
        return ca.Function("slopes", given, [ca.jacobian(z, given[0]), ca.jacobian(z, given[3])])

    @staticmethod
    def ambient_of(record: Record) -> np.ndarray:
        """Ambient (n,), zero where none was recorded."""
        return np.zeros(len(record.time)) if record.ambient is None else record.ambient

    def simulate(self, record: Record, p: np.ndarray, start: np.ndarray | None = None) -> np.ndarray:
        """Readings (n, n_y) [SI] with parameters `p` (k,); `start` is added to the free initial states."""
        return self.simulate_states(record, p, start)[1]

    def simulate_states(
        self, record: Record, p: np.ndarray, start: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """S after each sample (n, n_s) and the readings (n, n_y) [SI]; arguments as of `simulate`."""
        record = self.aligned(record, p)
        c = self._with_rates.constants(p)[0].full().T
        after, values = self._recursion.run(self.starting_state(record, p, start), *self.inputs(record), c)
        read_afterwards(self.late, record, p, values)
        return after, values[:, : len(self.channels)]

    def sensitivities(
        self, record: Record, p: np.ndarray, start: np.ndarray | None = None, by_free: bool = True
    ) -> tuple[np.ndarray, np.ndarray]:
        """Readings (n, n_y) [SI] and their derivatives (n, n_y, m) by the free parameters, then by the free initial states.

        Without the derivatives by the parameters where `by_free` is False.
        """
        clock = self._clock[1] if by_free else None
        asked, by_free = by_free, by_free or self._compiled_by_free
        by_clock = None if clock is None else self._by_clock(record, p, start, clock)
        record = self.aligned(record, p)
        c, c_p = self._with_rates.constants(p)
        k, n_i, n_y, n = len(self.free) * by_free, len(self.free_initial_states), len(self.channels), len(record.time)
        recursion, reached = self._recursion_with_sensitivities(by_free)
        S_0, T_0 = self.starting_state(record, p, start), np.zeros((k + n_i, self.n_s))
        T_0[k + np.arange(n_i), list(self.free_initial_states)] = 1.0
        if self._begins_in_balance:
            by_x, by_p = self._slopes_of_balance(*self._first_balance(record, p, S_0))
            T_0[k:, self.n_x :] += by_x.full()[:, list(self.free_initial_states)].T
            T_0[:k, self.n_x :] = by_p.full().T[:k]
        first = np.concatenate([S_0, T_0[reached.row(), reached.get_col()]])
        constant = (np.reshape(v, (1, -1)) for v in (c.full(), np.array(c_p.nonzeros())))
        values = recursion.run(first, *self.inputs(record), *constant)[1]
        rows = n_y + self._rates.numel()
        values, Y = values[:, :rows], values[:, rows:].reshape(n, rows, k + n_i)
        read_afterwards(self.late, record, p, values, Y, by_free)
        y, slopes = values[:, :n_y], Y[:, :n_y]
        if by_clock is not None:
            slopes[:, :, clock] = by_clock
        return y, slopes if asked else slopes[:, :, k:]

    @property
    def _compiled_by_free(self) -> bool:
        """Whether the recursion with all derivatives is compiled already: compiling that without those by the parameters would take
        longer than the whole one does more."""
        known = self._with_sensitivities.get(True)
        return known is not None and known[0].one.is_compiled

    def _by_clock(self, record: Record, p: np.ndarray, start: np.ndarray | None, clock: int) -> np.ndarray:
        """Derivative (n, n_y) of the readings by the offset of the clocks: a central difference over one sample."""
        ends = []
        for sign in (1, -1):
            moved = p.copy()
            moved[clock] += sign * self.sample_time / 2
            ends.append(self.simulate(record, moved, start))
        return (ends[0] - ends[1]) / self.sample_time

    @cached_property
    def _recursion(self) -> Recursion:
        """The map (S, u, ...) -> (S+, y) of one sample."""
        q = self._with_rates
        return Recursion(q.one("one", [ca.densify(q.following), ca.densify(q.y)]))

    def _recursion_with_sensitivities(self, by_free: bool) -> tuple[Recursion, ca.Sparsity]:
        """(S, T) -> (S+, T+), (y, Y), with the nonzeros of dc/dp as a further input; T by its entries that can differ from zero, and which
        these are."""
        if by_free not in self._with_sensitivities:
            n_i, pattern = len(self.free_initial_states), self._with_rates.constants.sparsity_out(1)
            c_p = ca.MX.sym("c_p", pattern.nnz())
            seed = ca.MX(n_i, pattern.size1())
            if by_free:
                seed = ca.vertcat(ca.MX(pattern, c_p).T, seed)
            reached = reached_entries(self._with_rates, len(self.free) * by_free, self.free_initial_states)
            state = ca.MX.sym("state", self.n_s + reached.nnz())
            others = self._symbols_of(self._with_rates)[1:]
            S, T = state[: self.n_s], ca.MX(reached, ca.vec(state[self.n_s :]))  # of none, a row otherwise
            following, T, y, Y = forward_sensitivities(self._with_rates, T, seed, [S, *others])
            carried = ca.vec(ca.project(T, reached).nz[:])  # of a single row or of none, nz alone would be a row
            values = [ca.vertcat(following, carried), ca.vertcat(y, ca.vec(ca.densify(Y)))]
            one = ca.Function("one", [state, *others, c_p], [ca.densify(value) for value in values])
            whole = self._with_rates.steps is None
            self._with_sensitivities[by_free] = Recursion(written_out(one, LONGEST_SAMPLE) if whole else one), reached
        return self._with_sensitivities[by_free]

    @cached_property
    def _symbols(self) -> list[ca.MX]:
        """The arguments of one sample: S, u, u+, ambient, c."""
        return self._symbols_of(self.equations)

    def _symbols_of(self, equations: SampleEquations) -> list[ca.MX]:
        n_u, n_c = self.model.u.numel(), equations.constants.size1_out(0)
        return [ca.MX.sym(name, n) for name, n in (("S", self.n_s), ("u", n_u), ("u1", n_u), ("e", 1), ("c", n_c))]

    def starting_state(self, record: Record, p: np.ndarray, start: np.ndarray | None) -> np.ndarray:
        """S (n_s,) before the first sample, `start` added at `free_initial_states`; a displacement without inertia in balance with that."""
        S = self.initial_state(record, p)
        if start is not None:
            S[list(self.free_initial_states)] += start
            if self._begins_in_balance:
                S[self.n_x :] = self._balance(*self._first_balance(record, p, S)).full().ravel()
        return S

    @property
    def _begins_in_balance(self) -> bool:
        """Whether the first reading is of a displacement in balance."""
        return not (self.model.inertial or self.poses)

    def _first_balance(self, record: Record, p: np.ndarray, S: np.ndarray) -> tuple[Any, ...]:
        """The arguments of `_balance` with the states of S at the first sample."""
        return S[: self.n_x], self.model.z_scale, record.drive[0], p, self.ambient_of(record)[0]

    def inputs(self, record: Record) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Drive u and u+ (n, n_u), ambient (n, 1). Of poses u+ is the pose's own drive and u that of the pose before."""
        u, ambient = record.applied, self.ambient_of(record)[:, None]
        if not self.poses:
            return u, np.vstack([u[1:], u[-1:]]), ambient
        return np.vstack([u[:1], u[:-1]]), u, ambient


@lru_cache(maxsize=SIMULATION.kept)
def compiled_simulator(
    device: Device, free: tuple[str, ...], channels: tuple[str, ...], timing: Timing, finer: int = 1
) -> Simulator:
    """The simulator of these arguments, by their value: whether one was compiled before changes no result. Of a device without laws that
    relax it is the same for a record before which the device had moved."""
    if timing.resumed:
        plain = compiled_simulator(device, free, channels, timing._replace(resumed=False), finer)
        if not plain.relaxing:
            return plain
    return Simulator(device, free, channels, *timing, finer)


class Linearised:
    """F_S (n_s, n_s), F_f (n_s, m), H_S (n_y, n_s) and H_f (n_y, m) as functions of S, u, u+, ambient.

    `patterns`: which of their entries can differ from zero.
    """

    def __init__(self, one: ca.Function) -> None:
        self.patterns = [ca.DM(one.sparsity_out(i), 1).full() > 0 for i in range(one.n_out())]
        given = one.mx_in()
        self._one = ca.Function("dense", given, [ca.densify(value) for value in one(*given)])
        self._batched: dict[int, ca.Function] = {}

    def evaluate_along(self, S: np.ndarray, *inputs: np.ndarray) -> list[np.ndarray]:
        """The four matrices at n samples, each (n, ., .), for arguments (n, .)."""
        n = len(S)
        if n not in self._batched:
            self._batched[n] = self._one.map(n)
        values = evaluate(self._batched[n], S, *inputs)
        return [v.reshape(n, *p.T.shape).transpose(0, 2, 1) for v, p in zip(values, self.patterns, strict=True)]

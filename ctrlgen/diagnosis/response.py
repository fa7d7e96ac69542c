"""A model on a record: what it reads, and how that changes with every free parameter.

State S = (x, z), drive u, ambient e, free parameters p:

    S+ = F(S, u, u+, e, p),  y = H(S, u, e, p),
    D+ = F_S D + F_p,        dy/dp = H_S D + H_p,   D = dS/dp.

What depends on p alone (a Jacobian of struts, say) is computed once for a record, not once a sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.devices import Device
from ctrlgen.diagnosis.mapped import Recursion, evaluate
from ctrlgen.model import Model, build_model
from ctrlgen.motion import balanced, next_sample
from ctrlgen.recording import Record

START_NEWTON_STEPS = 12  # from home to the first displacement; later ones start from the sample before
POSE_NEWTON_STEPS = 8
WORTH = 500  # operations on parameters alone, from which on they are done once a record


class Response:
    """The readings `channels` of `device` with the parameters `free`, for records of one sample time."""

    def __init__(
        self, device: Device, free: Sequence[str], channels: Sequence[str], sample_time: float, linear: bool
    ) -> None:
        self.free, self.channels, self.sample_time, self.linear = tuple(free), tuple(channels), sample_time, linear
        self.ambient = ca.SX.sym("ambient")
        look_back = sample_time if np.isfinite(sample_time) else None
        self.model: Model = build_model(device, free, self.ambient, look_back)
        self.n_x, self.n_s = self.model.x.numel(), self.model.x.numel() + self.model.z.numel()

    @cached_property
    def initial(self) -> tuple[int, ...]:
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
    def _kernel(self) -> tuple[ca.Function, ca.Function]:
        """(p -> constants, their Jacobian) and (S, u, u+, e, constants -> S+, y, F_S, F_c, H_S, H_c)."""
        m = self.model
        S, e = ca.vertcat(m.x, m.z), self.ambient
        steps = POSE_NEWTON_STEPS if not np.isfinite(self.sample_time) else 4
        after = next_sample(m, self.sample_time, self.linear, steps)
        following = ca.vertcat(after.x, after.z)
        if np.isfinite(self.sample_time):
            y = self._observed
        else:  # a settled pose is read after it has settled
            y = ca.substitute(self._observed, ca.vertcat(m.x, m.z, m.u), ca.vertcat(after.x, after.z, after.u_next))
        c, value = m.p, m.p
        rows, symbols, parametric = ca.extract_parametric([following, y], m.p, {"extract_trivial": True})
        if ca.Function("work", [m.p], parametric).n_instructions() > WORTH:
            (following, y), c, value = rows, ca.vertcat(ca.SX(0, 1), *symbols), ca.vertcat(ca.SX(0, 1), *parametric)
        constants = ca.Function("constants", [m.p], [value, ca.jacobian(value, m.p)])
        slopes = [ca.jacobian(a, b) for a in (following, y) for b in (S, c)]
        sample = ca.Function(
            "sample", [S, m.u, after.u_next, e, c], [following, y, *slopes], {"cse": True}
        )  # fmt: skip
        return constants, sample

    def linearised(self, p: np.ndarray, chosen: Sequence[int]) -> Linearised:
        """Along any motion, for the `chosen` m of the free numbers, at `p`."""
        constants, sample = self._kernel
        c, by_p = constants(p)
        given = self._symbols[:4]
        _, _, F_S, F_c, H_S, H_c = sample(*given, c)
        by_f = by_p[:, list(chosen)]
        return Linearised(ca.Function("linearised", given, [F_S, F_c @ by_f, H_S, H_c @ by_f]))

    def begin(self, record: Record, p: np.ndarray) -> np.ndarray:
        """S before the first sample: actuators at rest; the stage at home, or in balance where it has no inertia."""
        m = self.model
        x = m.rest.copy()
        x[list(m.clocks)] = record.time[0] if np.isfinite(self.sample_time) else 0.0
        if m.inertial or not np.isfinite(self.sample_time):
            return np.concatenate([x, 0.0 * m.z_scale])
        z = balanced(m, m.x, m.u, START_NEWTON_STEPS)
        start = ca.Function("start", [m.x, m.z, m.u, m.p, self.ambient], [z])
        return np.concatenate([x, start(x, m.z_scale, record.drive[0], p, self._ambients(record)[0]).full().ravel()])

    @staticmethod
    def _ambients(record: Record) -> np.ndarray:
        return np.zeros(len(record.time)) if record.ambient is None else record.ambient

    def outputs(self, record: Record, p: np.ndarray, start: np.ndarray | None = None) -> np.ndarray:
        """Readings (n, n_y), SI; `start` is added to what a record may start with."""
        return self.motion(record, p, start)[1]

    def motion(self, record: Record, p: np.ndarray, start: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """S after each sample (n, n_s) and the readings (n, n_y), SI."""
        c = np.tile(self._kernel[0](p)[0].full().T, (len(record.time), 1))
        return self._moving.run(self._start(record, p, start), *self._inputs(record), c)

    def sensitivities(
        self, record: Record, p: np.ndarray, start: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Readings (n, n_y) and their derivatives (n, n_y, n_p + len(initial)) by `free`, then by what the record starts with."""
        constants, _ = self._kernel
        c, by_p = constants(p)
        k, n_i, n_y, n = len(self.free), len(self.initial), len(self.channels), len(record.time)
        D_0 = np.zeros((self.n_s, k + n_i))
        D_0[list(self.initial), k + np.arange(n_i)] = 1.0
        begin = np.concatenate([self._start(record, p, start), D_0.ravel(order="F")])
        slow = (np.tile(np.reshape(v, (1, -1)), (n, 1)) for v in (c.full(), np.array(by_p.nonzeros())))
        values = self._sensitive.run(begin, *self._inputs(record), *slow)[1]
        return values[:, :n_y], values[:, n_y:].reshape(n, k + n_i, n_y).transpose(0, 2, 1)

    @cached_property
    def _moving(self) -> Recursion:
        """The sample map."""
        S, *others = self._symbols
        values = [ca.densify(value) for value in self._kernel[1](S, *others)[:2]]
        return Recursion(ca.Function("one", [S, *others], values))

    @cached_property
    def _sensitive(self) -> Recursion:
        """The sample map with its derivatives carried along; the nonzeros of dc/dp come as an argument."""
        k, n_i = len(self.free), len(self.initial)
        by_p = ca.SX.sym("by_p", self._kernel[0].sparsity_out(1))
        seed = ca.horzcat(by_p, ca.SX(by_p.shape[0], n_i))
        S, *others = (ca.SX.sym(f"s{i}", s.numel()) for i, s in enumerate(self._symbols))  # an empty one has no name
        D = ca.SX.sym("D", self.n_s, k + n_i)
        following, y, F_S, F_c, H_S, H_c = self._kernel[1](S, *others)
        results = (following, F_S @ D + F_c @ seed), (y, H_S @ D + H_c @ seed)
        given = [ca.vertcat(S, ca.vec(D)), *others, ca.vertcat(ca.SX(0, 1), *by_p.nonzeros())]
        values = [ca.densify(ca.vertcat(a, ca.vec(b))) for a, b in results]
        return Recursion(ca.Function("one", given, values, {"cse": True}))

    @cached_property
    def _symbols(self) -> list[ca.MX]:
        """S, u, u+, ambient, constants."""
        n_u, n_c = self.model.u.numel(), self._kernel[0].size1_out(0)
        return [ca.MX.sym(name, n) for name, n in (("S", self.n_s), ("u", n_u), ("u1", n_u), ("e", 1), ("c", n_c))]

    def _start(self, record: Record, p: np.ndarray, start: np.ndarray | None) -> np.ndarray:
        S = self.begin(record, p)
        if start is not None:
            S[list(self.initial)] += start
        return S

    def _inputs(self, record: Record) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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

    def along(self, S: np.ndarray, *inputs: np.ndarray) -> list[np.ndarray]:
        """Each at n samples, (n, ., .); all arguments (n, .)."""
        n = len(S)
        if n not in self._mapped:
            self._mapped[n] = self._one.map(n)
        values = evaluate(self._mapped[n], S, *inputs)
        return [v.reshape(n, *p.T.shape).transpose(0, 2, 1) for v, p in zip(values, self.patterns, strict=True)]

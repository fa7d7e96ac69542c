"""The slopes of the readings by the amplitude of every hypothesis, at once.

No hypothesis is simulated: its term is evaluated along the fitted motion and injected where it acts,
S+ = F(S, u) + F_delta delta, y = H(S, u) + H_delta delta, linearised along the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import casadi as ca
import numpy as np
from scipy.linalg import expm

from ctrlgen.chain import channels
from ctrlgen.diagnosis.fit import Fit, Fitter
from ctrlgen.diagnosis.hypotheses import PARAMETER, Hypothesis, nominal_links
from ctrlgen.diagnosis.probe import with_probes
from ctrlgen.diagnosis.response import Response
from ctrlgen.effect import Place
from ctrlgen.recording import Record

Peaks = dict[tuple[Place, int], dict[str, float]]  # of the signal ("channel") and of the displacement ("travel") [SI]

BLOCK = 5000  # samples worked on at a time
SETTLED_LAG = 1e9  # s: the lags of a settled pose have passed
LOST = 1e100


@dataclass(frozen=True)
class Column:
    """One hypothesis with one choice of shape; `injections` (probe, sign) where its term enters."""

    hypothesis: Hypothesis
    shape: dict[str, float]
    probes: tuple[int, ...]
    size: float
    one_sided: int
    range: tuple[float, float] = (-np.inf, np.inf)  # of the amplitude's change, in sizes


def peaks(fitter: Fitter, fit: Fit) -> Peaks:
    """How far the signals at every place go in the records to fit."""
    found: Peaks = {}
    links = nominal_links(fit.structure.device)
    responses = fit.structure.responses(fitter.recording, fitter.cache)
    places = [(place, i) for place in (Place.DRIVE, Place.FORCE) for i in range(len(channels(links, place)))]
    for record, start in zip(fitter.to_fit, fit.starts, strict=True):
        response = responses[record.sample_time, record.linear]
        m, n = response.model, len(record.time)
        seen = [m.seen(place, i, None, {}) for place, i in places]
        rows = m.closed(ca.vertcat(*(ca.vertcat(s.value, s.displacement) for s in seen)))
        f = ca.Function("signals", [ca.vertcat(m.x, m.z), m.u, response.ambient, m.p], [rows])
        S = response.motion(record, fit.theta, start if len(start) else None)[0]
        values = f.map(n)(S.T, record.drive.T, response._ambients(record)[None, :], np.tile(fit.theta[:, None], (1, n)))
        most = np.nan_to_num(np.abs(values.full())).max(axis=1).reshape(-1, 2)
        for where, row in zip(places, most, strict=True):
            old = found.get(where, {"channel": 0.0, "travel": 0.0})
            found[where] = {"channel": max(old["channel"], row[0]), "travel": max(old["travel"], row[1])}
    return found


class Sums:
    """Inner products, accumulated over blocks of samples."""

    def __init__(self) -> None:
        self.JJ = self.JS = self.Jr = self.Sr = self.SS = self.norm2 = None

    def add(self, J: np.ndarray, S: np.ndarray, r: np.ndarray) -> None:
        """Inner products of one block: free slopes J, hypotheses S, residual r."""
        parts = {
            "JJ": J.T @ J,
            "JS": J.T @ S,
            "Jr": J.T @ r,
            "Sr": S.T @ r,
            "SS": S.T @ S,
            "norm2": np.einsum("ij,ij->j", S, S),
        }
        for name, value in parts.items():
            old = getattr(self, name)
            setattr(self, name, value if old is None else old + value)


class Slopes:
    """The slopes of the readings by every hypothesis' amplitude on one record."""

    def __init__(
        self,
        fitter: Fitter,
        fit: Fit,
        record: Record,
        hypotheses: list[Hypothesis],
        lines: tuple[float, ...],
        peaks: Peaks,
    ) -> None:
        self.fitter, self.fit, self.record, self.lines, self.peaks = fitter, fit, record, lines, peaks
        device = fit.structure.described
        probed, probes = with_probes(device, nominal_links(fit.structure.device))
        self.numbers = [h for h in hypotheses if h.effect == PARAMETER]
        known = [u.path for u in fit.structure.unknowns]
        self.probe_paths = list(probes.values())
        number_paths = [h.path for h in self.numbers if h.path not in known]
        free = [*known, *number_paths, *self.probe_paths]
        key = ("screen", fit.structure.causes, record.sample_time, record.linear)
        if key not in fitter.cache:
            fitter.cache[key] = Response(probed, free, fitter.recording.channels, record.sample_time, record.linear)
        self.response: Response = fitter.cache[key]
        self.p = self.response.model.p_nominal.copy()
        self.p[: len(known)] = fit.theta
        self.p[len(known) + len(number_paths) :] = 0.0
        self.probe_index = {where: free.index(path) for where, path in probes.items()}
        self.columns, self.evaluators = self._laws([h for h in hypotheses if h.effect != PARAMETER], device)
        self.law_columns = len(self.columns)
        for h in self.numbers:
            i = free.index(h.path)
            value = self.p[i]
            size = max(abs(value), 1e-3) * 1e-3
            self.columns.append(Column(h, {"value": value}, (i,), size, 0, (-500.0, 500.0)))

    def _laws(self, hypotheses: list[Hypothesis], device: object) -> tuple[list[Column], SimpleNamespace]:
        """Columns, and the terms' derivatives by amplitude as functions along the motion."""
        m, structure = self.response.model, self.fit.structure
        links = nominal_links(structure.device)
        columns, terms, states, rates, stepped, clocks, blocks = [], [], [], [], [], [], []
        amplitudes, offs, sizes = [], [], []
        for h in hypotheses:
            law, where = h.law, structure.place(h)
            names = [w.channel for w in channels(links, law.place)]
            partner = names.index(h.of) if h.of else None
            at = [(i, partner) for i in (range(len(names)) if h.at == "all" else [names.index(h.at)])]
            if law.mutual:
                at += [(partner, i) for i, _ in at]
            amplitude = law.amplitude()
            low, high = (where.si(b, amplitude) for b in amplitude.bounds)
            off, size = where.si(amplitude.off, amplitude), 1e-3 * (high - low)
            side = 1 if off <= low else -1 if off >= high else 0
            for shape in h.shapes(where, self.lines, self.peaks.get((law.place, at[0][0]))):
                for i, other in at:
                    m_states = {s.name: ca.SX.sym(f"m{len(states)}_{s.name}") for s in law.states}
                    a = ca.SX.sym("a")
                    p = SimpleNamespace(**shape, **{amplitude.name: a})
                    s = m.seen(law.place, i, other, m_states)
                    instance = law(h.at, {}, h.of)
                    new = instance.update(s, p)
                    s.__dict__.update(new)
                    change = {state.name: ca.SX(float(state.clock)) for state in law.states} | instance.rates(s, p)
                    terms.append(ca.SX(instance.term(s, p)))
                    amplitudes.append(a)
                    offs.append(off)
                    sizes.append(size)
                    blocks.append(list(range(len(states), len(states) + len(m_states))))
                    states += list(m_states.values())
                    rates += [ca.substitute(ca.SX(change[state.name]), a, off) for state in law.states]
                    stepped += [
                        ca.substitute(ca.SX(new[state.name]), a, off) if state.stepped else None for state in law.states
                    ]
                    clocks += [state.clock for state in law.states]
                meant = amplitude.expected or (low - off, high - off)
                span = (meant[0] / size, meant[1] / size)
                columns.append(Column(h, shape, tuple(self.probe_index[law.place, i] for i, _ in at), size, side, span))
        if terms:  # each term depends on its own amplitude alone: one derivative of all of them
            every, a = ca.vertcat(*terms), ca.vertcat(*amplitudes)
            slope = ca.substitute(ca.jtimes(every, a, ca.DM(sizes)), a, ca.DM(offs))
            terms = ca.vertsplit(slope)
        return columns, SimpleNamespace(
            terms=terms, states=states, rates=rates, stepped=stepped, clocks=clocks, blocks=blocks
        )

    def _motion(self, start: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """S (n, n_s) at which terms are evaluated, and S before each sample (n, n_s)."""
        r, record = self.response, self.record
        after, _ = r.motion(record, self.p, start)
        before = np.vstack([r._start(record, self.p, start), after[:-1]])
        return (before if np.isfinite(r.sample_time) else after), before

    def _terms(self, at: np.ndarray) -> np.ndarray:
        """Every law's dterm/damplitude along the motion, (n, n_terms)."""
        r, record, law = self.response, self.record, self.evaluators
        m, n = r.model, len(record.time)
        if not law.terms:
            return np.zeros((n, 0))
        S, e = ca.vertcat(m.x, m.z), r.ambient
        memory = ca.vertcat(ca.SX(0, 1), *law.states)
        dx = ca.vertcat(ca.SX(0, 1), *law.rates)
        given = [S, m.u, e, m.p]
        inputs = [at.T, record.drive.T, r._ambients(record)[None, :], np.tile(self.p[:, None], (1, n))]
        values = np.zeros((0, n))
        if memory.numel():
            values = self._memories(memory, m.closed(dx), given, inputs)
        f = ca.Function("terms", [*given, memory], [m.closed(ca.vertcat(*law.terms))], {"cse": True})
        found = f.map(n)(*inputs, values).full().T
        lost = ~np.all(np.abs(found) < LOST, axis=0)  # memories that have left the numbers say nothing
        found[:, lost] = 0.0
        return found

    def _memories(self, memory: ca.SX, rates: ca.SX, given: list[ca.SX], inputs: list[np.ndarray]) -> np.ndarray:
        """The laws' own states before each sample, (n_memory, n): linear ones exactly, stepped ones by their update."""
        h = self.response.sample_time
        settled = not np.isfinite(h)
        h = SETTLED_LAG if settled else h
        law, m = self.evaluators, self.response.model
        after = list(ca.vertsplit(memory + h * rates))
        for block in law.blocks:
            A = ca.jacobian(rates[block], memory[block])
            if not ca.symvar(A):  # rates of linear memories: m + h phi_1(h A) rates
                phi = _phi_1(h * ca.DM(A).full())
                for k, i in enumerate(block):
                    after[i] = memory[i] + h * ca.DM(phi[k : k + 1]) @ rates[block]
        for i, new in enumerate(law.stepped):
            if new is not None:
                after[i] = m.closed(new)
            elif law.clocks[i]:
                after[i] = memory[i] + (1.0 if settled else h)
        step = ca.Function("memories", [memory, *given], [ca.vertcat(*after)], {"cse": True})
        start = np.zeros(memory.numel())
        start[[i for i, clock in enumerate(law.clocks) if clock]] = 0.0 if settled else self.record.time[0]
        values = step.mapaccum(inputs[0].shape[1])(start, *inputs).full()
        return values if settled else np.hstack([start[:, None], values[:, :-1]])

    def accumulate(self, sums: Sums, white: np.ndarray, J: np.ndarray, index: int, start: np.ndarray | None) -> None:
        """Adds this record's inner products, block by block."""
        r, record, noise = self.response, self.record, self.fitter.noise
        at, before = self._motion(start)
        terms = self._terms(at)
        n, n_y, order = len(record.time), len(r.channels), max(map(len, noise.ar), default=0)
        linear = self._linearised()
        D = np.zeros((r.n_s, len(self.columns)))
        tail = np.zeros((0, n_y, len(self.columns)))
        usable = noise.usable(record.valid)
        u, u_1, e = r._inputs(record)
        for a in range(0, n, BLOCK):
            b = min(a + BLOCK, n)
            block = linear.map(b - a)(
                before[a:b].T, u[:, a:b], u_1[:, a:b], e[:, a:b], np.tile(self.p[:, None], (1, b - a))
            )
            F_S, F_p, H_S, H_p = (_stacked(x, b - a) for x in block)
            following = (
                np.vstack([terms[a + 1 : b + 1], terms[-1:]])[: b - a] if np.isfinite(r.sample_time) else terms[a:b]
            )
            Y, D = self._propagate(F_S, F_p, H_S, H_p, terms[a:b], following, D)
            joined = np.concatenate([tail, Y])
            valid = np.vstack([np.ones((len(tail), n_y), bool), np.ones((b - a, n_y), bool)])
            W = noise.whiten(joined, valid)[len(tail) :]
            tail = joined[-order:] if order else tail
            mask = usable[a:b].reshape(-1)
            S = np.nan_to_num(W.reshape(-1, len(self.columns)))[mask]
            sums.add(J[a * n_y : b * n_y][mask], S, white[a:b].reshape(-1)[mask])

    def _linearised(self) -> ca.Function:
        """(S, u, u+, e, p) -> F_S, F_p, H_S, H_p for the columns' probes and numbers."""
        constants, sample = self.response._kernel
        r = self.response
        args = [
            ca.MX.sym(k, n)
            for k, n in (
                ("S", r.n_s),
                ("u", r.model.u.numel()),
                ("u1", r.model.u.numel()),
                ("e", 1),
                ("p", len(r.free)),
            )
        ]
        c, by_p = constants(args[4])
        _, _, F_S, F_c, H_S, H_c = sample(*args[:4], c)
        return ca.Function("linearised", args, [ca.densify(x) for x in (F_S, F_c @ by_p, H_S, H_c @ by_p)])

    def _propagate(self, F_S, F_p, H_S, H_p, terms, following, D):
        """Slopes of the readings (n, n_y, columns) over one block, and D after it."""
        n = len(terms)
        inject_x = np.zeros((n, F_S.shape[1], len(self.columns)))
        inject_y = np.zeros((n, H_S.shape[1], len(self.columns)))
        mean = (terms + following) / 2
        k = 0
        for j, column in enumerate(self.columns):
            for probe in column.probes:
                if j < self.law_columns:
                    inject_x[:, :, j] += F_p[:, :, probe] * mean[:, k, None]
                    inject_y[:, :, j] += H_p[:, :, probe] * terms[:, k, None]
                    k += 1
                else:
                    inject_x[:, :, j] = F_p[:, :, probe] * column.size
                    inject_y[:, :, j] = H_p[:, :, probe] * column.size
        states = np.empty((n, *D.shape))
        for i in range(n):
            states[i] = D
            D = F_S[i] @ D + inject_x[i]
        return H_S @ states + inject_y, D


def _stacked(flat: ca.DM, n: int) -> np.ndarray:
    """(rows, n * columns) as CasADi's map gives it -> (n, rows, columns)."""
    dense = flat.full()
    return dense.reshape(dense.shape[0], n, -1).transpose(1, 0, 2)


def _phi_1(M: np.ndarray) -> np.ndarray:
    """M^-1 (e^M - 1), also where M is singular: the upper right block of exp [[M, 1], [0, 0]]."""
    n = len(M)
    if n == 1:
        return np.expm1(M) / M if M[0, 0] else np.ones((1, 1))
    return expm(np.block([[M, np.eye(n)], [np.zeros((n, 2 * n))]]))[:n, n:]

"""Step 6: every hypothesis at once, by the score test.

With r the whitened residual of the fitted structure, J its whitened slopes (prior rows included) and s the slope of
the readings by one amplitude at `off`, for fixed shape,

    s_perp = s - J (J'J)^-1 J's,   z = s_perp'r/|s_perp|,   amplitude = s_perp'r/|s_perp|^2.

Under "nothing left out" the z of all hypotheses are jointly normal with the correlation cos(s_perp, s_perp'); the
largest |z| is judged against simulations of that. |cos| near one says what this record cannot tell apart.

The slope is found without simulating each hypothesis: its term is evaluated along the fitted motion and injected where
it acts, S+ = F(S, u) + F_delta delta, linearised along the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import casadi as ca
import numpy as np

from ctrlgen.chain import channels
from ctrlgen.diagnosis.fit import Fit, Fitter
from ctrlgen.diagnosis.hypotheses import PARAMETER, Hypothesis
from ctrlgen.diagnosis.probe import with_probes
from ctrlgen.diagnosis.response import Response
from ctrlgen.recording import Record

BLOCK = 5000  # samples worked on at a time
OWN_LEFT = 1e-5  # of |s|^2: below, the hypothesis cannot be told from what is free already
TOO_ALIKE = 0.04  # of a slope left beside the others of a set, below which amplitudes mean nothing
BEAM = 200  # sets kept at each size
LARGEST_SET = 4
LOOSE = 0.35  # how far beyond its bounds a linear estimate of an amplitude may lie, relative
NULLS = 2000  # simulated records without mismatch
SETTLED_LAG = 1e9


@dataclass(frozen=True)
class Suspect:
    """One hypothesis with the shape that fits best: its `z`, the amplitude that would explain it, its share of slope
    left after projection, and its column in the correlation matrix."""

    hypothesis: Hypothesis
    start: dict[str, float]
    z: float
    left: float
    column: int


@dataclass(frozen=True, eq=False)
class Screened:
    """Suspects, the most conspicuous first; `cosine` between their projected slopes; `threshold` the |z| that a record
    without mismatch exceeds with one percent chance, anywhere among all hypotheses; `amplitude_sd` [SI] of each;
    `together` sets of two to four suspects that would jointly explain most, with the chi^2 they would: causes can hide
    each other."""

    suspects: tuple[Suspect, ...]
    cosine: np.ndarray
    threshold: float
    amplitude_sd: dict[tuple[str, str], float]
    together: tuple[tuple[float, tuple[Suspect, ...]], ...] = ()

    def alike(self, a: Suspect, b: Suspect) -> float:
        """|cos| between two suspects."""
        return float(abs(self.cosine[a.column, b.column]))


@dataclass(frozen=True)
class _Column:
    """One hypothesis with one choice of shape; `injections` (probe, sign) where its term enters."""

    hypothesis: Hypothesis
    shape: dict[str, float]
    probes: tuple[int, ...]
    size: float
    one_sided: int
    range: tuple[float, float] = (-np.inf, np.inf)  # of the amplitude's change, in sizes


class Screen:
    """The hypotheses of one fitter, ready to be compared with any fit."""

    def __init__(self, fitter: Fitter, hypotheses: list[Hypothesis], seed: int = 0) -> None:
        self.fitter, self.hypotheses, self.seed = fitter, hypotheses, seed

    def run(self, fit: Fit) -> Screened:
        """All hypotheses that the fit does not contain yet."""
        taken = {(c.effect, c.location, c.of) for c in fit.structure.causes}
        open_ = [h for h in self.hypotheses if (h.effect, h.location, h.of) not in taken]
        sums = _Sums()
        columns: list[_Column] = []
        first = 0
        for index, record in enumerate(self.fitter.to_fit):
            slopes = _Slopes(self.fitter, fit, record, open_)
            columns = slopes.columns
            n = record.valid.size
            white = fit.residual[first : first + n].reshape(record.valid.shape)
            J = fit.J[first : first + n]
            first += n
            slopes.accumulate(sums, white, J, index, fit.starts[index] if fit.starts else None)
        return self._judge(fit, columns, sums, fit.J[first:])

    def _judge(self, fit: Fit, columns: list[_Column], sums: _Sums, prior: np.ndarray) -> Screened:
        if not columns or sums.SS is None:
            return Screened((), np.zeros((0, 0)), np.inf, {})
        norm = sums.norm2
        A = sums.JJ + prior.T @ prior
        scale = np.sqrt(np.maximum(np.diag(A), 1e-300))
        inverse = np.linalg.pinv(A / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
        project = inverse @ sums.JS
        own = norm - np.einsum("ij,ij->j", sums.JS, project)
        score = sums.Sr - project.T @ sums.Jr
        left = np.where(norm > 0, own / np.where(norm > 0, norm, 1.0), 0.0)
        seen = np.flatnonzero((left > OWN_LEFT) & (norm > 0) & np.isfinite(norm))
        gram = sums.SS - sums.JS.T @ project  # from the rows kept
        d = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        cosine = np.clip(gram / np.outer(d, d), -1, 1)
        z = np.zeros(len(columns))
        z[seen] = score[seen] / np.sqrt(own[seen])
        for j in seen:
            if columns[j].one_sided and z[j] * columns[j].one_sided < 0:
                z[j] = 0.0
        best: dict[Hypothesis, int] = {}
        for j in seen:
            h = columns[j].hypothesis
            if h not in best or abs(z[j]) > abs(z[best[h]]):
                best[h] = int(j)
        order = sorted(best.values(), key=lambda j: -abs(z[j]))
        suspects = tuple(self._suspect(columns[j], z[j], score[j] / own[j], left[j], j) for j in order)
        sds = {
            (columns[j].hypothesis.effect, columns[j].hypothesis.location): float(columns[j].size / np.sqrt(own[j]))
            for j in order
        }
        together = _Together(columns, seen, score, own, left, cosine, self._suspect)
        return Screened(suspects, cosine, self._threshold(cosine[np.ix_(seen, seen)]), sds, together.search())

    def _suspect(self, column: _Column, z: float, amplitude: float, left: float, j: int) -> Suspect:
        h = column.hypothesis
        if h.effect == PARAMETER:
            start = {"value": column.shape["value"] + amplitude * column.size}
        else:
            start = {**column.shape, h.law.amplitude().name: amplitude * column.size}
        return Suspect(h, start, float(z), float(left), j)

    def _threshold(self, cosine: np.ndarray) -> float:
        """The 99th percentile of the largest |z| when nothing was left out."""
        if not len(cosine):
            return np.inf
        values, vectors = np.linalg.eigh(cosine)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        draws = np.random.default_rng(self.seed).standard_normal((NULLS, len(cosine)))
        return float(np.quantile(np.abs(draws @ root.T).max(axis=1), 0.99))


class _Together:
    """Sets of hypotheses by the chi^2 that they explain jointly, from scores and cosines alone.

    Adding hypothesis j to a set K raises it by (z_j - c_jK C_KK^-1 z_K)^2/(1 - c_jK C_KK^-1 c_Kj).
    """

    def __init__(self, columns, seen, score, own, left, cosine, suspect) -> None:
        self.columns = [columns[j] for j in seen]
        self.index = seen
        self.root = np.sqrt(own[seen])
        self.z = score[seen] / self.root
        self.left, self.C, self.suspect = left[seen], cosine[np.ix_(seen, seen)], suspect
        self.group = (
            np.unique([hash(c.hypothesis) for c in self.columns], return_inverse=True)[1]
            if len(seen)
            else np.zeros(0, int)
        )

    def search(self) -> tuple[tuple[float, tuple[Suspect, ...]], ...]:
        """Sets of every size from two, those whose amplitudes make sense, the best first."""
        beam: list[tuple[float, tuple[int, ...]]] = [(0.0, ())]
        found = []
        for size in range(1, LARGEST_SET + 1):
            beam = self._grown(beam)
            if size > 1:
                sets = [(gain, self._amplitudes(members), members) for gain, members in beam]
                found += [(gain, self._suspects(members, b)) for gain, b, members in sets if self._sensible(members, b)]
        return tuple(sorted(found, key=lambda f: -f[0]))

    def _grown(self, beam: list[tuple[float, tuple[int, ...]]]) -> list[tuple[float, tuple[int, ...]]]:
        grown: dict[frozenset, tuple[float, tuple[int, ...]]] = {}
        for gain, members in beam:
            K = list(members)
            if K:
                W = np.linalg.solve(self.C[np.ix_(K, K)], self.C[K])
                rest = 1 - np.einsum("kj,kj->j", self.C[K], W)
                score = self.z - W.T @ self.z[K]
            else:
                rest, score = np.ones(len(self.z)), self.z
            more = np.where(rest > TOO_ALIKE, score**2 / np.maximum(rest, TOO_ALIKE), 0.0)
            more[np.isin(self.group, self.group[K])] = 0.0
            for j in np.argsort(-more)[:BEAM]:
                if more[j] > 0:
                    key = frozenset(self.group[[*K, j]])
                    if key not in grown or grown[key][0] < gain + more[j]:
                        grown[key] = (gain + float(more[j]), (*members, int(j)))
        return sorted(grown.values(), key=lambda g: -g[0])[:BEAM]

    def _amplitudes(self, members: tuple[int, ...]) -> np.ndarray:
        K = list(members)
        return np.linalg.solve(self.C[np.ix_(K, K)], self.z[K]) / self.root[K]

    def _sensible(self, members: tuple[int, ...], b: np.ndarray) -> bool:
        """Whether amplitudes are about inside their bounds, and in the range that the effect expects."""
        for k, value in zip(members, b, strict=True):
            low, high = self.columns[k].range
            if not low - LOOSE * (high - low) * (low < 0) <= value <= high + LOOSE * (high - low):
                return False
        return True

    def _suspects(self, members: tuple[int, ...], b: np.ndarray) -> tuple[Suspect, ...]:
        return tuple(
            self.suspect(self.columns[k], self.z[k], value, self.left[k], int(self.index[k]))
            for k, value in zip(members, b, strict=True)
        )


class _Sums:
    """Inner products, accumulated over blocks of samples."""

    def __init__(self) -> None:
        self.JJ = self.JS = self.Jr = self.Sr = self.SS = self.norm2 = None

    def add(self, J: np.ndarray, S: np.ndarray, r: np.ndarray) -> None:
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


class _Slopes:
    """The slopes of the readings by every hypothesis' amplitude on one record."""

    def __init__(self, fitter: Fitter, fit: Fit, record: Record, hypotheses: list[Hypothesis]) -> None:
        self.fitter, self.fit, self.record = fitter, fit, record
        device = fit.structure.described
        probed, probes = with_probes(device)
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
            self.columns.append(_Column(h, {"value": value}, (i,), size, 0, (-500.0, 500.0)))

    def _laws(self, hypotheses: list[Hypothesis], device: object) -> tuple[list[_Column], SimpleNamespace]:
        """Columns, and the terms' derivatives by amplitude as functions along the motion."""
        m, structure = self.response.model, self.fit.structure
        links = device.links(device.values())
        columns, terms, states, rates, stepped, clocks = [], [], [], [], [], []
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
            for shape in h.shapes(where):
                for i, other in at:
                    m_states = {s.name: ca.SX.sym(f"m{len(states)}_{s.name}") for s in law.states}
                    a = ca.SX.sym("a")
                    p = SimpleNamespace(**shape, **{amplitude.name: a})
                    s = m.seen(law.place, i, other, m_states)
                    instance = law(h.at, {}, h.of)
                    new = instance.update(s, p)
                    s.__dict__.update(new)
                    change = {state.name: ca.SX(float(state.clock)) for state in law.states} | instance.rates(s, p)
                    term = ca.substitute(ca.jacobian(ca.SX(instance.term(s, p)), a), a, off)
                    terms.append(term * size)
                    states += list(m_states.values())
                    rates += [ca.substitute(ca.SX(change[state.name]), a, off) for state in law.states]
                    stepped += [
                        ca.substitute(ca.SX(new[state.name]), a, off) if state.stepped else None for state in law.states
                    ]
                    clocks += [state.clock for state in law.states]
                meant = amplitude.expected or (low - off, high - off)
                span = (meant[0] / size, meant[1] / size)
                columns.append(
                    _Column(h, shape, tuple(self.probe_index[law.place, i] for i, _ in at), size, side, span)
                )
        return columns, SimpleNamespace(terms=terms, states=states, rates=rates, stepped=stepped, clocks=clocks)

    def _motion(self, start: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """S (n, n_s) at which terms are evaluated, and S before each sample (n, n_s)."""
        r, record = self.response, self.record
        constants, sample = r._kernel
        c = constants(self.p)[0]
        S, u, u_1, e = (
            ca.MX.sym(k, n) for k, n in (("S", r.n_s), ("u", r.model.u.numel()), ("u1", r.model.u.numel()), ("e", 1))
        )
        following, y = sample(S, u, u_1, e, c)[:2]
        one = ca.Function("one", [S, u, u_1, e], [following, y])
        begin = r._start(record, self.p, start)
        after = one.mapaccum(len(record.time))(begin, *r._inputs(record))[0].full().T
        before = np.vstack([begin, after[:-1]])
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
        heated = lambda expr: ca.substitute(expr, m.heat, m.heat_of_drive)  # noqa: E731
        given = [S, m.u, e, m.p]
        inputs = [at.T, record.drive.T, r._ambients(record)[None, :], np.tile(self.p[:, None], (1, n))]
        values = np.zeros((0, n))
        if memory.numel():
            values = self._memories(memory, heated(dx), given, inputs)
        f = ca.Function("terms", [*given, memory], [heated(ca.vertcat(*law.terms))], {"cse": True})
        return f.map(n)(*inputs, values).full().T

    def _memories(self, memory: ca.SX, rates: ca.SX, given: list[ca.SX], inputs: list[np.ndarray]) -> np.ndarray:
        """The laws' own states before each sample, (n_memory, n): lags exactly, stepped ones by their update."""
        h = self.response.sample_time
        settled = not np.isfinite(h)
        A = ca.jacobian(rates, memory)
        rate = ca.diag(A)
        updates = []
        for i, new in enumerate(self.evaluators.stepped):
            if new is not None:
                updates.append(ca.substitute(new, self.response.model.heat, self.response.model.heat_of_drive))
            elif self.evaluators.clocks[i]:
                updates.append(memory[i] + (1.0 if settled else h))
            else:
                step = SETTLED_LAG if settled else h
                slope = rate[i] if not rate[i].is_zero() else ca.SX(-1e-12)
                gain = ca.if_else(ca.fabs(slope * step) < 1e-9, step, (ca.exp(ca.fmax(slope * step, -700)) - 1) / slope)
                updates.append(memory[i] + gain * rates[i])
        step_function = ca.Function("memories", [memory, *given], [ca.vertcat(*updates)], {"cse": True})
        start = np.zeros(memory.numel())
        start[[i for i, clock in enumerate(self.evaluators.clocks) if clock]] = 0.0 if settled else self.record.time[0]
        after = step_function.mapaccum(inputs[0].shape[1])(start, *inputs).full()
        return after if settled else np.hstack([start[:, None], after[:, :-1]])

    def accumulate(self, sums: _Sums, white: np.ndarray, J: np.ndarray, index: int, start: np.ndarray | None) -> None:
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

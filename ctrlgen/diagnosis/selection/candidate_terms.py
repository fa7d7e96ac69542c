"""The laws of all hypotheses, evaluated along one motion: their terms' slopes by the amplitude, with their own memories.

A law at one place with one shape is one term, however many hypotheses hold it: "all" actuators share those of each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace

import casadi as ca
import numpy as np

from ctrlgen.core.errors import CtrlgenError
from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.estimation.simulator import Simulator
from ctrlgen.diagnosis.estimation.structure import Structure
from ctrlgen.diagnosis.hypotheses.hypotheses import DataHints, Hypothesis, nominal_physics
from ctrlgen.diagnosis.settings import CANDIDATE_TERMS
from ctrlgen.effects import Effect, Place
from ctrlgen.model.effect_terms import channels
from ctrlgen.numerics.phi_functions import lag_increment, phi_matrices

UNUSABLE = (CtrlgenError, ValueError, TypeError, AttributeError, LookupError, ArithmeticError, RuntimeError)
"""What a law that cannot be written down at a place may end with."""

Peaks = dict[tuple[Place, int], dict[str, float]]  # by unit, SI
REACHED = ("channel", "travel", "travel/s")


@dataclass(frozen=True)
class CandidateTerm:
    """One hypothesis with one choice of shape. `probes` where it enters, `terms` which term enters at each; `size` [SI]
    of the amplitude's unit, `one_sided` the only sign it may have (0: both)."""

    hypothesis: Hypothesis
    shape: dict[str, float]
    probes: tuple[int, ...]
    terms: tuple[int, ...]
    size: float
    one_sided: int
    range: tuple[float, float] = (-np.inf, np.inf)  # of the amplitude's change, in sizes


def signal_peaks(fitter: Fitter, fit: Fit) -> Peaks:
    """How far the signals at every place go in the records to fit."""
    found: Peaks = {}
    physics = nominal_physics(fit.structure.device)
    simulators = fit.structure.simulators(fitter.recording, fitter.cache)
    reached = (Place.DRIVE, Place.FORCE, Place.DISPLACEMENT)
    places = [(place, i) for place in reached for i in range(len(channels(physics, place)))]
    for record, start in zip(fitter.fit_records, fit.initial_states, strict=True):
        simulator = simulators[record.timing]
        m, n = simulator.model, len(record.time)
        seen = [m.law_inputs(place, i, None, {}) for place, i in places]
        still = ca.SX.zeros(1)
        given = [(s.value, s.displacement, still if s.velocity is None else s.velocity) for s in seen]
        rows = m.closed(ca.vertcat(*(value for values in given for value in values)))
        f = ca.Function("signals", [ca.vertcat(m.x, m.z), m.u, simulator.ambient, m.p], [rows])
        S = simulator.simulate_states(record, fit.theta, start if len(start) else None)[0]
        values = f.map(n)(
            S.T, record.drive.T, simulator.ambient_of(record)[None, :], np.tile(fit.theta[:, None], (1, n))
        )
        most = np.nan_to_num(np.abs(values.full())).max(axis=1).reshape(-1, len(REACHED))
        for where, row in zip(places, most, strict=True):
            old = found.get(where, {})
            found[where] = {unit: max(old.get(unit, 0.0), value) for unit, value in zip(REACHED, row, strict=True)}
    return found


@dataclass(frozen=True, eq=False)
class _Term:
    """One law at one place: its `value`, by its amplitude `a` around `off` in steps of `size`, with its states' symbols,
    `rates` and new values (`stepped`, None where a state is not)."""

    value: ca.SX
    a: ca.SX
    off: float
    size: float
    states: list[ca.SX]
    rates: list[ca.SX]
    stepped: list[ca.SX | None]
    clocks: list[bool]


class CandidateTerms:
    """The terms of `hypotheses` on the motions of `simulator`, and one column for every choice of shape.

    `unusable`: the hypotheses whose law cannot be written down here, and why.
    """

    def __init__(
        self, simulator: Simulator, structure: Structure, hypotheses: list[Hypothesis],
        probes: dict[tuple[Place, int], int], seen: Callable[[Place, int], DataHints],
    ) -> None:  # fmt: skip
        self.simulator = simulator
        self.terms: list[_Term] = []
        self._known: dict[tuple, int] = {}
        self.columns: list[CandidateTerm] = []
        self.unusable: dict[Hypothesis, str] = {}
        for h in hypotheses:
            try:
                self.columns += list(self._of(h, structure, probes, seen))
            except UNUSABLE as error:
                self.unusable[h] = f"{type(error).__name__}: {error}"

    def _of(
        self,
        h: Hypothesis,
        structure: Structure,
        probes: dict[tuple[Place, int], int],
        seen: Callable[[Place, int], DataHints],
    ) -> Iterator[CandidateTerm]:
        law, where = h.law, structure.channel_of(h)
        names = [c.name for c in channels(nominal_physics(structure.device), law.place)]
        partner = names.index(h.of) if h.of else None
        at: list[tuple[int, int | None]] = [
            (i, partner) for i in (range(len(names)) if h.at == "all" else [names.index(h.at)])
        ]
        if law.symmetric and partner is not None:
            at += [(partner, i) for i, _ in at]
        amplitude = law.amplitude()
        low, high = (where.si(b, amplitude) for b in amplitude.bounds)
        off, size = where.si(amplitude.off or 0.0, amplitude), 1e-3 * (high - low)
        side = 1 if off <= low else -1 if off >= high else 0
        meant = h.prior.of(amplitude).fixed_range or (low - off, high - off)
        span = (meant[0] / size, meant[1] / size)
        entered = tuple(probes[law.place, i] for i, _ in at)
        here = seen(law.place, at[0][0])
        for shape in h.shapes(where, here):
            for finite in (0.0, *h.secants(where, here)):
                terms = tuple(self._term(law(h.at, {}, h.of), i, other, shape, off, size, finite) for i, other in at)
                yield CandidateTerm(h, shape, entered, terms, size, side, span)

    def _term(
        self, law: Effect, i: int, partner: int | None, shape: dict[str, float], off: float, size: float, finite: float
    ) -> int:
        """The slope at `off`, or from there to the amplitude `finite`."""
        key = (law.kind, i, partner, tuple(shape.items()), off, size, finite)
        if key not in self._known:
            states = {s.name: ca.SX.sym(f"m{len(self.terms)}_{s.name}") for s in law.states}
            a = ca.SX.sym("a")
            p = SimpleNamespace(**shape, **{law.amplitude().name: a})
            s = self.simulator.model.law_inputs(law.place, i, partner, states, law.order)
            new = law.after_sample(s, p)
            s.__dict__.update(new)
            change = {state.name: ca.SX(float(state.clock)) for state in law.states} | law.rates(s, p)
            self._known[key] = len(self.terms)
            at = finite or off
            rates = [ca.substitute(ca.SX(change[state.name]), a, at) for state in law.states]
            stepped = [ca.substitute(ca.SX(new[state.name]), a, at) if state.stepped else None for state in law.states]
            clocks = [state.clock for state in law.states]
            value = ca.SX(law.term(s, p))
            if finite:
                value = ca.substitute(value, a, finite) * (a - off) / (finite - off)
            self.terms.append(_Term(value, a, off, size, list(states.values()), rates, stepped, clocks))
        return self._known[key]

    def start(self, time: float) -> np.ndarray:
        """The laws' states before the first sample, at `time` [s]: zero, but for clocks."""
        clocks = [clock for term in self.terms for clock in term.clocks]
        return np.where(clocks, time if np.isfinite(self.simulator.sample_time) else 0.0, 0.0)

    @cached_property
    def driven(self) -> list[int]:
        """The terms that jump with a drive which is held from sample to sample."""
        m = self.simulator.model
        if self.simulator.linear or self.simulator.poses:
            return []
        jumping = ca.vertcat(m.u, m.held, m.heat)
        return [k for k, term in enumerate(self.terms) if ca.depends_on(ca.jacobian(term.value, term.a), jumping)]

    def compiled(self, p: np.ndarray) -> ca.Function:
        """(memory, S, u, ambient, S one sample on) -> (memory after the sample, every dterm/damplitude * size, that of the
        `driven` terms at the end of the sample), with the numbers `p`.

        A pose is read with the memories at the end of its dwell.
        """
        m = self.simulator.model
        memory = ca.vertcat(ca.SX(0, 1), *(s for term in self.terms for s in term.states))
        after = m.closed(ca.vertcat(ca.SX(0, 1), *(value for term in self.terms for value in self._after(term))))
        found = end = ca.SX(0, 1)
        S, S_next = ca.vertcat(m.x, m.z), ca.SX.sym("S_next", m.x.numel() + m.z.numel())
        if self.terms:  # each term depends on its own amplitude alone: one derivative of all of them
            a, offs = ca.vertcat(*(t.a for t in self.terms)), ca.DM([t.off for t in self.terms])
            every = ca.vertcat(*(t.value for t in self.terms))
            open_ = ca.substitute(ca.jtimes(every, a, ca.DM([t.size for t in self.terms])), a, offs)
            found = m.closed(open_)
            if self.driven:  # the drive stays as the sample began
                (end,) = ca.substitute([open_[self.driven]], [memory, S], [after, S_next])
                end = m.closed(end)
        if self.simulator.poses:
            found = ca.substitute(found, memory, after)
        given = [memory, S, m.u, self.simulator.ambient, S_next]
        general = ca.Function("general", [*given, m.p], [after, found, end])
        return ca.Function("laws", given, [ca.densify(value) for value in general(*given, p)], {"cse": True})

    def _after(self, term: _Term) -> list[ca.SX]:
        """The states of one law after a sample: linear ones exactly, stepped ones by their update."""
        if not term.states:
            return []
        h = self.simulator.sample_time
        settled = not np.isfinite(h)
        h = CANDIDATE_TERMS.settled_time if settled else h
        memory, rates = ca.vertcat(*term.states), ca.vertcat(*term.rates)
        A = ca.jacobian(rates, memory)
        if not ca.symvar(A):
            step = h * ca.DM(phi_matrices(h * ca.DM(A).full(), 1)[1]) @ rates
        elif A.sparsity().is_diag():
            step = lag_increment(ca.diag(A), [rates], h)
        else:
            step = h * rates
        return [
            new if new is not None else state + (1.0 if settled else h) if clock else state + change
            for state, new, clock, change in zip(
                term.states, term.stepped, term.clocks, ca.vertsplit(step), strict=True
            )
        ]

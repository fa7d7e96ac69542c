"""The laws of all hypotheses, evaluated along one motion: their terms' slopes by the amplitude, with their own memories.

A law at one place with one shape is one term, however many hypotheses hold it: "all" actuators share those of each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.diagnosis.selection.failures import FAILURES, reason_of
from ctrlgen.diagnosis.selection.law_terms import CompiledTerms, LawTerm, LawTerms, SignalsRead
from ctrlgen.effects import Effect, Place
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import DataHints, Hypothesis, nominal_physics
from ctrlgen.estimation.settings import CANDIDATE_TERMS
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.effect_terms import channels

# by unit, SI
Peaks = dict[tuple[Place, int], dict[str, float]]
REACHED = ("channel", "travel", "travel/s", "channel/s")


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
    # of the amplitude's change, in sizes
    range: tuple[float, float] = (-np.inf, np.inf)


def signals_along(fitter: Fitter, fit: Fit) -> list[dict[tuple[Place, int], np.ndarray]]:
    """Of every record to fit the signals (4, n) at every place [SI]: the channel's, the displacement, its rate, and the channel's change
    from the sample before over the sample time."""
    physics = nominal_physics(fit.structure.device)
    reached = (Place.DRIVE, Place.FORCE, Place.DISPLACEMENT)
    places = [(place, i) for place in reached for i in range(len(channels(physics, place)))]
    along = []
    for record, start in zip(fitter.fit_records, fit.initial_states, strict=True):
        simulator = fitter.simulator(fit.structure, record)
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
        signals = np.nan_to_num(values.full()).reshape(len(places), 3, n)
        changes = np.diff(signals[:, :1], axis=2, prepend=signals[:, :1, :1]) / record.sample_time
        along.append(dict(zip(places, np.concatenate([signals, changes], axis=1), strict=True)))
    return along


def signal_peaks(along: list[dict[tuple[Place, int], np.ndarray]]) -> Peaks:
    """How far the signals at every place go in the records to fit."""
    peaks: Peaks = {}
    for record in along:
        for where, signals in record.items():
            old = peaks.get(where, {})
            most = np.abs(signals).max(axis=1)
            peaks[where] = {unit: max(old.get(unit, 0.0), value) for unit, value in zip(REACHED, most, strict=True)}
    return peaks


class CandidateTerms:
    """The terms of `hypotheses` on the motions of `simulator`, and one column for every choice of shape.

    `unusable`: the hypotheses whose law cannot be written down here, and why.
    """

    def __init__(
        self,
        laws: LawTerms,
        simulator: Simulator,
        structure: Structure,
        hypotheses: list[Hypothesis],
        probes: dict[tuple[Place, int], int],
        seen: Callable[[Place, int], DataHints],
    ) -> None:
        self.laws, self.simulator = laws, simulator
        self.terms: list[LawTerm] = []
        # in `terms`
        self._places: dict[LawTerm, int] = {}
        self.columns: list[CandidateTerm] = []
        self.unusable: dict[Hypothesis, str] = {}
        for h in hypotheses:
            try:
                self.columns += list(self._of(h, structure, probes, seen))
            except FAILURES as error:
                self.unusable[h] = reason_of(error)

    def _of(
        self,
        h: Hypothesis,
        structure: Structure,
        probes: dict[tuple[Place, int], int],
        seen: Callable[[Place, int], DataHints],
    ) -> Iterator[CandidateTerm]:
        law, where = h.law, h.channel_on(structure.device)
        places = channels(nominal_physics(structure.device), law.place)
        partner = [c.name for c in places].index(h.of) if h.of else None
        at: list[tuple[int, int | None]] = [(i, partner) for i in h.acts_on(structure.device)]
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
        """The place in `terms` of the slope at `off`, or from there to the amplitude `finite`."""
        term = self.laws.term(law, i, partner, shape, off, size, finite)
        if term not in self._places:
            self._places[term] = len(self.terms)
            self.terms.append(term)
        return self._places[term]

    @cached_property
    def groups(self) -> list[tuple[list[int], CompiledTerms]]:
        """The terms kind by kind: their places in `terms`, and their functions."""
        kinds: dict[str, list[int]] = {}
        for k, term in enumerate(self.terms):
            kinds.setdefault(term.kind, []).append(k)
        return [
            (places, self.laws.compiled([self.terms[k] for k in places], [k in self.driven for k in places]))
            for places in kinds.values()
        ]

    @cached_property
    def signals(self) -> SignalsRead:
        """The signals that the laws read."""
        return SignalsRead(self.simulator, self.laws.symbols, self.laws.samples)

    @cached_property
    def driven(self) -> list[int]:
        """The terms that jump with a drive which is held from sample to sample."""
        if self.simulator.linear or self.simulator.poses:
            return []
        jumping = self.signals.jumping
        return [k for k, term in enumerate(self.terms) if term.reads & jumping]

    def start(self, time: float) -> list[np.ndarray]:
        """The laws' states before the first sample, group by group, at `time` [s]: zero, but for clocks."""
        begin = time if np.isfinite(self.simulator.sample_time) else 0.0
        clocks = ([clock for k in places for clock in self.terms[k].clocks] for places, _ in self.groups)
        return [np.where(np.array(each, bool), begin, 0.0) for each in clocks]

    def settled(self, p: np.ndarray, memories: list[np.ndarray], rows: int, *first: np.ndarray) -> list[np.ndarray]:
        """The laws' states after so many rows of one motion, the `first` row of what `along` is given, from `memories` on, of those that
        settle: they are then where a device is that had moved before the record."""
        size = CANDIDATE_TERMS.block
        held = [np.repeat(x[None, :], size + 1, axis=0) for x in first]
        found = memories
        for _ in range(-(-rows // size)):
            found = [states[size - 1] for states in self.along(p, found, *held)[0]]
        settle = ([settles for k in places for settles in self.terms[k].settle] for places, _ in self.groups)
        begun = zip(settle, memories, found, strict=True)
        return [np.where(np.array(each, bool) & np.isfinite(new), new, old) for each, old, new in begun]

    def along(
        self, p: np.ndarray, memories: list[np.ndarray], *motion: np.ndarray
    ) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """Memories after each of n samples, group by group, every dterm/damplitude * size (n, terms) and that of the `driven` terms
        at the end of each sample, with the numbers `p`; `motion` is S (n, n_s), u, the surroundings, and S one sample on.

        A pose is read with the memories at the end of its dwell.
        """
        n = len(motion[0])
        slopes, ends = np.empty((n, len(self.terms))), np.empty((n, len(self.terms)))
        read, at_end = self.signals.along(p, *motion)
        after = []
        for (places, group), memory in zip(self.groups, memories, strict=True):
            rows = self.signals.columns(group.reads)
            states, slopes[:, places], jumped = group.along(memory, read[:, rows], at_end[:, rows])
            ends[:, [k for k in places if k in self.driven]] = jumped
            after.append(states)
        return after, slopes, ends[:, self.driven]

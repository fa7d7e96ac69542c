"""The slopes of the readings by the amplitude of every hypothesis, at once.

No hypothesis is simulated: its term is evaluated along the fitted motion and injected where it acts,
S+ = F(S, u) + F_delta delta, y = H(S, u) + H_delta delta, linearised along the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.candidate_terms import CandidateTerm, CandidateTerms
from ctrlgen.diagnosis.selection.law_terms import LawTerms
from ctrlgen.diagnosis.selection.ltv_propagation import LtvPropagation
from ctrlgen.effects import Place
from ctrlgen.estimation.disturbance_inputs import with_disturbance_inputs
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, DataHints, Hypothesis, nominal_physics
from ctrlgen.estimation.late_readings import LateSlopes
from ctrlgen.estimation.number_sizes import sizes_of_numbers
from ctrlgen.estimation.settings import CANDIDATE_TERMS, FIT, SIMULATION
from ctrlgen.estimation.simulator import Simulator, compiled_simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record, Timing


@dataclass(eq=False)
class Sums:
    """Inner products over all samples of the m hypotheses' slopes S: with the k free directions U (k, m), with the residual
    (m,), and with one another (m, m), or each with itself alone (m,)."""

    US: np.ndarray
    Sr: np.ndarray
    SS: np.ndarray

    @classmethod
    def none(cls, k: int, m: int, each_alone: bool = False) -> Sums:
        """The sums over no sample, from which adding begins."""
        return cls(np.zeros((k, m)), np.zeros(m), np.zeros(m if each_alone else (m, m)))

    def plus(self, other: Sums) -> Sums:
        """The sums over the samples of both."""
        return Sums(self.US + other.US, self.Sr + other.Sr, self.SS + other.SS)

    @property
    def squares(self) -> np.ndarray:
        """(m,) of each with itself."""
        return self.SS if self.SS.ndim == 1 else np.diag(self.SS)


def _probed(
    structure: Structure, hypotheses: Sequence[Hypothesis], channels: tuple[str, ...], timing: Timing
) -> tuple[Simulator, dict[tuple[Place, int], int]]:
    """A simulator of which the numbers of the structure, those suspected and a disturbance at every place are free, and where each
    disturbance is among them."""
    device, probes = with_disturbance_inputs(structure.expanded_device, nominal_physics(structure.device))
    known = [p.path for p in structure.free_parameters]
    suspected = [h.path for h in hypotheses if h.effect == PARAMETER and h.path not in known]
    free = (*known, *suspected, *probes.values())
    entered = {where: free.index(path) for where, path in probes.items()}
    return compiled_simulator(device, free, channels, timing, structure.finer), entered


def law_terms(
    device: Device, hypotheses: Sequence[Hypothesis], channels: tuple[str, ...], timing: Timing, samples: int
) -> LawTerms:
    """The terms of laws in any structure of a device, along so many `samples` of one timing."""
    return LawTerms(timing, _probed(Structure(device), hypotheses, channels, timing)[0].model, samples)


class ScoreGradient:
    """The slopes of the readings by every hypothesis' amplitude on one record."""

    def __init__(
        self,
        fitter: Fitter,
        fit: Fit,
        record: Record,
        hypotheses: list[Hypothesis],
        seen: Callable[[Place, int], DataHints],
        laws: LawTerms,
    ) -> None:
        self.fitter, self.record = fitter, record
        self.simulator, entered = _probed(fit.structure, hypotheses, fitter.recording.channels, record.timing)
        free = self.simulator.free
        self.p = self.simulator.model.p_nominal.copy()
        self.p[: len(fit.theta)] = fit.theta
        self.p[list(entered.values())] = 0.0
        numbers = [h for h in hypotheses if h.effect == PARAMETER]
        others = [h for h in hypotheses if h.effect != PARAMETER]
        self.laws = CandidateTerms(laws, self.simulator, fit.structure, others, entered, seen)
        places = [free.index(h.path) for h in numbers]
        # the constant terms of numbers
        typical = sizes_of_numbers(fit.structure.device)
        self.sizes = np.array([FIT.suspected_step * typical[h.path] for h in numbers])
        self.columns = list(self.laws.columns)
        for k, (h, i) in enumerate(zip(numbers, places, strict=True)):
            term, size = len(self.laws.terms) + k, float(self.sizes[k])
            self.columns.append(CandidateTerm(h, {"value": self.p[i]}, (i,), (term,), size, 0, (-500.0, 500.0)))
        self.linear = self.simulator.linearise(self.p, range(len(free)))
        self.spread = LtvPropagation(self.linear.patterns, self.columns)

    def sums(self, white: np.ndarray, U: np.ndarray, start: np.ndarray | None, each_alone: bool = False) -> Sums:
        """This record's inner products with its whitened residual `white` (n, n_y) and free directions U (n, n_y, k). Of many slopes those
        with one another take half of the time, and are left out where `each_alone` is asked for."""
        noise, seen = self.fitter.error, self.spread.seen
        corner = noise.corner
        usable = noise.usable(self.record.valid)
        SS = [np.zeros(len(s) if each_alone else (len(s), len(s))) for s in seen]
        tails = [np.zeros((len(ar), len(s))) for ar, s in zip(noise.ar, seen, strict=True)]
        total = Sums.none(U.shape[2], len(self.columns), each_alone)
        lost = np.zeros(len(self.laws.terms) + len(self.sizes), bool)
        h = self.record.sample_time
        late = [(r.row, LateSlopes(r.reach(self.p), h, r.how)) for r in self.simulator.late]
        for a, b, readings in self.blocks(start, lost):
            for i, Y in enumerate(readings):
                for row, slopes in late:
                    Y = slopes.late(Y) if row == i else Y
                if len(noise.ar[i]):
                    Y = np.vstack([tails[i], Y])
                    tails[i] = Y[len(Y) - len(tails[i]) :]
                S = noise.whiten_channel(Y, i)
                S[~usable[a:b, i]] = 0.0
                # large residuals count less, as in the fit
                S *= np.minimum(1.0, corner[i] / np.maximum(np.abs(white[a:b, i]), 1e-300))[:, None]
                if not np.isfinite(S.sum()):
                    S = np.nan_to_num(S)
                SS[i] += np.einsum("ij,ij->j", S, S) if each_alone else S.T @ S
                total.US[:, seen[i]] += U[a:b, i].T @ S
                total.Sr[seen[i]] += white[a:b, i] @ S
        for products, columns in zip(SS, seen, strict=True):
            total.SS[columns if each_alone else np.ix_(columns, columns)] += products
        gone = [j for j, column in enumerate(self.columns) if lost[list(column.terms)].any()]
        total.US[:, gone], total.Sr[gone], total.SS[gone], total.SS[..., gone] = 0.0, 0.0, 0.0, 0.0
        return total

    def blocks(self, start: np.ndarray | None, lost: np.ndarray) -> Iterator[tuple[int, int, Iterator[np.ndarray]]]:
        """Blocks of samples [a, b) with what each channel reads of its columns; marks terms as `lost` on the way.

        Every block is evaluated with the sample after it, whose terms act together with its last ones; those of a held drive
        act together with what they become before it changes.
        """
        r, record, n = self.simulator, self.record, len(self.record.time)
        series = not r.poses
        after, _ = r.simulate_states(record, self.p, start)
        record = r.aligned(record, self.p)
        before = np.vstack([r.starting_state(record, self.p, start), after[:-1]])
        inputs = (before, *r.inputs(record))
        seen = (before if series else after, record.applied, inputs[3], after)
        size = min(CANDIDATE_TERMS.block, n)
        memory = self.laws.start(record.time[0])
        if record.resumed and series:
            memory = self.laws.settled(self.p, memory, min(n, SIMULATION.settling_samples), *(x[0] for x in seen))
        for a in range(0, n, size):
            # the last block is filled up
            here = np.minimum(np.arange(a, a + size + 1), n - 1)
            k = min(size, n - a)
            memories, slopes, ends = self.laws.along(self.p, memory, *(x[here] for x in seen))
            memory = [states[size - 1] for states in memories]
            if a + k == n:
                slopes[k:] = slopes[k - 1]
            slopes = np.hstack([slopes, np.repeat(self.sizes[None, :], size + 1, axis=0)])
            lost |= ~np.all(np.abs(slopes) < CANDIDATE_TERMS.diverged, axis=0)
            # memories that have diverged say nothing
            slopes[:, lost] = 0.0
            f, following = slopes[:k], slopes[1 : k + 1].copy() if series else slopes[:k]
            following[:, self.laws.driven] = np.where(lost[self.laws.driven], 0.0, ends[:k])
            linear = self.linear.evaluate_along(*(x[here[:size]] for x in inputs))
            yield a, a + k, self.spread.readings([block[:k] for block in linear], f, following)

"""The search: stepwise selection of causes. Each round fits the suspects of the screen jointly with the device's parameters,
adds the best one, tries to replace each cause, and drops causes that are no longer needed.

Fits are weighed by noise and by the discrepancy that the present best model leaves, which each round estimates again. A
cause is added where the criterion of `model_selection` and the held-out records want it and nothing speaks against its
meaning (`objections`); a cause that meets an objection is taken out of its candidate, the rest is fitted again and compared
again, and what is refused although it scores better is kept with its reason. No trial can end the search: one that cannot be
built or simulated is noted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.estimation.noise_update import update_noise, update_noise_size
from ctrlgen.diagnosis.estimation.structure import Structure
from ctrlgen.diagnosis.hypotheses.hypotheses import PARAMETER, Hypothesis
from ctrlgen.diagnosis.selection.candidate_model import (
    CandidateModel,
    Refusal,
    Round,
    SearchResult,
    linearised_optimum,
    restart,
    restart_with,
)
from ctrlgen.diagnosis.selection.model_selection import ModelSelection, scored
from ctrlgen.diagnosis.selection.objections import objections
from ctrlgen.diagnosis.selection.screen import Screen, Screened, Suspect
from ctrlgen.diagnosis.settings import DISCREPANCY, MODEL_SELECTION, SEARCH

FAILURES = (ValueError, ArithmeticError, RuntimeError, np.linalg.LinAlgError)
"""What a trial may end with: a stage that cannot be built, a balance or integrator that does not converge."""


class Searcher:
    """Looks for the causes of a mismatch in one recording. It replaces its own fitter as it learns the errors."""

    def __init__(self, fitter: Fitter, screen: Screen, step: Callable[[str], None]) -> None:
        self.fitter, self.screen, self.step = fitter, screen, step
        self.fitted: dict[frozenset, tuple[CandidateModel, int]] = {}
        self.screens: dict[frozenset, tuple[Fit, Screened]] = {}
        self.refused: list[Refusal] = []
        self.failed: list[str] = []
        self.candidates_per_round = SEARCH.candidates_per_round * (
            SEARCH.cheap_factor if fitter.recording.kind == "poses" else 1
        )

    @property
    def selection(self) -> ModelSelection:
        """The comparison of candidates under the present noise."""
        return ModelSelection(self.fitter, self.fit_candidate)

    def use(self, fitter: Fitter) -> None:
        """Goes on with another fitter: fits and screens under other errors are forgotten."""
        self.fitter = fitter
        self.screen.fitter = fitter
        self.fitted.clear()
        self.screens.clear()

    def fit_candidate(
        self,
        structure: Structure,
        cause: Hypothesis | None = None,
        steps: int = SEARCH.candidate_steps,
        nested: Fit | None = None,
    ) -> CandidateModel:
        """Fits and scores one structure, in which that of `nested` is nested. A structure that was fitted before is not
        fitted again unless its start values are better than that fit."""
        key = frozenset(structure.causes)
        known, done = self.fitted.get(key, (None, 0))
        if known is not None and done >= steps and known.fit.objective <= self.fitter.initial_objective(structure):
            return replace(known, cause=cause)
        fit = self.fitter.fit(structure, steps=steps, nested=nested)
        if known is not None and known.fit.objective <= fit.objective:
            self.fitted[key] = (known, steps)
            return replace(known, cause=cause)
        found = scored(self.fitter, fit, cause)
        self.fitted[key] = (found, steps)
        return found

    def run(self, device: Device) -> SearchResult:
        """Rounds until nothing more is justified, again where they have taught the noise; then the rivals of each cause."""
        fitter, described = self.fitter.described(device)
        self.use(fitter)
        rounds: list[Round] = []
        current = self._with_noise_update(self.fit_candidate(restart(described), steps=40))
        for _ in range(SEARCH.most_noise_updates):
            current = self._forward_rounds(current, rounds)
            before = self.fitter.noise
            noise = update_noise(self.fitter, current.fit) if self.fitter.recording.kind == "series" else before
            if noise is before:
                break
            self.use(self.fitter.with_noise(noise))
            current = self._prune(self._with_errors(self._converged(current)))
            if np.allclose(noise.floor, before.floor, rtol=SEARCH.same_noise):
                break
        current = self._prune(self._with_errors(self._converged(current)))
        nominal = self._converged(self.fit_candidate(Structure(device), steps=40))
        each = range(len(current.causes))
        bare = tuple(self._without(current, k, nominal) for k in each)
        rivals = tuple(self._rivals(current, k) for k in each)
        return SearchResult(self.fitter, nominal, current, bare, rivals, tuple(rounds), self._screened(current))

    def _without(self, current: CandidateModel, k: int, nominal: CandidateModel) -> CandidateModel:
        """The model without cause k; the device as described where that cannot be simulated."""
        found = self._tried(restart(current.fit).without(k), None, None)
        return found[0] if found else nominal

    def _forward_rounds(self, current: CandidateModel, rounds: list[Round]) -> CandidateModel:
        """Forward rounds from `current`, with swaps in between, until nothing more is justified; appends each to `rounds`."""
        visited = [current]
        while True:
            self.step(f"screening, {len(current.causes)} causes so far")
            self.refused, self.failed = [], []
            screened = self._screened(current)
            if len(current.causes) >= SEARCH.most_causes[
                self.fitter.recording.kind
            ] or self.selection.residual_within_model_form_error(current):
                return current
            candidates = self._fit_each(current.fit, self._significant(current, screened))
            if not current.errors.is_noise:
                candidates = tuple(self.restart_elsewhere(t, current, screened) for t in candidates)
            candidates = (*candidates, *self._other_clocks(current, candidates))
            if self.selection.parameters_may_mask_cause(current.fit):
                candidates = (*candidates, *self._as_stated(current))
            candidates = (*candidates, *self.fit_subsets(current, screened, candidates))
            candidates = self._converge_promising(current, candidates)
            candidates = tuple(self.selection.ranked(self._all_pruned(current, candidates)))
            better = [t for t in candidates if self.selection.improves_enough(current, t)]
            best = self._most_parsimonious(current, better, screened) if better else current
            rounds.append(self._round(screened, candidates, current, best))
            if not better:
                return current
            n = len(current.causes)
            current = self._prune(self._swap(best, n))
            same = next((v for v in visited if frozenset(v.causes) == frozenset(current.causes)), None)
            if same is not None and self.selection.advantage(current, same) < SEARCH.rival_difference:
                return current  # no better than when it was there before
            current = self._with_noise_update(self._with_errors(self._converged(current)))
            visited.append(current)

    def _round(
        self, screened: Screened, candidates: Sequence[CandidateModel], before: CandidateModel, best: CandidateModel
    ) -> Round:
        """The record of a round, with the refused candidates that score better than what was taken."""
        errors = self.selection.reference((before, *candidates, best))
        criteria = tuple(self.selection.criterion(t, errors) for t in candidates)
        ahead = [r for r in self.refused if self.selection.advantage(r.candidate, best) > 0]
        failed = tuple(dict.fromkeys(self.failed))
        return Round(
            screened,
            tuple(candidates),
            criteria,
            before,
            self.selection.criterion(before, errors),
            tuple(ahead),
            failed,
        )

    def _with_errors(self, candidate: CandidateModel) -> CandidateModel:
        """The same structure under the discrepancy that it leaves itself, estimated and fitted in turn."""
        for _ in range(DISCREPANCY.updates):
            fitter = self.fitter.with_errors_of(candidate.fit)
            if np.allclose(fitter.error.weighted.sd, self.fitter.error.weighted.sd, rtol=DISCREPANCY.same):
                break
            self.use(fitter)
            candidate = self.fit_candidate(restart(candidate.fit), candidate.cause, steps=40)
        return candidate

    def _all_pruned(self, current: CandidateModel, candidates: Sequence[CandidateModel]) -> list[CandidateModel]:
        """The candidates that meet no objection, and of the others what is left without the causes that do."""
        found: dict[frozenset, CandidateModel] = {}
        for candidate in candidates:
            if (kept := self._pruned(candidate, current.causes)) is not None:
                found.setdefault(frozenset(kept.causes), kept)
        return list(found.values())

    def _pruned(self, candidate: CandidateModel, accepted: Sequence[Hypothesis]) -> CandidateModel | None:
        """The candidate without the causes that meet an objection, fitted again; None where none of its new ones is left."""
        for _ in range(len(candidate.causes) + 1):
            against = self.objections(candidate, accepted)
            if not against:
                return candidate
            causes = tuple(candidate.causes[k] for k in against)
            self.refused.append(Refusal(candidate, causes, tuple(against.values())))
            structure = restart(candidate.fit)
            for k in sorted(against, reverse=True):
                structure = structure.without(k)
            if set(structure.causes) <= set(accepted):
                return None
            fitted = self._tried(structure, None, None)
            if not fitted:
                return None
            candidate = fitted[0]
        return None

    def objections(self, candidate: CandidateModel, accepted: Sequence[Hypothesis] = ()) -> dict[int, str]:
        """What speaks against the causes of a candidate that are not yet `accepted`."""
        exact = candidate.errors.is_noise and bool(self.fitter.noise.known.all())
        return objections(self.fitter.recording, candidate.fit, accepted, exact)

    def _converged(self, candidate: CandidateModel) -> CandidateModel:
        """The same candidate fitted until it converges; candidates are first fitted for a few steps only."""
        return self.fit_candidate(restart(candidate.fit), candidate.cause, steps=40)

    def _most_parsimonious(
        self, current: CandidateModel, better: list[CandidateModel], screened: Screened
    ) -> CandidateModel:
        """The plainest, once it and what takes away nearly as much so far are fitted to their end."""
        first = self.selection.most_parsimonious(better)
        near = self._close_contenders(current.fit.objective, first, [t for t in better if t is not first])
        ends = [self.restart_elsewhere(self._converged(t), current, screened) for t in (first, *near)]
        sound = [t for t in ends if not self.objections(t, current.causes)]
        return self.selection.most_parsimonious(sound or [first])

    def restart_elsewhere(
        self, candidate: CandidateModel, before: CandidateModel, screened: Screened
    ) -> CandidateModel:
        """The trial, its causes that are new begun again in the most promising of the other shapes screened, where more than
        noise is left: the shapes of one law may lie in several valleys."""
        others = {s.hypothesis: s.other_starts for s in screened.suspects}
        for k, cause in enumerate(candidate.causes):
            if cause in before.causes or candidate.errors.is_noise:
                continue
            structure, shapes = restart(candidate.fit), others.get(cause, ())
            size = cause.law.amplitude().name if shapes else ""
            begins = [*shapes, *({**shape, size: structure.starts[k][size]} for shape in shapes)]
            if begins:
                try:
                    restarted = sorted(
                        (structure.restarted(k, begin) for begin in begins), key=self.fitter.initial_objective
                    )
                    again = (self.fitter.fit(s, steps=SEARCH.candidate_steps) for s in restarted[: SEARCH.restarts])
                    best = min(again, key=lambda fit: fit.objective)
                    if best.objective < candidate.fit.objective:
                        candidate = self._converged(scored(self.fitter, best, candidate.cause))
                except FAILURES as error:
                    self.failed.append(f"{_name(cause)}: {error}")
        return candidate

    def _close_contenders(
        self, without: float, best: CandidateModel, others: list[CandidateModel]
    ) -> list[CandidateModel]:
        """The first of those that take away nearly as much of an objective as the best one."""
        least = SEARCH.nearly_best * (without - best.fit.objective)
        return [t for t in others if without - t.fit.objective >= least][: SEARCH.converged_candidates]

    def _converge_promising(
        self, current: CandidateModel, candidates: tuple[CandidateModel, ...]
    ) -> tuple[CandidateModel, ...]:
        """The trials, those driven to their end that leave least on the records to fit but are not justified so early."""
        best = sorted(candidates, key=lambda t: t.fit.objective)[: SEARCH.converged_candidates]
        early = [
            t
            for t in best
            if t.fit.objective < current.fit.objective and not self.selection.improves_enough(current, t)
        ]
        return tuple(self._converged(t) if t in early else t for t in candidates)

    def _with_noise_update(self, candidate: CandidateModel) -> CandidateModel:
        """The same structure under the noise that it leaves, where nothing else tells the noise."""
        if self.fitter.noise.known.all():
            return candidate
        for _ in range(SEARCH.most_noise_updates):  # the numbers move as the noise that holds them shrinks
            before = self.fitter.noise.sd
            self.use(self.fitter.with_noise(update_noise_size(self.fitter, candidate.fit)))
            candidate = self.fit_candidate(restart(candidate.fit), candidate.cause, steps=40)
            if np.allclose(before, self.fitter.noise.sd, rtol=0.02):
                break
        return candidate

    def _significant(self, current: CandidateModel, screened: Screened) -> list[Suspect]:
        return self._above(screened, self.selection.required_z2(current, screened))

    def _above(self, screened: Screened, need: float) -> list[Suspect]:
        loud = [s for s in screened.suspects if s.z**2 > need]
        chosen: list[Suspect] = []
        for s in loud:
            same = sum(c.hypothesis.effect == s.hypothesis.effect for c in chosen)
            if (
                s.z**2 >= SEARCH.smallest_score * loud[0].z ** 2
                and same < self.candidates_per_round // 3
                and len(chosen) < self.candidates_per_round
            ):
                chosen.append(s)
        return chosen

    def _fit_each(self, fit: Fit, suspects: list[Suspect]) -> tuple[CandidateModel, ...]:
        """Each suspect beside what is fitted."""
        candidates = []
        for s in suspects:
            self.step(f"trying {s.hypothesis.effect} at {s.hypothesis.location}")
            candidates += self._tried(restart_with(fit, s.hypothesis, s.start), s.hypothesis, fit)
        return tuple(candidates)

    def _other_clocks(self, current: CandidateModel, singles: Sequence[CandidateModel]) -> tuple[CandidateModel, ...]:
        """What an offset of the recorders' clocks explains, alone and beside the best of the `singles`, begun at the best of a
        few. The screen cannot see it: it shifts the drive itself."""
        h = min(r.sample_time for r in self.fitter.recording.records)
        open_ = (o for o in (h.beside(current.causes) for h in self.screen.hypotheses) if o is not None)
        clocks = [o for o in open_ if o.effect != PARAMETER and o.law.shifts_drive]
        if current.errors.is_noise or not np.isfinite(h):
            return ()
        found = []
        for cause in clocks:
            p = cause.law.amplitude()
            low, high = cause.bounds(p, current.fit.structure.channel_of(cause))
            starts = [s * 2**k * h for k in range(SEARCH.clock_doublings) for s in (1, -1)]
            self.step(f"trying {cause.effect} at {cause.location}")
            for beside in (current, *self.selection.ranked(singles)[: SEARCH.beside_clocks]):
                begun = [restart_with(beside.fit, cause, {p.name: s}) for s in starts if low <= s <= high]
                try:
                    best = min(begun, key=self.fitter.initial_objective)
                except FAILURES as error:
                    self.failed.append(f"{_name(cause)}: {error}")
                    continue
                found += self._tried(best, cause, beside.fit)
        return tuple(found)

    def _as_stated(self, current: CandidateModel) -> tuple[CandidateModel, ...]:
        """What is suspected of the device with its own numbers as stated: a fit that bends them so far sees what they hide
        no more."""
        stated = self.fitter.fit(replace(restart(current.fit), nominal_starts={}), steps=0)
        return self._fit_each(stated, self._significant(current, self.screen.run(stated)))

    def _tried(self, structure: Structure, cause: Hypothesis | None, nested: Fit | None = None) -> list[CandidateModel]:
        """The trial; none, with a note, where no such device can be built or simulated."""
        try:
            return [self.fit_candidate(structure, cause, nested=nested)]
        except FAILURES as error:
            self.failed.append(f"{_name(cause) if cause else 'a trial'}: {error}")
            return []

    def fit_subsets(
        self, current: CandidateModel, screened: Screened, singles: tuple[CandidateModel, ...]
    ) -> list[CandidateModel]:
        """Sets of suspects that promise more than any single one gave; each size must promise more than the smaller. None where
        a single one leaves noise alone."""
        if any(t.errors.is_noise and not current.errors.is_noise for t in singles) and self.fitter.noise.known.all():
            return []
        best = max((current.fit.objective - t.fit.objective for t in singles), default=0.0)
        least = min((t.fitted.excess for t in singles), default=np.inf)
        candidates: list[CandidateModel] = []
        for size in (2, 3, 4):
            explained = least <= (1 - MODEL_SELECTION.most_of_mismatch) * current.fitted.excess
            if size > 2 and explained and self.fitter.recording.kind == "series":
                break
            tried = 0
            used: dict[Hypothesis, int] = {}
            left = current.fit.objective - best
            enough = best + max(self.selection.required_z2(current, screened), SEARCH.subset_share * left)
            for promised, suspects in screened.subsets:
                if len(suspects) != size or promised < enough or tried >= self.candidates_per_round:
                    continue
                if max(used.get(s.hypothesis, 0) for s in suspects) >= max(2, self.candidates_per_round // 2):
                    continue
                structure = restart(current.fit)
                if len({(h.family, h.location) if h.family else h for h in (s.hypothesis for s in suspects)}) < size:
                    continue
                for s in suspects:
                    used[s.hypothesis] = used.get(s.hypothesis, 0) + 1
                    structure = structure.with_cause(s.hypothesis, s.start)
                self.step("trying " + ", ".join(f"{s.hypothesis.effect} at {s.hypothesis.location}" for s in suspects))
                candidates += self._tried(structure, suspects[-1].hypothesis, current.fit)
                tried += 1
            sound = [t for t in candidates if not self.objections(t)]
            best = max([best, *(current.fit.objective - t.fit.objective for t in sound)])
            least = min([least, *(t.fitted.excess for t in sound)])
        return candidates

    def _swap(self, current: CandidateModel, before: int) -> CandidateModel:
        """Each cause against what would be suspected in its place, now that the others are there; not what came alone to
        those `before`, which has been compared already."""
        causes = len(current.causes)
        for k in range(before if causes == before + 1 else causes):
            for rival in self._replacements(current, k):
                if self.selection.advantage(rival, current) > SEARCH.rival_difference and not self.objections(
                    rival, current.causes
                ):
                    current = self._converged(rival)
                    break
        return current

    def _replacements(self, current: CandidateModel, k: int) -> list[CandidateModel]:
        """What would be suspected instead of cause k, with all the rest as it is now: refitted, it may have gone astray."""
        structure = current.fit.structure
        others = restart(current.fit).without(k)
        try:
            bare = self.fitter.fit(others, steps=0)
            screened = self.screen.run(bare)
        except FAILURES as error:
            self.failed.append(f"without {_name(structure.causes[k])}: {error}")
            return []
        without = linearised_optimum(bare)
        gained = without - current.fit.objective
        able = [
            s
            for s in self._above(screened, self.selection.required_z2(current, screened))
            if s.z**2 > SEARCH.rival_share * gained and s.hypothesis != structure.causes[k]
        ]
        candidates = []
        for s in able[: SEARCH.most_rivals]:
            self.step(f"trying {s.hypothesis.effect} at {s.hypothesis.location} instead")
            candidates += self._tried(self.replace_cause(current.fit, k, others, s), s.hypothesis)
        near = self._close_contenders(without, current, self.selection.ranked(candidates))
        return self.selection.ranked([self._converged(t) if t in near else t for t in candidates])

    def replace_cause(self, fit: Fit, k: int, others: Structure, suspect: Suspect) -> Structure:
        """The suspect beside the `others` in place of cause k of a fit; of its family, begun with that one's numbers where
        that is better: what they have in common means the same."""
        structure = others.with_cause(suspect.hypothesis, suspect.start)
        cause = fit.structure.causes[k]
        if cause.family is None or (cause.family, cause.at) != (suspect.hypothesis.family, suspect.hypothesis.at):
            return structure
        common = {name: value for name, value in fit.values(k).items() if name in suspect.start}
        kin = (others.with_cause(suspect.hypothesis, s | common) for s in (suspect.start, *suspect.other_starts))
        return min((structure, *kin), key=self.fitter.initial_objective)

    def _screened(self, candidate: CandidateModel) -> Screened:
        key = frozenset(candidate.causes)
        fit, screened = self.screens.get(key, (None, None))
        if screened is None or fit is not candidate.fit:
            screened = self.screen.run(candidate.fit)
            self.screens[key] = candidate.fit, screened
        return screened

    def _prune(self, current: CandidateModel) -> CandidateModel:
        """The model without the causes that it does not need."""
        for k in reversed(range(len(current.causes))):
            for bare in self._tried(restart(current.fit).without(k), None):
                if not self._needed(bare, current) or self.selection.within_model_form_error(bare, current, k):
                    current = bare
        return current

    def _needed(self, bare: CandidateModel, current: CandidateModel) -> bool:
        """Whether `current` is worth its further cause. Where more than noise is left, what was chosen among many before need
        only keep its advantage."""
        if current.errors.is_noise:
            return self.selection.improves_enough(bare, current)
        return self.selection.advantage(current, bare) > 0

    def _rivals(self, current: CandidateModel, k: int) -> tuple[CandidateModel, ...]:
        """What explains alike in place of cause k, or is the special case of its law that the fit does not exclude."""
        there, special = current.causes, current.fit.nested_case(k)
        alike = [t for t in self._replacements(current, k) if not _same_name(t.cause, there[k])]
        alike = [
            t
            for t in alike
            if self.selection.advantage(current, t) < SEARCH.rival_difference
            or (special and t.cause and t.cause.effect == special)
        ]
        return tuple(t for t in alike if not self.objections(t, there))


def _name(cause: Hypothesis) -> str:
    return f"{cause.effect} at {cause.location}" + (f" of {cause.of}" if cause.of else "")


def _same_name(a: Hypothesis | None, b: Hypothesis) -> bool:
    """Whether two causes have one name, as harmonics do."""
    return a is not None and (a.effect, a.location, a.path) == (b.effect, b.location, b.path)

"""The search: stepwise selection of causes. Each round fits the suspects of the screen jointly with the device's parameters,
adds the best one, tries to replace each cause, and drops causes that are no longer needed.

A cause is added only if its score exceeds what chance gives anywhere among all hypotheses, if its effect on the readings is
material, and if the held-out records confirm it: see `model_selection`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.estimation.noise_update import update_noise, update_noise_size
from ctrlgen.diagnosis.estimation.structure import Structure
from ctrlgen.diagnosis.hypotheses.hypotheses import Hypothesis
from ctrlgen.diagnosis.selection.candidate_model import (
    CandidateModel,
    Round,
    SearchResult,
    linearised_optimum,
    restart,
    restart_with,
)
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.screen import Screen, Screened, Suspect
from ctrlgen.diagnosis.settings import MODEL_SELECTION, SEARCH


class Searcher:
    """Looks for the causes of a mismatch in one recording."""

    def __init__(self, fitter: Fitter, screen: Screen, step: Callable[[str], None]) -> None:
        self.fitter, self.screen, self.step = fitter, screen, step
        self.selection = ModelSelection(fitter, self.fit_candidate)
        self.fitted: dict[frozenset, tuple[CandidateModel, int]] = {}
        self.screens: dict[frozenset, tuple[Fit, Screened]] = {}
        self.mismatch = np.inf  # objective of the described device beyond the noise
        self.candidates_per_round = SEARCH.candidates_per_round * (
            SEARCH.cheap_factor if fitter.recording.kind == "poses" else 1
        )

    def fit_candidate(
        self,
        structure: Structure,
        cause: Hypothesis | None = None,
        steps: int = SEARCH.candidate_steps,
        nested: Fit | None = None,
    ) -> CandidateModel:
        """Fits one structure, in which that of `nested` is nested, and computes its criterion. A structure that was fitted before
        is not fitted again unless its start values are better than that fit."""
        key = frozenset(structure.causes)
        known, done = self.fitted.get(key, (None, 0))
        if known is not None and done >= steps and known.fit.objective <= self.fitter.initial_objective(structure):
            return replace(known, cause=cause)
        fit = self.fitter.fit(structure, steps=steps, nested=nested)
        if known is not None and known.fit.objective <= fit.objective:
            self.fitted[key] = (known, steps)
            return replace(known, cause=cause)
        found = self.selection.scored(fit, cause)
        self.fitted[key] = (found, steps)
        return found

    def run(self, structure: Structure) -> SearchResult:
        """Rounds until nothing more is justified, again where they have taught the noise; then the rivals of each cause."""
        described = self.fitter.fit_described(structure.device)
        rounds: list[Round] = []
        current = self._with_noise_update(self.fit_candidate(restart(described), steps=40))
        self.mismatch = current.fit.objective - self.selection.n_fit
        for _ in range(SEARCH.most_noise_updates):
            current = self._forward_rounds(current, rounds)
            before = self.fitter.noise
            if self.fitter.recording.kind == "series":
                self.fitter.noise = update_noise(self.fitter, current.fit)
            if self.fitter.noise is before:
                break
            self.fitted.clear()
            self.screens.clear()
            current = self._prune(self._converged(current))
            if np.allclose(self.fitter.noise.floor, before.floor, rtol=SEARCH.same_noise):
                break
        current = self._prune(self._converged(current))
        nominal = self.fit_candidate(structure, steps=40)
        each = range(len(current.fit.structure.causes))
        bare = tuple(self.fit_candidate(restart(current.fit).without(k)) for k in each)
        rivals = tuple(self._rivals(current, k) for k in each)
        return SearchResult(nominal, current, bare, rivals, tuple(rounds), self._screened(current))

    def _forward_rounds(self, current: CandidateModel, rounds: list[Round]) -> CandidateModel:
        """Forward rounds from `current`, with swaps in between, until nothing more is justified; appends each to `rounds`."""
        visited = {frozenset(current.fit.structure.causes): current.fit.objective}
        while True:
            self.step(f"screening, {len(current.fit.structure.causes)} causes so far")
            screened = self._screened(current)
            if len(current.fit.structure.causes) >= SEARCH.most_causes[
                self.fitter.recording.kind
            ] or self.selection.residual_within_model_form_error(current):
                return current
            candidates = self._fit_each(current.fit, self._significant(current, screened))
            if self.selection.parameters_may_mask_cause(current.fit):
                candidates = (*candidates, *self._as_stated(current))
            candidates = (*candidates, *self.fit_subsets(current, screened, candidates))
            candidates = tuple(sorted(self._converge_promising(current, candidates), key=lambda t: t.criterion))
            rounds.append(Round(screened, candidates, current))
            better = [t for t in candidates if self.selection.justified(current, t)]
            if not better:
                return current
            best, n = self._most_parsimonious(current, better, screened), len(current.fit.structure.causes)
            current = self._prune(self._swap(best, n))
            key = frozenset(current.fit.structure.causes)
            if (
                current.fit.objective > visited.get(key, np.inf) - SEARCH.rival_difference
            ):  # no better than when it was there before
                return current
            current = self._with_noise_update(self._converged(current))
            visited[key] = current.fit.objective

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
        return self.selection.most_parsimonious(sorted(ends, key=lambda t: t.criterion))

    def restart_elsewhere(
        self, candidate: CandidateModel, before: CandidateModel, screened: Screened
    ) -> CandidateModel:
        """The trial, its causes that are new begun again in the most promising of the other shapes screened, where more than
        noise is left: the shapes of one law may lie in several valleys."""
        others = {s.hypothesis: s.other_starts for s in screened.suspects}
        for k, cause in enumerate(candidate.fit.structure.causes):
            if cause in before.fit.structure.causes or candidate.fit.is_noise:
                continue
            structure, shapes = restart(candidate.fit), others.get(cause, ())
            size = cause.law.amplitude().name if shapes else ""
            begins = [*shapes, *({**shape, size: structure.starts[k][size]} for shape in shapes)]
            if begins:
                restarted = [structure.restarted(k, begin) for begin in begins]
                again = self.fitter.fit(min(restarted, key=self.fitter.initial_objective), steps=SEARCH.candidate_steps)
                if again.objective < candidate.fit.objective:
                    candidate = self._converged(self.selection.scored(again, candidate.cause))
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
            t for t in best if t.fit.objective < current.fit.objective and not self.selection.justified(current, t)
        ]
        return tuple(self._converged(t) if t in early else t for t in candidates)

    def _with_noise_update(self, candidate: CandidateModel) -> CandidateModel:
        """The same structure under the noise that it leaves, where nothing else tells the noise."""
        if self.fitter.noise.known.all():
            return candidate
        for _ in range(SEARCH.most_noise_updates):  # the numbers move as the noise that holds them shrinks
            before = self.fitter.noise.sd
            self.fitter.noise = update_noise_size(self.fitter, candidate.fit)
            self.fitted.clear()
            self.screens.clear()
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
            candidates += self._fit_if_buildable(restart_with(fit, s.hypothesis, s.start), s.hypothesis, fit)
        return tuple(sorted(candidates, key=lambda t: t.criterion))

    def _as_stated(self, current: CandidateModel) -> tuple[CandidateModel, ...]:
        """What is suspected of the device with its own numbers as stated: a fit that bends them so far sees what they hide
        no more."""
        stated = self.fitter.fit(replace(restart(current.fit), nominal_starts={}), steps=0)
        return self._fit_each(stated, self._significant(current, self.screen.run(stated)))

    def _fit_if_buildable(
        self, structure: Structure, cause: Hypothesis, nested: Fit | None = None
    ) -> list[CandidateModel]:
        """The trial; none where no device can be built with the numbers suspected."""
        try:
            return [self.fit_candidate(structure, cause, nested=nested)]
        except ValueError:
            return []

    def fit_subsets(
        self, current: CandidateModel, screened: Screened, singles: tuple[CandidateModel, ...]
    ) -> list[CandidateModel]:
        """Sets of suspects that promise more than any single one gave; each size must promise more than the smaller."""
        best = max((current.fit.objective - t.fit.objective for t in singles), default=0.0)
        excess, candidates = current.fit.objective - self.selection.n_fit, []
        for size in (2, 3, 4):
            if (
                size > 2
                and excess - best < (1 - MODEL_SELECTION.most_of_mismatch) * self.mismatch
                and self.fitter.recording.kind == "series"
            ):
                break
            tried = 0
            used: dict[Hypothesis, int] = {}
            enough = best + max(self.selection.required_z2(current, screened), 0.05 * (excess - best))
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
                candidates += self._fit_if_buildable(structure, suspects[-1].hypothesis, current.fit)
                tried += 1
            best = max(
                [
                    best,
                    *(
                        current.fit.objective - t.fit.objective
                        for t in candidates
                        if self.selection.physically_meaningful(t)
                    ),
                ]
            )
        return candidates

    def _swap(self, current: CandidateModel, before: int) -> CandidateModel:
        """Each cause against what would be suspected in its place, now that the others are there; not what came alone to
        those `before`, which has been compared already."""
        causes = len(current.fit.structure.causes)
        for k in range(before if causes == before + 1 else causes):
            for rival in self._replacements(current, k):
                plainer = len(rival.fit.structure.free_parameters) < len(current.fit.structure.free_parameters)
                ahead = current.criterion - rival.criterion if plainer else self.selection.advantage(rival, current)
                if ahead > SEARCH.rival_difference and self.selection.physically_meaningful(
                    rival, current.fit.structure.causes
                ):
                    current = rival
        return current

    def _replacements(self, current: CandidateModel, k: int) -> list[CandidateModel]:
        """What would be suspected instead of cause k, with all the rest as it is now: refitted, it may have gone astray."""
        structure = current.fit.structure
        others = restart(current.fit).without(k)
        bare = self.fitter.fit(others, steps=0)
        screened = self.screen.run(bare)
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
            candidates += self._fit_if_buildable(self.replace_cause(current.fit, k, others, s), s.hypothesis)
        near = self._close_contenders(without, current, sorted(candidates, key=lambda t: t.criterion))
        return sorted((self._converged(t) if t in near else t for t in candidates), key=lambda t: t.criterion)

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
        key = frozenset(candidate.fit.structure.causes)
        fit, screened = self.screens.get(key, (None, None))
        if screened is None or fit is not candidate.fit:
            screened = self.screen.run(candidate.fit)
            self.screens[key] = candidate.fit, screened
        return screened

    def _prune(self, current: CandidateModel) -> CandidateModel:
        for k in reversed(range(len(current.fit.structure.causes))):
            bare = self.fit_candidate(restart(current.fit).without(k))
            if not self.selection.improves_enough(bare, current) or self.selection.within_model_form_error(
                bare, current, k
            ):
                current = bare
        return current

    def _rivals(self, current: CandidateModel, k: int) -> tuple[CandidateModel, ...]:
        """What explains alike in place of cause k, or is the special case of its law that the fit does not exclude."""
        there, special = current.fit.structure.causes, current.fit.nested_case(k)
        alike = [t for t in self._replacements(current, k) if not _same_name(t.cause, there[k])]
        alike = [
            t
            for t in alike
            if t.criterion < current.criterion + SEARCH.rival_difference
            or (special and t.cause and t.cause.effect == special)
        ]
        return tuple(t for t in alike if self.selection.physically_meaningful(t, there))


def _same_name(a: Hypothesis | None, b: Hypothesis) -> bool:
    """Whether two causes have one name, as harmonics do."""
    return a is not None and (a.effect, a.location, a.path) == (b.effect, b.location, b.path)

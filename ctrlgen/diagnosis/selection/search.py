"""Steps 7 and 8: fit the suspects jointly with the device, add the one that explains most, drop what is not needed, swap.

A cause is added only if the record shows it beyond what chance does anywhere among all hypotheses, if it is material (a
tenth of the noise), and if the held-out records gain: see `weighing`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.estimation.noise_update import update_noise, update_noise_size
from ctrlgen.diagnosis.estimation.structure import Structure
from ctrlgen.diagnosis.hypotheses.hypotheses import Hypothesis
from ctrlgen.diagnosis.selection.candidate_model import Round, Search, Trial, cooled, freed, warm
from ctrlgen.diagnosis.selection.model_selection import Weighing
from ctrlgen.diagnosis.selection.screen import Screen, Screened, Suspect
from ctrlgen.diagnosis.settings import MODEL_SELECTION, SEARCH


class Searcher:
    """Looks for the causes of a mismatch in one recording."""

    def __init__(self, fitter: Fitter, screen: Screen, step: Callable[[str], None]) -> None:
        self.fitter, self.screen, self.step = fitter, screen, step
        self.weigh = Weighing(fitter, self.trial)
        self.known: dict[frozenset, tuple[Trial, int]] = {}
        self.screens: dict[frozenset, tuple[Fit, Screened]] = {}
        self.mismatch = np.inf  # objective of the described device beyond the noise
        self.trials = SEARCH.trials * (SEARCH.cheap_factor if fitter.recording.kind == "poses" else 1)

    def trial(
        self,
        structure: Structure,
        cause: Hypothesis | None = None,
        steps: int = SEARCH.trial_steps,
        nested: Fit | None = None,
    ) -> Trial:
        """Fits one structure, which contains that of `nested`, and judges it on the held-out records; not again where it was
        fitted before and begins no better than that ended."""
        key = frozenset(structure.causes)
        known, done = self.known.get(key, (None, 0))
        if known is not None and done >= steps and known.fit.objective <= self.fitter.initial_objective(structure):
            return replace(known, cause=cause)
        fit = self.fitter.fit(structure, steps=steps, nested=nested)
        if known is not None and known.fit.objective <= fit.objective:
            self.known[key] = (known, steps)
            return replace(known, cause=cause)
        found = self.weigh.judged(fit, cause)
        self.known[key] = (found, steps)
        return found

    def run(self, structure: Structure) -> Search:
        """Rounds until nothing more is justified, again where they have taught the noise; then the rivals of each cause."""
        described = self.fitter.fit_described(structure.device)
        rounds: list[Round] = []
        current = self._measured(self.trial(cooled(described), steps=40))
        self.mismatch = current.fit.objective - self.weigh.n_fit
        for _ in range(SEARCH.most_noise_updates):
            current = self._rounds(current, rounds)
            before = self.fitter.noise
            if self.fitter.recording.kind == "series":
                self.fitter.noise = update_noise(self.fitter, current.fit)
            if self.fitter.noise is before:
                break
            self.known.clear()
            self.screens.clear()
            current = self._prune(self._polished(current))
            if np.allclose(self.fitter.noise.floor, before.floor, rtol=SEARCH.same_noise):
                break
        current = self._prune(self._polished(current))
        nominal = self.trial(structure, steps=40)
        each = range(len(current.fit.structure.causes))
        bare = tuple(self.trial(cooled(current.fit).without(k)) for k in each)
        rivals = tuple(self._rivals(current, k) for k in each)
        return Search(nominal, current, bare, rivals, tuple(rounds), self._screened(current))

    def _rounds(self, current: Trial, rounds: list[Round]) -> Trial:
        """Forward rounds from `current`, with swaps in between, until nothing more is justified; appends each to `rounds`."""
        visited = {frozenset(current.fit.structure.causes): current.fit.objective}
        while True:
            self.step(f"screening, {len(current.fit.structure.causes)} causes so far")
            screened = self._screened(current)
            if len(current.fit.structure.causes) >= SEARCH.most_causes[
                self.fitter.recording.kind
            ] or self.weigh.of_form(current):
                return current
            trials = self._try(current.fit, self._conspicuous(current, screened))
            if self.weigh.hides(current.fit):
                trials = (*trials, *self._as_stated(current))
            trials = (*trials, *self._together(current, screened, trials))
            trials = tuple(sorted(self._ended(current, trials), key=lambda t: t.total))
            rounds.append(Round(screened, trials, current))
            better = [t for t in trials if self.weigh.justified(current, t)]
            if not better:
                return current
            best, n = self._best(current, better, screened), len(current.fit.structure.causes)
            current = self._prune(self._swap(best, n))
            key = frozenset(current.fit.structure.causes)
            if (
                current.fit.objective > visited.get(key, np.inf) - SEARCH.rival_difference
            ):  # no better than when it was there before
                return current
            current = self._measured(self._polished(current))
            visited[key] = current.fit.objective

    def _polished(self, trial: Trial) -> Trial:
        """The same fit driven to its end; trials stop early."""
        return self.trial(cooled(trial.fit), trial.cause, steps=40)

    def _best(self, current: Trial, better: list[Trial], screened: Screened) -> Trial:
        """The plainest, once it and what takes away nearly as much so far are fitted to their end."""
        first = self.weigh.plainest(better)
        near = self._near(current.fit.objective, first, [t for t in better if t is not first])
        ends = [self._reshaped(self._polished(t), current, screened) for t in (first, *near)]
        return self.weigh.plainest(sorted(ends, key=lambda t: t.total))

    def _reshaped(self, trial: Trial, before: Trial, screened: Screened) -> Trial:
        """The trial, its causes that are new begun again in the most promising of the other shapes screened, where more than
        noise is left: the shapes of one law may lie in several valleys."""
        others = {s.hypothesis: s.others for s in screened.suspects}
        for k, cause in enumerate(trial.fit.structure.causes):
            if cause in before.fit.structure.causes or trial.fit.is_noise:
                continue
            structure, shapes = cooled(trial.fit), others.get(cause, ())
            size = cause.law.amplitude().name if shapes else ""
            begins = [*shapes, *({**shape, size: structure.starts[k][size]} for shape in shapes)]
            if begins:
                restarted = [structure.restarted(k, begin) for begin in begins]
                again = self.fitter.fit(min(restarted, key=self.fitter.initial_objective), steps=SEARCH.trial_steps)
                if again.objective < trial.fit.objective:
                    trial = self._polished(self.weigh.judged(again, trial.cause))
        return trial

    def _near(self, without: float, best: Trial, others: list[Trial]) -> list[Trial]:
        """The first of those that take away nearly as much of an objective as the best one."""
        least = SEARCH.nearly_best * (without - best.fit.objective)
        return [t for t in others if without - t.fit.objective >= least][: SEARCH.finished_trials]

    def _ended(self, current: Trial, trials: tuple[Trial, ...]) -> tuple[Trial, ...]:
        """The trials, those driven to their end that leave least on the records to fit but are not justified so early."""
        best = sorted(trials, key=lambda t: t.fit.objective)[: SEARCH.finished_trials]
        early = [t for t in best if t.fit.objective < current.fit.objective and not self.weigh.justified(current, t)]
        return tuple(self._polished(t) if t in early else t for t in trials)

    def _measured(self, trial: Trial) -> Trial:
        """The same structure under the noise that it leaves, where nothing else tells the noise."""
        if self.fitter.noise.known.all():
            return trial
        for _ in range(SEARCH.most_noise_updates):  # the numbers move as the noise that holds them shrinks
            before = self.fitter.noise.sd
            self.fitter.noise = update_noise_size(self.fitter, trial.fit)
            self.known.clear()
            self.screens.clear()
            trial = self.trial(cooled(trial.fit), trial.cause, steps=40)
            if np.allclose(before, self.fitter.noise.sd, rtol=0.02):
                break
        return trial

    def _conspicuous(self, current: Trial, screened: Screened) -> list[Suspect]:
        return self._loud(screened, self.weigh.need(current, screened))

    def _loud(self, screened: Screened, need: float) -> list[Suspect]:
        loud = [s for s in screened.suspects if s.z**2 > need]
        chosen: list[Suspect] = []
        for s in loud:
            same = sum(c.hypothesis.effect == s.hypothesis.effect for c in chosen)
            if (
                s.z**2 >= SEARCH.smallest_score * loud[0].z ** 2
                and same < self.trials // 3
                and len(chosen) < self.trials
            ):
                chosen.append(s)
        return chosen

    def _try(self, fit: Fit, suspects: list[Suspect]) -> tuple[Trial, ...]:
        """Each suspect beside what is fitted."""
        trials = []
        for s in suspects:
            self.step(f"trying {s.hypothesis.effect} at {s.hypothesis.location}")
            trials += self._attempt(warm(fit, s.hypothesis, s.start), s.hypothesis, fit)
        return tuple(sorted(trials, key=lambda t: t.total))

    def _as_stated(self, current: Trial) -> tuple[Trial, ...]:
        """What is suspected of the device with its own numbers as stated: a fit that bends them so far sees what they hide
        no more."""
        stated = self.fitter.fit(replace(cooled(current.fit), nominal_starts={}), steps=0)
        return self._try(stated, self._conspicuous(current, self.screen.run(stated)))

    def _attempt(self, structure: Structure, cause: Hypothesis, nested: Fit | None = None) -> list[Trial]:
        """The trial; none where no device can be built with the numbers suspected."""
        try:
            return [self.trial(structure, cause, nested=nested)]
        except ValueError:
            return []

    def _together(self, current: Trial, screened: Screened, singles: tuple[Trial, ...]) -> list[Trial]:
        """Sets of suspects that promise more than any single one gave; each size must promise more than the smaller."""
        best = max((current.fit.objective - t.fit.objective for t in singles), default=0.0)
        excess, trials = current.fit.objective - self.weigh.n_fit, []
        for size in (2, 3, 4):
            if (
                size > 2
                and excess - best < (1 - MODEL_SELECTION.most_of_mismatch) * self.mismatch
                and self.fitter.recording.kind == "series"
            ):
                break
            tried = 0
            used: dict[Hypothesis, int] = {}
            enough = best + max(self.weigh.need(current, screened), 0.05 * (excess - best))
            for promised, suspects in screened.together:
                if len(suspects) != size or promised < enough or tried >= self.trials:
                    continue
                if max(used.get(s.hypothesis, 0) for s in suspects) >= max(2, self.trials // 2):
                    continue
                structure = cooled(current.fit)
                if len({(h.family, h.location) if h.family else h for h in (s.hypothesis for s in suspects)}) < size:
                    continue
                for s in suspects:
                    used[s.hypothesis] = used.get(s.hypothesis, 0) + 1
                    structure = structure.with_cause(s.hypothesis, s.start)
                self.step("trying " + ", ".join(f"{s.hypothesis.effect} at {s.hypothesis.location}" for s in suspects))
                trials += self._attempt(structure, suspects[-1].hypothesis, current.fit)
                tried += 1
            best = max([best, *(current.fit.objective - t.fit.objective for t in trials if self.weigh.meant(t))])
        return trials

    def _swap(self, current: Trial, before: int) -> Trial:
        """Each cause against what would be suspected in its place, now that the others are there; not what came alone to
        those `before`, which has been compared already."""
        causes = len(current.fit.structure.causes)
        for k in range(before if causes == before + 1 else causes):
            for rival in self._replacements(current, k):
                plainer = len(rival.fit.structure.free_parameters) < len(current.fit.structure.free_parameters)
                ahead = current.total - rival.total if plainer else self.weigh.ahead(rival, current)
                if ahead > SEARCH.rival_difference and self.weigh.meant(rival, current.fit.structure.causes):
                    current = rival
        return current

    def _replacements(self, current: Trial, k: int) -> list[Trial]:
        """What would be suspected instead of cause k, with all the rest as it is now: refitted, it may have gone astray."""
        structure = current.fit.structure
        others = cooled(current.fit).without(k)
        bare = self.fitter.fit(others, steps=0)
        screened = self.screen.run(bare)
        without = freed(bare)
        gained = without - current.fit.objective
        able = [
            s
            for s in self._loud(screened, self.weigh.need(current, screened))
            if s.z**2 > SEARCH.rival_share * gained and s.hypothesis != structure.causes[k]
        ]
        trials = []
        for s in able[: SEARCH.most_rivals]:
            self.step(f"trying {s.hypothesis.effect} at {s.hypothesis.location} instead")
            trials += self._attempt(self._in_place(current.fit, k, others, s), s.hypothesis)
        near = self._near(without, current, sorted(trials, key=lambda t: t.total))
        return sorted((self._polished(t) if t in near else t for t in trials), key=lambda t: t.total)

    def _in_place(self, fit: Fit, k: int, others: Structure, suspect: Suspect) -> Structure:
        """The suspect beside the `others` in place of cause k of a fit; of its family, begun with that one's numbers where
        that is better: what they have in common means the same."""
        structure = others.with_cause(suspect.hypothesis, suspect.start)
        cause = fit.structure.causes[k]
        if cause.family is None or (cause.family, cause.at) != (suspect.hypothesis.family, suspect.hypothesis.at):
            return structure
        common = {name: value for name, value in fit.values(k).items() if name in suspect.start}
        kin = (others.with_cause(suspect.hypothesis, s | common) for s in (suspect.start, *suspect.others))
        return min((structure, *kin), key=self.fitter.initial_objective)

    def _screened(self, trial: Trial) -> Screened:
        key = frozenset(trial.fit.structure.causes)
        fit, screened = self.screens.get(key, (None, None))
        if screened is None or fit is not trial.fit:
            screened = self.screen.run(trial.fit)
            self.screens[key] = trial.fit, screened
        return screened

    def _prune(self, current: Trial) -> Trial:
        for k in reversed(range(len(current.fit.structure.causes))):
            bare = self.trial(cooled(current.fit).without(k))
            if not self.weigh.worth(bare, current) or self.weigh.doubtful(bare, current, k):
                current = bare
        return current

    def _rivals(self, current: Trial, k: int) -> tuple[Trial, ...]:
        """What explains alike in place of cause k, or is the special case of its law that the fit does not exclude."""
        there, special = current.fit.structure.causes, current.fit.nested_case(k)
        alike = [t for t in self._replacements(current, k) if not _same(t.cause, there[k])]
        alike = [
            t
            for t in alike
            if t.total < current.total + SEARCH.rival_difference or (special and t.cause and t.cause.effect == special)
        ]
        return tuple(t for t in alike if self.weigh.meant(t, there))


def _same(a: Hypothesis | None, b: Hypothesis) -> bool:
    """Whether two causes have one name, as harmonics do."""
    return a is not None and (a.effect, a.location, a.path) == (b.effect, b.location, b.path)

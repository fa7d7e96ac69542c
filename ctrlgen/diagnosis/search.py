"""Steps 7 and 8: fit the suspects jointly with the device, add the one that explains most, drop what is not needed, swap.

Structures are compared by T = objective on the records to fit + BIC's price of their numbers + -2 ln of how likely they make
the held-out records, where nothing was fitted, + twice the rarity of their causes: among equals the plainer one is named.
A cause is added only if the record shows it beyond what chance does anywhere among all hypotheses, if it is material (a
tenth of the noise), and if the held-out records gain.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ctrlgen.diagnosis.adequacy import RATIO
from ctrlgen.diagnosis.fit import CI, Fit, Fitter
from ctrlgen.diagnosis.hypotheses import PARAMETER, Hypothesis
from ctrlgen.diagnosis.learnt import learn_more, learn_size
from ctrlgen.diagnosis.resolved import resolved
from ctrlgen.diagnosis.screen import Screen, Screened, Suspect
from ctrlgen.diagnosis.structure import Structure
from ctrlgen.diagnosis.trial import CONFIRMED, Round, Search, Trial, cooled, freed, warm

MATERIAL = 0.1  # of the noise, root mean square on the records to fit: smaller causes are not named
DEAR = 16.0  # squared deviations of the device's numbers, beyond what their count explains, that make them suspicious
MOST_CAUSES = {"poses": 24, "series": 8}
WORTHWHILE = (
    0.05  # of the held-out excess over the noise: what a further cause must take away; patches of a wrong law do not
)
LEARNINGS = 8  # of the noise from what is left, at most
SAME_NOISE = 0.05  # of itself: a noise that changes by less shows nothing new
TRIALS = 6  # suspects fitted a round, and as many sets of each size; three times as many where fits are cheap (poses)
TRIAL_STEPS = 8
ENDED = 2  # trials a round that are fitted to the end although they look useless: corners and moments need many steps
RIVAL = 9.0  # difference of T below which two structures explain alike (three standard deviations)
SLACK = 0.01  # of what a structure leaves beyond the noise: smaller differences do not choose among causes
FORM = 0.25  # the same for the held-out records, where either explains all of the records to fit
MET = 4.0  # standard deviations of the noise's own squares
VAGUE = 5.0  # times as much may be the form of another law where a cause may as well be nothing
ABLE = 0.5  # of what a cause takes away: what its rival must promise; shapes between the grid's points lose that much
REPLACEMENTS = 6  # rivals fitted for a cause
NEARLY = 0.9  # of what the best cause takes away: what takes so much is fitted to its end before both are compared
MOSTLY = 0.9  # of the mismatch: where causes take it away, a series' others are sought one or two at a time
CLOSE = 0.25  # of the largest z^2: suspects below are not tried, unless nothing else is


class Searcher:
    """Looks for the causes of a mismatch in one recording."""

    def __init__(self, fitter: Fitter, screen: Screen, step: Callable[[str], None]) -> None:
        self.fitter, self.screen, self.step = fitter, screen, step
        self.n_fit = sum(int(fitter.noise.usable(r.valid).sum()) for r in fitter.to_fit)
        self.n_held = sum(int(fitter.noise.usable(r.valid).sum()) for r in fitter.held)
        self.known: dict[frozenset, tuple[Trial, int]] = {}
        self.screens: dict[frozenset, tuple[Fit, Screened]] = {}
        self.mismatch = np.inf  # objective of the described device beyond the noise
        self.trials = TRIALS * (3 if fitter.recording.kind == "poses" else 1)

    def trial(
        self,
        structure: Structure,
        cause: Hypothesis | None = None,
        steps: int = TRIAL_STEPS,
        nested: Fit | None = None,
    ) -> Trial:
        """Fits one structure, which contains that of `nested`, and judges it on the held-out records; not again where it was
        fitted before and begins no better than that ended."""
        key = frozenset(structure.causes)
        known, done = self.known.get(key, (None, 0))
        if known is not None and done >= steps and known.fit.objective <= self.fitter.begun(structure):
            return replace(known, cause=cause)
        fit = self.fitter.fit(structure, steps=steps, nested=nested)
        if known is not None and known.fit.objective <= fit.objective:
            self.known[key] = (known, steps)
            return replace(known, cause=cause)
        held = self.fitter.held_out(fit)
        price = sum(u.cause is not None for u in structure.unknowns) * np.log(max(self.n_fit, 2))
        price += 2 * _rarity(structure)
        found = Trial(fit, held, fit.objective + price + held, cause)
        self.known[key] = (found, steps)
        return found

    def run(self, structure: Structure) -> Search:
        """Rounds until nothing more is justified, again where they have taught the noise; then the rivals of each cause."""
        described = self.fitter.described(structure.device)
        current, rounds = self._measured(self.trial(cooled(described), steps=40)), []
        self.mismatch = current.fit.objective - self.n_fit
        for _ in range(LEARNINGS):
            current = self._rounds(current, rounds)
            before = self.fitter.noise
            if self.fitter.recording.kind == "series":
                self.fitter.noise = learn_more(self.fitter, current.fit)
            if self.fitter.noise is before:
                break
            self.known.clear()
            self.screens.clear()
            current = self._prune(self._polished(current))
            if np.allclose(self.fitter.noise.floor, before.floor, rtol=SAME_NOISE):
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
            if len(current.fit.structure.causes) >= MOST_CAUSES[self.fitter.recording.kind] or self._of_form(current):
                return current
            trials = self._try(current, self._conspicuous(current, screened))
            trials = (*trials, *self._together(current, screened, trials))
            trials = tuple(sorted(self._ended(current, trials), key=lambda t: t.total))
            rounds.append(Round(screened, trials, current))
            better = [t for t in trials if self._justified(current, t)]
            if not better:
                return current
            best, n = self._best(current, better), len(current.fit.structure.causes)
            current = self._prune(self._swap(best, n))
            key = frozenset(current.fit.structure.causes)
            if current.fit.objective > visited.get(key, np.inf) - RIVAL:  # no better than when it was there before
                return current
            current = self._measured(self._polished(current))
            visited[key] = current.fit.objective

    def _polished(self, trial: Trial) -> Trial:
        """The same fit driven to its end; trials stop early."""
        return self.trial(cooled(trial.fit), trial.cause, steps=40)

    def _ahead(self, a: Trial, b: Trial) -> float:
        """By how much `a` is better than `b`, and that is beyond what says nothing; negative where it is not.

        Where both leave more than noise, squares count in units of what the better one leaves a sample, on the records to
        fit and on those held out (quasi-likelihood): what neither explains does not choose between them.
        """
        best = min(a, b, key=lambda t: t.total)
        c_fit = max(best.fit.objective / max(self.n_fit, 1), 1.0)
        c_held = max(best.held / max(self.n_held, 1), 1.0)
        gained = (b.fit.objective - a.fit.objective) / c_fit + (b.held - a.held) / c_held + b.price - a.price
        worst = max(a.fit.objective, b.fit.objective)
        most = self.n_fit + MET * np.sqrt(2 * self.n_fit)
        met = worst < most and self.fitter.noise.known.all()  # alike on the records to fit, and neither law is right
        slack = FORM if met else SLACK
        return gained - SLACK * self.n_fit * (1 - 1 / c_fit) - slack * self.n_held * (1 - 1 / c_held)

    def _best(self, current: Trial, better: list[Trial]) -> Trial:
        """The plainest, once it and what takes away nearly as much so far are fitted to their end."""
        first = self._plainest(better)
        near = self._near(current.fit.objective, first, [t for t in better if t is not first])
        return self._plainest(sorted(map(self._polished, [first, *near]), key=lambda t: t.total))

    def _near(self, without: float, best: Trial, others: list[Trial]) -> list[Trial]:
        """The first of those that take away nearly as much of an objective as the best one."""
        least = NEARLY * (without - best.fit.objective)
        return [t for t in others if without - t.fit.objective >= least][:ENDED]

    def _plainest(self, better: list[Trial]) -> Trial:
        """The best trial, or one of as few numbers that is no worse beyond the slack and is less rare."""
        first = better[0]
        for t in better:
            first = t if self._ahead(t, first) > 0 else first
        numbers = len(first.fit.structure.unknowns)
        alike = [t for t in better if self._ahead(first, t) <= 0 and len(t.fit.structure.unknowns) <= numbers]
        return min(alike, key=lambda t: (_rarity(t.fit.structure), t.total), default=first)

    def _ended(self, current: Trial, trials: tuple[Trial, ...]) -> tuple[Trial, ...]:
        """The trials, those driven to their end that leave least on the records to fit but are not justified so early."""
        best = sorted(trials, key=lambda t: t.fit.objective)[:ENDED]
        early = [t for t in best if t.fit.objective < current.fit.objective and not self._justified(current, t)]
        return tuple(self._polished(t) if t in early else t for t in trials)

    def _measured(self, trial: Trial) -> Trial:
        """The same structure under the noise that it leaves, where nothing else tells the noise."""
        if self.fitter.noise.known.all():
            return trial
        for _ in range(LEARNINGS):  # the numbers move as the noise that holds them shrinks
            before = self.fitter.noise.sd
            self.fitter.noise = learn_size(self.fitter, trial.fit)
            self.known.clear()
            self.screens.clear()
            trial = self.trial(cooled(trial.fit), trial.cause, steps=40)
            if np.allclose(before, self.fitter.noise.sd, rtol=0.02):
                break
        return trial

    def _need(self, current: Trial, screened: Screened) -> float:
        """The z^2 that a cause must show: of its own size in the readings, or of the price at which the device hides it."""
        hidden = current.fit.penalty > DEAR + 2 * len(current.fit.structure.unknowns)
        return screened.threshold**2 if hidden else max(screened.threshold**2, MATERIAL**2 * self.n_fit)

    def _conspicuous(self, current: Trial, screened: Screened) -> list[Suspect]:
        return self._loud(screened, self._need(current, screened))

    def _loud(self, screened: Screened, need: float) -> list[Suspect]:
        loud = [s for s in screened.suspects if s.z**2 > need]
        chosen: list[Suspect] = []
        for s in loud:
            same = sum(c.hypothesis.effect == s.hypothesis.effect for c in chosen)
            if s.z**2 >= CLOSE * loud[0].z ** 2 and same < self.trials // 3 and len(chosen) < self.trials:
                chosen.append(s)
        return chosen

    def _try(self, current: Trial, suspects: list[Suspect]) -> tuple[Trial, ...]:
        trials = []
        for s in suspects:
            self.step(f"trying {s.hypothesis.effect} at {s.hypothesis.location}")
            trials += self._attempt(warm(current.fit, s.hypothesis, s.start), s.hypothesis, current.fit)
        return tuple(sorted(trials, key=lambda t: t.total))

    def _attempt(self, structure: Structure, cause: Hypothesis, nested: Fit | None = None) -> list[Trial]:
        """The trial; none where no device can be built with the numbers suspected."""
        try:
            return [self.trial(structure, cause, nested=nested)]
        except ValueError:
            return []

    def _together(self, current: Trial, screened: Screened, singles: tuple[Trial, ...]) -> list[Trial]:
        """Sets of suspects that promise more than any single one gave; each size must promise more than the smaller."""
        best = max((current.fit.objective - t.fit.objective for t in singles), default=0.0)
        excess, trials = current.fit.objective - self.n_fit, []
        for size in (2, 3, 4):
            if size > 2 and excess - best < (1 - MOSTLY) * self.mismatch and self.fitter.recording.kind == "series":
                break
            tried, used = 0, {}
            enough = best + max(self._need(current, screened), 0.05 * (excess - best))
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
            best = max([best, *(current.fit.objective - t.fit.objective for t in trials if self._meant(t))])
        return trials

    def _meant(self, trial: Trial, accepted: tuple[Hypothesis, ...] = ()) -> bool:
        """Whether every cause but those `accepted` has an amplitude inside its bounds, and a usual one, and is no double."""
        structure = trial.fit.structure
        if not resolved(self.fitter.recording, trial.fit, accepted):
            return False
        for unknown, value in zip(structure.unknowns, trial.fit.theta, strict=True):
            if not unknown.amplitude or structure.causes[unknown.cause] in accepted:
                continue
            usual = structure.usual(unknown)
            if usual and not usual[0] <= value <= usual[1]:
                return False
            span = 1e-6 * (unknown.high - unknown.low)
            if value >= unknown.high - span or (value <= unknown.low + span and unknown.low != unknown.nominal):
                return False
        return True

    def _justified(self, before: Trial, after: Trial) -> bool:
        return self._worth(before, after) and self._meant(after, before.fit.structure.causes)

    def _worth(self, before: Trial, after: Trial) -> bool:
        """Whether `after` explains enough more than `before` for its numbers, fitted and held out.

        What the held-out records confirm counts as much as what was fitted, up to the same amount: chance alone gives
        z^2 of 10 in both no more often than one of 17 in the first and of 2 in the other.
        """
        gained, confirmed = before.fit.objective - after.fit.objective, before.held - after.held
        added = len(after.fit.structure.unknowns) - len(before.fit.structure.unknowns)
        needed = 12.0 + added * np.log(max(self.n_fit, 2))
        if before.fit.penalty - after.fit.penalty > 0.5 * gained:  # the device hid it at a price: it shows nowhere else
            return gained > needed and confirmed > -4.0
        if self._out_of_reach(before) and gained > MOSTLY * (before.fit.objective - self.n_fit) and confirmed > -4.0:
            return gained > needed
        if gained + min(confirmed, gained) <= needed + CONFIRMED or gained <= MATERIAL**2 * self.n_fit:
            return False
        return confirmed > max(CONFIRMED, WORTHWHILE * max(before.held - self.n_held, 0.0))

    def _out_of_reach(self, trial: Trial) -> bool:
        """Whether the records to fit show, by the gate of adequacy, what the held-out ones do not."""
        most = RATIO**2 - 1
        return trial.fit.objective - self.n_fit > most * self.n_fit and trial.held - self.n_held < most * self.n_held

    def _swap(self, current: Trial, before: int) -> Trial:
        """Each cause against what would be suspected in its place, now that the others are there; not what came alone to
        those `before`, which has been compared already."""
        causes = len(current.fit.structure.causes)
        for k in range(before if causes == before + 1 else causes):
            for rival in self._replacements(current, k):
                plainer = len(rival.fit.structure.unknowns) < len(current.fit.structure.unknowns)
                ahead = current.total - rival.total if plainer else self._ahead(rival, current)
                if ahead > RIVAL and self._meant(rival, current.fit.structure.causes):
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
            for s in self._loud(screened, self._need(current, screened))
            if s.z**2 > ABLE * gained and s.hypothesis != structure.causes[k]
        ]
        trials = []
        for s in able[:REPLACEMENTS]:
            self.step(f"trying {s.hypothesis.effect} at {s.hypothesis.location} instead")
            trials += self._attempt(others.with_cause(s.hypothesis, s.start), s.hypothesis)
        near = self._near(without, current, sorted(trials, key=lambda t: t.total))
        return sorted((self._polished(t) if t in near else t for t in trials), key=lambda t: t.total)

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
            if not self._worth(bare, current) or self._doubtful(bare, current, k):
                current = bare
        return current

    def _doubtful(self, bare: Trial, current: Trial, k: int) -> bool:
        """Whether cause k takes away no more than the form of another's law may leave of what that one takes away, of the
        records to fit and of those held out (geometric mean); more, where k may be nothing (the 95 % interval of its
        amplitude reaches off)."""
        fit = current.fit
        own = [i for i, u in enumerate(fit.structure.unknowns) if u.cause == k and u.amplitude]
        sd = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
        vague = bool(own) and all(abs(fit.theta[i] - fit.structure.unknowns[i].nominal) < CI * sd[i] for i in own)
        lost = max(bare.held - current.held, 0.0) * max(bare.fit.objective - current.fit.objective, 0.0)
        return self._may_be_form(lost, bare, VAGUE if vague else 1.0)  # beside k another may take a cause's place

    def _of_form(self, current: Trial) -> bool:
        """Whether all that is left is no more than the form of a cause's law may leave: what would be found in it, would be
        doubtful. Not where the device hides something at a price, or where only what is left tells the noise."""
        hidden = current.fit.penalty > DEAR + 2 * len(current.fit.structure.unknowns)
        if hidden or not self.fitter.noise.known.all():
            return False
        left = max(current.held - self.n_held, 0.0) * max(current.fit.objective - self.n_fit, 0.0)
        return self._may_be_form(left, current)

    def _may_be_form(self, squares: float, current: Trial, times: float = 1.0) -> bool:
        """Whether the product of these squares, fitted and held out, is within what the form of a law is off, so many
        `times`, of what its cause takes away."""
        most = self.trial(
            Structure(current.fit.structure.device), steps=40
        )  # without one alone a fit may leave the numbers
        for j, cause in enumerate(current.fit.structure.causes):
            rough = 0.0 if cause.effect == PARAMETER else cause.law.rough
            if rough:
                without = self.trial(cooled(current.fit).without(j))
                held = min(without.held, most.held) - current.held
                fitted = min(without.fit.objective, most.fit.objective) - current.fit.objective
                if squares < (rough * times) ** 4 * max(held, 0.0) * max(fitted, 0.0):
                    return True
        return False

    def _rivals(self, current: Trial, k: int) -> tuple[Trial, ...]:
        there = current.fit.structure.causes
        found = self._replacements(current, k)
        return tuple(
            t
            for t in found
            if t.total < current.total + RIVAL and self._meant(t, there) and not _same(t.cause, there[k])
        )


def _same(a: Hypothesis | None, b: Hypothesis) -> bool:
    """Whether two causes have one name, as harmonics do."""
    return a is not None and (a.effect, a.location, a.path) == (b.effect, b.location, b.path)


def _rarity(structure: Structure) -> float:
    return sum(c.law.rarity for c in structure.causes if c.effect != PARAMETER)

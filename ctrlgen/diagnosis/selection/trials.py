"""The trials of a search: structures fitted under what is known of the errors so far, and what came of each.

A structure is fitted once under the same errors. No trial can end the search: one that cannot be built or simulated is noted.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ctrlgen.core.forks import in_forks
from ctrlgen.diagnosis.selection.candidate_model import Attempt, CandidateModel, Refusal
from ctrlgen.diagnosis.selection.failures import FAILURES, UNSOLVED, Failure, reason_of
from ctrlgen.diagnosis.selection.model_selection import ModelSelection, scored
from ctrlgen.diagnosis.selection.motion_regions import no_region
from ctrlgen.diagnosis.selection.objections import objections
from ctrlgen.diagnosis.selection.screen import Screen, Screened
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.integration_error import MOST_IN_SEARCH, with_steps_that_suffice
from ctrlgen.estimation.noise_update import update_noise_size
from ctrlgen.estimation.settings import DISCREPANCY, FIT
from ctrlgen.estimation.structure import Structure

Item = TypeVar("Item")
Result = TypeVar("Result")
_Optima = dict[str, list[float]]
_Learnt = tuple[dict[frozenset[Any], tuple[CandidateModel, int]], list[Refusal], list[Failure], list[Attempt], _Optima]


class Trials:
    """Fits structures for a search, and keeps what was fitted, screened, `refused` and `failed`, and every attempt in the `log`.

    It replaces its own fitter as it learns the errors. `mismatch` is that of `ModelSelection`. `step` is called with a sentence
    before each trial. Trials that do not depend on one another are made in `jobs` processes.
    """

    def __init__(self, fitter: Fitter, screen: Screen, step: Callable[[str], None], jobs: int = 1) -> None:
        self.fitter, self.screen, self.step, self.jobs = fitter, screen, step, jobs
        self.fitted: dict[frozenset[Any], tuple[CandidateModel, int]] = {}
        self.screens: dict[frozenset[Any], tuple[Fit, Screened]] = {}
        self.latest: tuple[Fitter, Fit, Screened] | None = None
        self.bare: dict[int, tuple[Fit, Fit, Screened]] = {}
        self.mismatch: np.ndarray | None = None
        self.markings = 0  # of spikes, each against another model
        # of a cause and another that came nowhere near in its place: the sets of causes that were beside them
        self.beaten: dict[tuple[Hypothesis, Hypothesis], tuple[frozenset[Hypothesis], ...]] = {}
        self.refused: list[Refusal] = []
        self.failed: list[Failure] = []
        self.log: list[Attempt] = []
        self.round = 1
        self.per_round = SEARCH.candidates_per_round * (SEARCH.cheap_factor if fitter.recording.kind == "poses" else 1)

    @property
    def selection(self) -> ModelSelection:
        """The comparison of candidates under the present noise."""
        return ModelSelection(self.fitter, self.tried, self.mismatch)

    def use(self, fitter: Fitter) -> None:
        """Goes on with another fitter: fits and screens under other errors are forgotten."""
        self.fitter = fitter
        self.screen.fitter = fitter
        self.fitted.clear()
        self.screens.clear()
        self.bare.clear()

    def without_kin(self, cause: Hypothesis) -> Trials:
        """A copy of these trials, which learns for itself, that suspects neither `cause` nor another form of its physics at its place."""

        def is_kin(h: Hypothesis) -> bool:
            form = h.form_of is not None and (h.form_of, h.at) == (cause.form_of, cause.at)
            return form or (h.effect, h.location, h.path) == (cause.effect, cause.location, cause.path)

        branch = self.apart()
        branch.screen = self.screen.without(is_kin)
        branch.screens, branch.bare, branch.latest = {}, {}, None
        return branch

    def apart(self) -> Trials:
        """A copy of these trials, which learns for itself, errors and marked readings included."""
        branch = copy.copy(self)
        branch.screen = self.screen.without(lambda _: False)
        branch.fitted, branch.screens, branch.bare = dict(self.fitted), dict(self.screens), dict(self.bare)
        branch.beaten = dict(self.beaten)
        branch.refused, branch.failed, branch.log = [], [], []
        return branch

    def suspecting_again(self, screen: Screen) -> None:
        """Goes on with a `screen` of other hypotheses."""
        screen.fitter, self.screen, self.latest = self.fitter, screen, None
        self.screens.clear()
        self.bare.clear()

    def each(
        self,
        function: Callable[[Trials, Item], Result],
        items: Sequence[Item],
        sentence: Callable[[Item], str] | None = None,
    ) -> list[Result]:
        """function(trials, item) of every item, in as many processes as there may be.

        Each item begins with what these trials and their checkpoint know now, and what it learnt is kept here in the order of the
        items: neither the result nor which fits are made depends on the number of processes. `sentence` of an item is told as
        it begins.
        """
        checkpoint = self.fitter.checkpoint
        if checkpoint is not None:
            checkpoint.begin()  # before there are forks, which append to the file

        def work(item: Item) -> tuple[Result, _Learnt]:
            branch = copy.copy(self)
            branch.jobs, branch.step = 1, (lambda _: None)
            branch.fitted, branch.screens, branch.beaten = dict(self.fitted), dict(self.screens), dict(self.beaten)
            branch.refused, branch.failed, branch.log = [], [], []
            optima: _Optima = {}
            with nullcontext(optima) if checkpoint is None else checkpoint.branch() as optima:
                result = function(branch, item)
            new = {key: value for key, value in branch.fitted.items() if self.fitted.get(key) is not value}
            return result, (new, branch.refused, branch.failed, branch.log, optima)

        devices = {c.fit.structure.device for c, _ in self.fitted.values()}
        shared = (self.fitter.recording, self.fitter.noise, self.fitter.errors, *devices)
        begun = (lambda item: self.step(sentence(item))) if sentence else (lambda item: None)
        results = []
        for result, (new, refused, failed, log, optima) in in_forks(work, items, self.jobs, begun, shared):
            self.fitted.update(new)
            self.refused += refused
            self.failed += failed
            self.log += log
            if checkpoint is not None:
                checkpoint.learn(optima)
            results.append(result)
        return results

    def new_round(self, number: int = 1) -> None:
        """Forgets what was refused and what failed; what is fitted from now on belongs to the round of this number."""
        self.refused, self.failed, self.round = [], [], number

    def scored(self, structure: Structure, fit: Fit, cause: Hypothesis | None = None) -> CandidateModel:
        """The candidate model of a fit begun at `structure`, kept in the log."""
        candidate = scored(self.fitter, fit, cause)
        if structure.causes:
            self.log.append(Attempt.of(self.round, structure.starts, candidate))
        return candidate

    def fit(
        self,
        structure: Structure,
        cause: Hypothesis | None = None,
        steps: int = SEARCH.candidate_steps,
        nested: Fit | None = None,
        enough: float = np.inf,
    ) -> CandidateModel:
        """Fits and scores one structure, in which that of `nested` is nested. A structure that was fitted before is not
        fitted again unless its start values are better than that fit. The fit ends before where it cannot reach an objective that is
        `enough`."""
        key = frozenset(structure.causes)
        known, done = self.fitted.get(key, (None, 0))
        if known is not None and done >= steps and known.fit.objective <= self.fitter.initial_objective(structure):
            return replace(known, cause=cause)
        fit = self.fitter.fit(structure, steps=steps, nested=nested, enough=enough)
        if known is not None and known.fit.objective <= fit.objective:
            self.fitted[key] = (known, steps)
            return replace(known, cause=cause)
        if not any(np.isfinite(self.fitter.predict(fit, r)).any() for r in self.fitter.fit_records):
            raise ArithmeticError("no reading that it predicts is finite")
        candidate = self.scored(structure, fit, cause)
        # what ended early is no end of a fit that need not reach as much
        self.fitted[key] = (candidate, steps if fit.objective <= enough else 0)
        return candidate

    def tried(
        self,
        structure: Structure,
        cause: Hypothesis | None,
        nested: Fit | None = None,
        steps: int = SEARCH.candidate_steps,
        enough: float = np.inf,
    ) -> list[CandidateModel]:
        """The trial; none, with a note, where no such device can be built or simulated. What it adds to `nested` is begun again
        with half the amplitude where that may be why. Other arguments as of `fit`."""
        known = nested.structure.causes if nested else structure.causes
        for _ in range(SEARCH.halvings + 1):
            try:
                return [self.fit(structure, cause, steps, nested, enough)]
            except FAILURES as error:
                failure = error
            if set(structure.causes) <= set(known):
                break
            structure = structure.halved(known)
        self.note_failure(cause, failure)
        return []

    def keep(self, candidate: CandidateModel, steps: int) -> None:
        """Keeps a fit of so many `steps` as that of its causes, where another one of them leaves less and is refused: it is gone on from,
        and the refused one is not handed out in its place."""
        self.fitted[frozenset(candidate.causes)] = (candidate, steps)

    def note_failure(self, cause: Hypothesis | None, error: Exception) -> None:
        """Keeps why a trial of a cause could not be made."""
        self.failed.append(Failure(cause, reason_of(error)))

    def converged(self, candidate: CandidateModel, enough: float = np.inf) -> CandidateModel:
        """The same candidate fitted until it converges, or cannot reach an objective that is `enough`, or as it was where that fails:
        candidates are first fitted for a few steps only."""
        structure = candidate.fit.restarted.expanded_again()
        if structure.expanded_at != candidate.fit.structure.expanded_at:
            # what its steps missed bent its numbers, and made it look better than it is
            self.fitted.pop(frozenset(structure.causes), None)
        fitted = self.tried(structure, candidate.cause, steps=FIT.max_steps, enough=enough)
        return fitted[0] if fitted else candidate

    def begun_better(self, candidate: CandidateModel, starts: Sequence[Structure]) -> CandidateModel:
        """The same candidate begun again at each of the `starts`, where the end is better; as far as these can be fitted."""
        best = candidate.fit
        try:
            for s in starts:
                best = self.fitter.better_of(best, s, SEARCH.candidate_steps)
            if best is not candidate.fit:
                return self.converged(self.scored(best.structure, best, candidate.cause))
        except FAILURES as error:
            self.note_failure(candidate.cause, error)
        return candidate

    def screened(self, candidate: CandidateModel) -> Screened:
        """The screen of what a candidate leaves."""
        key = frozenset(candidate.causes)
        fit, screened = self.screens.get(key, (None, None))
        if screened is None or fit is not candidate.fit:
            screened = self._screened_before(candidate.fit)
            if screened is None:
                screened = self.screen.run(candidate.fit)
                self.latest = self.fitter, candidate.fit, screened
                self.failed += [Failure(h, why) for h, why in screened.dropped.items()]
            self.screens[key] = candidate.fit, screened
        return screened

    def _screened_before(self, fit: Fit) -> Screened | None:
        """The latest screen, if it was of the same causes on the same samples, and errors and numbers have moved since by less than shows
        in a score; else None."""
        if self.latest is None:
            return None
        fitter, before, screened = self.latest
        now, then = self.fitter.error.weighted, fitter.error.weighted
        if fitter.recording is not self.fitter.recording or before.structure.causes != fit.structure.causes:
            return None
        if before.structure.finer != fit.structure.finer or len(before.theta) != len(fit.theta):
            return None
        close = np.allclose(now.sd, then.sd, rtol=SEARCH.same_screen, atol=0) and all(
            map(np.array_equal, now.ar, then.ar)
        )
        moved = np.abs(fit.theta - before.theta) <= SEARCH.same_numbers * np.sqrt(fit.covariance.diagonal())
        return screened if close and bool(np.all(moved)) else None

    def screened_without(self, fit: Fit, k: int) -> tuple[Fit, Screened]:
        """The fit without cause k, its other numbers as they are, and the screen of what that leaves: each hypothesis alone, where the
        latest screen tells what chance reaches."""
        if any(known is not fit for known, *_ in self.bare.values()):
            self.bare.clear()  # a screen of 1,400 columns holds 16 MB
        if k not in self.bare:
            bare = self.fitter.fit(fit.restarted.without(k), steps=0)
            known = None if self.latest is None else self.latest[2].threshold
            self.bare[k] = (fit, bare, self.screen.run(bare, threshold=known))
        return self.bare[k][1:]

    def objections(self, candidate: CandidateModel, accepted: Sequence[Hypothesis] = ()) -> dict[int, str]:
        """What speaks against the causes of a candidate that are not yet `accepted`; and against those that are, that the records do not
        show a pitch to repeat any more."""
        noise = self.fitter.noise
        exact = candidate.errors.is_noise and bool(noise.known.all() and not noise.guessed.any())
        against = objections(self.fitter.recording, candidate.fit, accepted, exact)
        for k in (k for k, c in enumerate(candidate.causes) if c not in accepted and k not in against):
            if reason := no_region(self.screen.motion, candidate.fit, k):
                against[k] = reason
        return against

    def with_errors(self, candidate: CandidateModel) -> CandidateModel:
        """The same structure under the discrepancy that it leaves itself, estimated and fitted in turn."""
        for _ in range(DISCREPANCY.updates):
            fitter = replace(self.fitter, errors=candidate.errors)
            if np.allclose(fitter.error.weighted.sd, self.fitter.error.weighted.sd, rtol=DISCREPANCY.same, atol=0):
                break
            before = self.fitter
            self.use(fitter)
            fitted = self.tried(candidate.fit.restarted, candidate.cause, steps=FIT.max_steps)
            if not fitted:
                self.use(before)
                break
            candidate = fitted[0]
        return candidate

    def leaves_noise_alone(self, candidate: CandidateModel) -> bool:
        """Whether the structure of a candidate, fitted in steps that suffice under the discrepancy that it leaves itself as in
        `with_errors`, leaves noise alone. Nothing is kept of these fits."""
        errors = candidate.errors
        if errors.is_noise:
            return True
        try:
            structure = with_steps_that_suffice(self.fitter, candidate.fit, MOST_IN_SEARCH)
            for _ in range(DISCREPANCY.updates):
                if errors.is_noise:
                    break
                fitter = replace(self.fitter, errors=errors)
                fit = fitter.fit(structure, steps=FIT.max_steps)
                before, errors, structure = errors, fitter.with_errors_of(fit).error, fit.restarted
                if np.allclose(errors.weighted.sd, before.weighted.sd, rtol=DISCREPANCY.same, atol=0):
                    break
        except UNSOLVED:
            return False
        return errors.is_noise

    def with_noise_update(self, candidate: CandidateModel) -> CandidateModel:
        """The same structure under the noise that it leaves, where nothing else tells the noise."""
        if self.fitter.noise.known.all():
            return candidate
        # the numbers move as the noise that holds them shrinks
        for _ in range(SEARCH.most_noise_updates):
            before = self.fitter.noise.sd
            self.use(self.fitter.with_noise(update_noise_size(self.fitter, candidate.fit)))
            candidate = self.converged(candidate)
            if np.allclose(before, self.fitter.noise.sd, rtol=SEARCH.same_noise_size, atol=0):
                break
        return candidate

    def close_contenders(
        self, without: float, best: CandidateModel, others: Sequence[CandidateModel]
    ) -> list[CandidateModel]:
        """The first of those that take away nearly as much of the objective `without` as the best one."""
        least = SEARCH.nearly_best * (without - best.fit.objective)
        return [t for t in others if without - t.fit.objective >= least][: SEARCH.converged_candidates]

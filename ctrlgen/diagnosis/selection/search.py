"""The search: stepwise selection of causes. Each round fits the suspects of the screen jointly with the device's parameters,
adds the best one, tries to replace each cause, and drops causes that are no longer needed.

Fits are weighed by noise and by the discrepancy that the present best model leaves, which each round estimates again. A
cause is added where the criterion of `model_selection` and the held-out records want it and nothing speaks against its
meaning (`objections`); a cause that meets an objection is taken out of its candidate (`pruning`), and what is refused
although it scores better is kept with its reason.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.attribution import Attribution, attribute
from ctrlgen.diagnosis.selection.begun_again import begun_again
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, Round
from ctrlgen.diagnosis.selection.candidates import fit_candidates, restart_elsewhere, takes_away_much
from ctrlgen.diagnosis.selection.confusable import explains_alike
from ctrlgen.diagnosis.selection.ends_of_readings import limits_where_readings_pile_up
from ctrlgen.diagnosis.selection.failures import FAILURES
from ctrlgen.diagnosis.selection.finer_forms import finer_forms
from ctrlgen.diagnosis.selection.model_selection import scored
from ctrlgen.diagnosis.selection.not_taken import not_taken
from ctrlgen.diagnosis.selection.other_data import learn_mismatch, marked_again, read_again
from ctrlgen.diagnosis.selection.other_laws import stands_for_another, takes_over
from ctrlgen.diagnosis.selection.positive_waves import with_positive_waves
from ctrlgen.diagnosis.selection.precedence import acting_first, everywhere_first, one_loop_first
from ctrlgen.diagnosis.selection.pruning import all_pruned, no_worse, without_needless
from ctrlgen.diagnosis.selection.rivals import acting_instead, replacements, rivals, simplified, swapped
from ctrlgen.diagnosis.selection.screen import Screen, Screened
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.selection.supported import supported
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.estimation.described_device import described
from ctrlgen.estimation.drive_clock import with_drive_clock
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.integration_error import MOST_FINER, MOST_IN_SEARCH, with_steps_that_suffice
from ctrlgen.estimation.noise_update import update_noise
from ctrlgen.estimation.settings import FIT


class Searcher:
    """Looks for the causes of a mismatch in one recording."""

    def __init__(self, fitter: Fitter, screen: Screen, step: Callable[[str], None], jobs: int = 1) -> None:
        self.trials = Trials(fitter, screen, step, jobs)

    def run(self, device: Device) -> SearchResult:
        """Rounds until nothing more is justified, again where they have taught the noise; then the rivals of each cause."""
        trials = self.trials
        fitter, nominal_fit = described(trials.fitter, device)
        trials.use(fitter)
        rounds: list[Round] = []
        current = trials.with_noise_update(trials.fit(nominal_fit.restarted, steps=FIT.max_steps))
        learn_mismatch(trials, current)
        for _ in range(SEARCH.most_noise_updates):
            current = self.forward_rounds(current, rounds)
            before = trials.fitter.noise.floor
            current = self._under_its_noise(current)
            if np.allclose(trials.fitter.noise.floor, before, rtol=SEARCH.same_noise, atol=0):
                break
        current = self.beside_limits(current, rounds)
        trials = self.trials
        # in the steps and on the clock in which it is told: its rivals, which the report lists, are fitted once
        current = self._under_its_noise(self._finely_timed(self.settled(current)))
        better = self._compared(current)
        current = self._in_plainest_form(current if better is current else self._finely_timed(better))
        found = self.without_other_laws(current, rounds)
        trials = self.trials
        if found is not current:
            current = self._in_plainest_form(self._finely_timed(found))
        current = with_positive_waves(self.without_unseen_pitches(current))
        # its numbers are not bent by the errors of a better model
        nominal = scored(trials.fitter, trials.fitter.described(device)[1])
        current, account = supported(trials, nominal, current, trials.screen.seed)
        found = current
        current = no_worse(trials, nominal, current) if current.causes else nominal
        if current is not found:
            account = attribute(trials.fitter, nominal, current, trials.screen.seed, trials.jobs)
        withdrawn = tuple(c for c in found.causes if c not in current.causes)
        return self._result(nominal, current, account, rounds, withdrawn)

    def with_rival(self, result: SearchResult, rival: CandidateModel) -> SearchResult:
        """The result with a model that explains alike in place of the chosen one, which is its rival now; as given where it does not, or
        would not stay as it is beside the device as described (`no_worse`)."""
        trials = self.trials
        rival = with_positive_waves(trials.converged(rival))
        if not explains_alike(trials.selection, rival, result.chosen):
            return result
        if no_worse(trials, result.nominal, rival) is not rival:
            return result
        account = attribute(trials.fitter, result.nominal, rival, trials.screen.seed, trials.jobs)
        return self._result(result.nominal, rival, account, result.rounds, result.withdrawn)

    def _result(
        self,
        nominal: CandidateModel,
        current: CandidateModel,
        account: Attribution,
        rounds: Sequence[Round],
        withdrawn: tuple[Hypothesis, ...],
    ) -> SearchResult:
        """The chosen model `current` with its account, and with the rivals of each of its causes that has a name in the answer."""
        trials, each = self.trials, range(len(current.causes))
        bare = tuple(trials.each(lambda branch, k: _without(branch, current, k, nominal), each))
        screened = trials.screened(current)
        named = [k for k in each if account.is_named(k)]
        told = dict(zip(named, trials.each(lambda branch, k: rivals(branch, current, k, rounds), named), strict=True))
        found_alike = [told.get(k, ((), ())) for k in each]
        alike, unlikely = (tuple(rows[i] for rows in found_alike) for i in (0, 1))
        log = (tuple(trials.log), tuple(trials.screen.hypotheses))
        return SearchResult(
            trials.fitter, nominal, current, account, bare, alike, tuple(rounds), screened, withdrawn, *log, unlikely
        )

    def _under_its_noise(self, current: CandidateModel) -> CandidateModel:
        """The model settled under the noise that it teaches, which steps too long and a clock that was off would have been part of."""
        trials = self.trials
        noise = update_noise(trials.fitter, current.fit)
        if noise is trials.fitter.noise:
            return current
        trials.use(trials.fitter.with_noise(noise))
        return self.settled(current)

    def settled(self, current: CandidateModel) -> CandidateModel:
        """The same model fitted to its end under its own errors, without the causes that it then does not need."""
        return without_needless(self.trials, self._converged(current))

    def _converged(self, current: CandidateModel) -> CandidateModel:
        """The same model fitted to its end under its own errors, where shapes may be that the records to fit hardly tell too."""
        return self.trials.with_errors(begun_again(self.trials, self.trials.converged(current)))

    def best_settled(self, current: CandidateModel) -> CandidateModel:
        """The model `settled`, and what then explains better in the place of one of its causes: none of them is an alternative of it."""
        return self._compared(self.settled(current))

    def _compared(self, current: CandidateModel) -> CandidateModel:
        """The settled model, or what explains better in the place of one of its causes, settled too. In the round that added the cause, a
        rival had not been fitted to its end, nor weighed by these errors."""
        better = swapped(self.trials, current, len(current.causes))
        return current if better is current else self.settled(better)

    def _in_plainest_form(self, current: CandidateModel) -> CandidateModel:
        """The model with the plainest laws, and those that act with the motion, that explain alike."""
        return acting_instead(self.trials, simplified(self.trials, current))

    def without_other_laws(self, current: CandidateModel, rounds: list[Round]) -> CandidateModel:
        """The model without the causes that were accepted for what their names say, and by now stand for something else
        (`other_laws`), where another that is sound explains alike, or nearly; `SEARCH.most_searches_without` of them at most."""
        doubtful = [c for k, c in enumerate(current.causes) if self._is_doubtful(current, k)]
        for cause in doubtful[: SEARCH.most_searches_without]:
            if cause in current.causes and self._is_doubtful(current, k := current.causes.index(cause)):
                current = self._without_other_law(current, k, rounds)
        return current

    def _is_doubtful(self, current: CandidateModel, k: int) -> bool:
        """Whether cause k stands for something else by now, or is a pitch that the records do not show to repeat any more."""
        return stands_for_another(current.fit, k) or k in self.trials.objections(current, current.causes)

    def _without_other_law(self, current: CandidateModel, k: int, rounds: list[Round]) -> CandidateModel:
        """The model with what is sound and explains alike, or nearly, in the place of cause k; as it is where nothing does. A rival
        that does so alone comes first, then what a search finds that does not suspect the cause: a hysteresis of which all lags is a
        play, and what it gave beside that, such as a gain, is a cause of its own, which no rival alone can have."""
        whole, other, again = self.trials, copy.copy(self), list(rounds)
        alone = [t for t in replacements(whole, current, k) if takes_over(whole, t, current, k)]
        other.trials = whole.without_kin(current.causes[k])
        begun = alone or other._bare(current, k)
        found = other.searched_on(begun[0], current, again) if begun else None
        if found is None or not takes_over(other.trials, found, current, k):
            whole.log += [replace(a, round=len(rounds)) for a in other.trials.log]
            return current
        other.trials.log[:0] = whole.log
        other.trials.suspecting_again(whole.screen)
        self.trials, rounds[:] = other.trials, again
        return found

    def without_unseen_pitches(self, current: CandidateModel) -> CandidateModel:
        """The model without the pitches that its last fits made so long that the records do not show that they repeat: what was objected
        to while causes came and went holds at the end too."""
        while against := self.trials.objections(current, current.causes):
            bare = self._bare(current, max(against))
            if not bare:
                return current
            current = self.settled(bare[0])
        return current

    def _bare(self, current: CandidateModel, k: int) -> list[CandidateModel]:
        """The model without cause k; none where such a device cannot be simulated."""
        self.trials.step(f"searching without {current.causes[k].effect} at {current.causes[k].location}")
        return self.trials.tried(current.fit.restarted.without(k), None, steps=FIT.max_steps)

    def searched_on(self, begun: CandidateModel, current: CandidateModel, rounds: list[Round]) -> CandidateModel:
        """What a search finds that begins with a model, where that one is worse than `current`, with one cause more than this at most: what
        a law stands for is two others, beside what the device's numbers take over, as they do a gain."""
        found = self.settled(begun)
        if self.trials.selection.advantage(current, found) <= 0:
            return found
        return self.best_settled(self.forward_rounds(found, rounds, len(current.causes) + 1))

    def _finely_stepped(self, current: CandidateModel, most: int = MOST_FINER) -> CandidateModel:
        """The same model fitted and judged with as many steps of its integrator as it needs, `most` times its own at most, where those of
        the search do not suffice: what they miss of an impact bends the numbers of a stop that is touched, which then foretell no run into
        it."""
        trials = self.trials
        try:
            structure = with_steps_that_suffice(trials.fitter, current.fit, most)
        except FAILURES as error:
            trials.note_failure(current.cause, error)
            return current
        if structure.finer == current.fit.structure.finer:
            return current
        trials.step("refit in shorter steps")
        trials.use(trials.fitter)  # what was fitted in longer ones is no fit of it
        fitted = trials.tried(structure, current.cause, steps=FIT.max_steps)
        return self.settled(fitted[0]) if fitted else current

    def _finely_timed(self, current: CandidateModel) -> CandidateModel:
        """The same model in steps that suffice, and with the drive where its records tell that it was."""
        return self.clocked(self._finely_stepped(current))

    def clocked(self, current: CandidateModel) -> CandidateModel:
        """The same model with the drive as far off its time stamps as both kinds of records tell: that bends the numbers of what is
        touched, and is no cause."""
        trials = self.trials
        try:
            fitter, fit = with_drive_clock(trials.fitter, current.fit)
        except FAILURES as error:
            trials.note_failure(current.cause, error)
            return current
        if fitter is trials.fitter:
            return current
        trials.step("refit with the drive off its time stamps")
        trials.use(fitter)
        # a shape that was bent by the clock, and stays so from where it stands, would be refuted by noise alone
        return self.settled(simplified(trials, scored(fitter, fit, current.cause)))

    def forward_rounds(self, current: CandidateModel, rounds: list[Round], most: float = np.inf) -> CandidateModel:
        """Forward rounds from `current`, with swaps in between, until nothing more is justified, or there are the `most` causes;
        appends each to `rounds`."""
        trials, visited = self.trials, [current]
        most = min(SEARCH.most_causes[trials.fitter.recording.kind], most)
        while True:
            trials.step(f"screening, {number_of(len(current.causes), 'cause')} so far")
            trials.new_round(len(rounds) + 1)
            current = read_again(trials, marked_again(trials, current))
            if len(current.causes) >= most or trials.selection.residual_within_model_form_error(current):
                return self._in_finer_form(current)
            screened = trials.screened(current)
            plainly = trials.selection.only_much_matters(current)
            tried = fit_candidates(trials, current, screened, int(most) - len(current.causes), plainly)
            candidates = all_pruned(trials, current, tried, None if plainly else screened)
            candidates = trials.selection.ranked(candidates)
            better = [t for t in candidates if trials.selection.improves_enough(current, t)]
            best = self._most_parsimonious(current, better, screened) if better else current
            best = everywhere_first(trials, current, best, candidates, screened)
            best = acting_first(trials, current, one_loop_first(trials, current, best, candidates), candidates)
            rounds.append(self._round(screened, candidates, current, best))
            if not better:
                return self._beside_what_was_refused(current, candidates, rounds, most)
            kept = sum(c in current.causes for c in best.causes)
            # where one cause more leaves noise alone, all are compared at the end (`best_settled`)
            at_end = best.errors.is_noise and len(best.causes) == kept + 1
            current = without_needless(trials, best if at_end else swapped(trials, best, kept))
            before = (v for v in visited if frozenset(v.causes) == frozenset(current.causes))
            if any(explains_alike(trials.selection, v, current) for v in before):
                # no better than when it was there before
                return current
            # what too long steps miss would be read as a further cause
            current = self._finely_stepped(trials.with_noise_update(self._converged(current)), MOST_IN_SEARCH)
            visited.append(current)

    def _beside_what_was_refused(
        self, current: CandidateModel, candidates: Sequence[CandidateModel], rounds: list[Round], most: float
    ) -> CandidateModel:
        """What a search finds that goes on from a candidate that takes much away of the records to fit and that the held-out ones refuse,
        where nothing is accepted: two causes may foretell them together alone, such as a late reading and what its scale does. A search
        that finds nothing leaves errors and marked readings as they were."""
        whole = self.trials
        if current.causes or current.errors.is_noise:
            return current
        refused = [t for t in candidates if takes_away_much(t, current) and not whole.objections(t)]
        for begun in refused[: SEARCH.most_searches_beside]:
            other, again = copy.copy(self), [*rounds[:-1], replace(rounds[-1], gone_on_beside=begun.causes)]
            other.trials = whole.apart()
            found = other.forward_rounds(other.trials.with_errors(other.trials.converged(begun)), again, most)
            if other.trials.selection.improves_enough(current, found):
                other.trials.log[:0] = whole.log
                self.trials, rounds[:] = other.trials, again
                return found
            whole.log += other.trials.log
        return current

    def beside_limits(self, current: CandidateModel, rounds: list[Round]) -> CandidateModel:
        """What a search finds that begins with a limit of a sensor whose readings pile up at one value, where more than noise is left
        without (`ends_of_readings`)."""
        whole = self.trials
        if current.errors.is_noise:
            return current
        bare = whole.fitter.described(current.fit.structure.device)[1].restarted
        offered = [h for h in whole.screen.hypotheses if h not in current.causes]
        for limit, start in limits_where_readings_pile_up(whole.fitter, current.fit, offered):
            other, again = copy.copy(self), list(rounds)
            other.trials = whole.apart()
            begun = other.trials.tried(bare.with_cause(limit, start), limit, steps=FIT.max_steps)
            if not begun:
                continue
            found = other.settled(other.forward_rounds(other.settled(begun[0]), again))
            if limit in found.causes and other.trials.selection.improves_enough(current, found):
                other.trials.log[:0] = whole.log
                self.trials, rounds[:] = other.trials, again
                return found
            whole.log += other.trials.log
        return current

    def _in_finer_form(self, current: CandidateModel) -> CandidateModel:
        """The model with a law in a finer form where that leaves enough less: no further cause could be trusted beside an error of the
        form, but a better form of the law takes it away."""
        trials = self.trials
        for t in trials.selection.ranked(finer_forms(trials, current)):
            if trials.selection.improves_enough(current, t) and not trials.objections(t, current.causes):
                return trials.with_noise_update(trials.with_errors(trials.converged(t)))
        return current

    def _most_parsimonious(
        self, current: CandidateModel, better: Sequence[CandidateModel], screened: Screened
    ) -> CandidateModel:
        """The plainest, once it and what takes away nearly as much so far are fitted to their end."""
        trials = self.trials
        first = trials.selection.most_parsimonious(better)
        near = trials.close_contenders(current.fit.objective, first, [t for t in better if t is not first])
        ends = trials.each(
            lambda branch, t: restart_elsewhere(branch, branch.converged(t), current, screened), (first, *near)
        )
        sound = [t for t in ends if not trials.objections(t, current.causes)]
        return trials.selection.most_parsimonious(sound or [first])

    def _round(
        self, screened: Screened, candidates: Sequence[CandidateModel], before: CandidateModel, best: CandidateModel
    ) -> Round:
        """The record of a round, with what was not taken and why."""
        compare = self.trials.selection
        errors = compare.reference((before, *candidates, best))
        return Round(
            screened,
            candidates=tuple(candidates),
            criteria=tuple(compare.criterion(t, errors) for t in candidates),
            before=before,
            criterion_before=compare.criterion(before, errors),
            refused=not_taken(compare, self.trials.refused, candidates, before, best),
            failed=tuple(dict.fromkeys(self.trials.failed)),
        )


def _without(trials: Trials, current: CandidateModel, k: int, nominal: CandidateModel) -> CandidateModel:
    """The model without cause k; the device as described where that cannot be simulated."""
    fitted = trials.tried(current.fit.restarted.without(k), None, None)
    return fitted[0] if fitted else nominal

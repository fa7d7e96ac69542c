"""Model selection: compares candidate models by what they leave on the records to fit and on the held-out records.

    T = sum over channels and both kinds of records of (m/tau) l(q) + penalty + k ln(n/tau) - 2 ln(prior odds)
    l(q) = q up to 1,  1 + ln q beyond

q is the mean square of the residual over that of the noise, m the samples of a channel, tau the correlation time of the
discrepancy, k the parameters of the causes. It is -2 ln of the normal likelihood at the best variance that is not below the
noise: where a model leaves noise alone, differences of T are those of chi-square; where every model leaves more, what counts is
by which factor one leaves less than the other, on as many independent samples as the residual has. Two models are compared
under the errors of the better one. Held-out records are predicted with the parameters as fitted, unless the model leaves noise
alone: there the parameters are refitted under their posterior (`estimation.held_out`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum

import numpy as np

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.settings import MODEL_SELECTION
from ctrlgen.estimation.error_model import ErrorModel, error_model
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.held_out import refit_to_held_out
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis
from ctrlgen.estimation.misfit import Misfit, misfit
from ctrlgen.estimation.settings import FIT, HELD_OUT_REFIT, RESIDUAL_TESTS, STATISTICS
from ctrlgen.estimation.size_odds import prior_odds
from ctrlgen.estimation.structure import Structure


class Shortfall(StrEnum):
    """What a model lacks to be taken in place of one with fewer causes."""

    GAIN = "it improves less than its numbers cost"
    IMMATERIAL = "what it changes is less than a tenth of the noise"
    UNCONFIRMED = "the held-out records do not confirm it"
    SMALL = "it takes away less than a hundredth of the mismatch"
    ONE_BLOCK = "it gains in one stretch of the held-out records only"


def scored(fitter: Fitter, fit: Fit, cause: Hypothesis | None = None) -> CandidateModel:
    """The candidate model of a fit, with what it leaves on the records to fit and on the held-out records."""
    records = fitter.fit_records
    left = [np.nan_to_num(r.observed - fitter.predict(fit, r), nan=1e150) for r in records]
    errors = error_model(fitter.noise, records, left)
    unseen = fitter.held_out_records
    unmoved = misfit(fitter.noise, unseen, [r.observed - fitter.predict(fit, r) for r in unseen])
    held_out, penalty = unmoved, 0.0
    if errors.is_noise and fitter.noise.known.all():
        refit = refit_to_held_out(fitter, fit, HELD_OUT_REFIT.max_steps)
        held_out = misfit(fitter.noise, unseen, [r.observed - fitter.predict(refit.fit, r) for r in unseen])
        penalty = refit.penalty + refit.log_det
    return CandidateModel(fit, errors, misfit(fitter.noise, records, left), held_out, penalty, cause, unmoved)


class ModelSelection:
    """The tests by which candidate models are compared; `candidate` fits a structure for them, where it can be.

    `mismatch` (n_y,) [SI^2] is the mean square that the device as described leaves on the held-out records, where it is known.
    """

    def __init__(
        self, fitter: Fitter, candidate: Callable[..., list[CandidateModel]], mismatch: np.ndarray | None = None
    ) -> None:
        self.fitter, self.fit_candidate, self.mismatch = fitter, candidate, mismatch

    def _loss(self, left: Misfit, errors: ErrorModel) -> float:
        """Sum over the channels of (m/tau) l(q), under `errors`."""
        noisy = errors.rms == 0
        q = np.where(noisy, left.white_mean, left.plain_mean)
        n = np.where(noisy, left.n_white.sum(axis=0), left.n_plain.sum(axis=0) / errors.tau)
        beyond = (q > 1) | ~errors.noise.known
        return float(np.sum(n * np.where(beyond, 1 + np.log(np.maximum(q, 1e-30)), q)))

    def fit_loss(self, t: CandidateModel, errors: ErrorModel) -> float:
        """What a model leaves on the records to fit, with the penalty of stated parameters."""
        return self._loss(t.fitted, errors) + t.fit.penalty

    def held_out_loss(self, t: CandidateModel, errors: ErrorModel) -> float:
        """What a model leaves on the held-out records."""
        return self._loss(t.held_out, errors) + t.refit_penalty

    def samples(self, left: Misfit, errors: ErrorModel) -> float:
        """Independent samples of all channels under `errors`."""
        noisy = errors.rms == 0
        return float(np.sum(np.where(noisy, left.n_white.sum(axis=0), left.n_plain.sum(axis=0) / errors.tau)))

    def criterion(self, t: CandidateModel, errors: ErrorModel) -> float:
        """T of a model under `errors`; smaller is better."""
        numbers = sum(u.cause is not None for u in t.fit.structure.free_parameters)
        price = numbers * np.log(max(self.samples(t.fitted, errors), 2)) - 2 * prior_odds(t.fit)
        own = self._price_of_each_record(t, errors) * each if (each := numbers_in_each_record(t.causes)) else 0.0
        return self.fit_loss(t, errors) + self.held_out_loss(t, errors) + price + own

    def _price_of_each_record(self, t: CandidateModel, errors: ErrorModel) -> float:
        """What a number costs that is another one in each record, whether to fit or held out."""
        n = self.samples(t.fitted, errors) + self.samples(t.held_out, errors)
        return len(self.fitter.fit_records + self.fitter.held_out_records) * float(np.log(max(n, 2)))

    def reference(self, candidates: Sequence[CandidateModel]) -> ErrorModel:
        """The errors under which candidates are compared: those of the one that leaves least."""

        def left(t: CandidateModel) -> float:
            q = [np.log(np.maximum(m.plain_mean, 1e-30)) @ m.n_plain.sum(axis=0) for m in (t.fitted, t.held_out)]
            return float(sum(q))

        return min(candidates, key=left).errors

    def ranked(self, candidates: Sequence[CandidateModel]) -> list[CandidateModel]:
        """The candidates by their criterion under common errors, the best first."""
        if not candidates:
            return []
        errors = self.reference(candidates)
        return sorted(candidates, key=lambda t: self.criterion(t, errors))

    def advantage(self, a: CandidateModel, b: CandidateModel) -> float:
        """By how much the criterion of `a` is better than that of `b`; negative where it is worse."""
        errors = self.reference((a, b))
        return self.criterion(b, errors) - self.criterion(a, errors)

    def most_parsimonious(self, better: Sequence[CandidateModel]) -> CandidateModel:
        """The best candidate or, of those that explain alike with no more parameters, the one with the largest prior odds."""
        first, *others = self.ranked(better)
        numbers = len(first.fit.structure.free_parameters)
        alike = [
            t
            for t in others
            if self.advantage(first, t) <= MODEL_SELECTION.tie and len(t.fit.structure.free_parameters) <= numbers
        ]
        return max((first, *alike), key=lambda t: prior_odds(t.fit))

    @staticmethod
    def parameters_may_mask_cause(fit: Fit) -> bool:
        """Whether the device's parameters deviate so far from their stated values that they may mask a cause."""
        return fit.penalty > MODEL_SELECTION.hidden_penalty + 2 * len(fit.structure.free_parameters)

    def required_z2(self, current: CandidateModel, screened: Screened) -> float:
        """The z^2 that a hypothesis needs to be fitted.

        Where noise alone is left, or almost: the screen's threshold and, unless parameters of the device may mask it, a
        material effect. Where more is left, the best are fitted whatever their score: it is taken against a residual that
        still holds the cause.
        """
        if not current.errors.is_noise:
            return 0.0
        if self.parameters_may_mask_cause(current.fit):
            return screened.threshold**2
        n = self.samples(current.fitted, current.errors)
        return max(screened.threshold**2, MODEL_SELECTION.material_share**2 * n)

    def improves_enough(self, before: CandidateModel, after: CandidateModel) -> bool:
        """Whether `after` leaves enough less than `before`, for its additional parameters, on both kinds of records."""
        return self.shortfall(before, after) is None

    def shortfall(self, before: CandidateModel, after: CandidateModel) -> Shortfall | None:
        """What `after` lacks to be taken in place of `before`; None where it leaves enough less, for its additional parameters, on
        both kinds of records.

        The held-out gain counts as much as the gain on the records to fit, up to the same amount: chance gives z^2 = 10 on
        both no more often than 17 on the first and 2 on the second. Less is required of the held-out records where the
        device's parameters masked the cause, and where the held-out records cannot show it. Where more than noise is left, the
        gain must not be that of one block.
        """
        errors = self.reference((before, after))
        gain = self.fit_loss(before, errors) - self.fit_loss(after, errors)
        confirmed = self.held_out_loss(before, errors) - self.held_out_loss(after, errors)
        n, n_held = (self.samples(m, errors) for m in (after.fitted, after.held_out))
        added = len(after.fit.structure.free_parameters) - len(before.fit.structure.free_parameters)
        needed = MODEL_SELECTION.least_gain + added * np.log(max(n, 2))
        new = [c for c in after.causes if c not in before.causes]
        if new and all(c.prior.of_each_record for c in new):
            # no number is held to another record: all of them tell, and each has its price
            if gain + confirmed <= needed + numbers_in_each_record(new) * self._price_of_each_record(after, errors):
                return Shortfall.GAIN
            return None if errors.is_noise or self.matters(before, after) else Shortfall.SMALL
        # parameters of the device masked it, so the readings hardly show it
        masked = before.fit.penalty - after.fit.penalty > MODEL_SELECTION.hidden_share * gain
        unseen = (
            self.unseen_in_held_out(before)
            and before.fitted.excess - after.fitted.excess > MODEL_SELECTION.most_of_mismatch * before.fitted.excess
            and confirmed > -MODEL_SELECTION.largest_contradiction
        )
        if masked or unseen:
            if gain <= needed:
                return Shortfall.GAIN
            return None if confirmed > -MODEL_SELECTION.largest_contradiction else Shortfall.UNCONFIRMED
        if gain + min(confirmed, gain) <= needed + MODEL_SELECTION.least_confirmed:
            return Shortfall.UNCONFIRMED if gain > needed else Shortfall.GAIN
        if gain <= MODEL_SELECTION.material_share**2 * n:
            return Shortfall.IMMATERIAL
        q = np.maximum(before.held_out.plain_mean, 1.0)
        share = MODEL_SELECTION.worthwhile_share if errors.is_noise else MODEL_SELECTION.above_discrepancy
        worthwhile = share * n_held * float(np.max(1 - 1 / q, initial=0.0))
        if confirmed <= max(MODEL_SELECTION.least_confirmed, worthwhile):
            return Shortfall.UNCONFIRMED
        if errors.is_noise:
            return None
        if not self.matters(before, after):
            return Shortfall.SMALL
        return None if wins_by_block(before.held_out, after.held_out) else Shortfall.ONE_BLOCK

    def matters(self, before: CandidateModel, after: CandidateModel) -> bool:
        """Whether `after` takes away a share of the whole mismatch of any channel on the held-out records that is worth a name, or
        much of what `before` leaves there. A law in a finer form is no further name, and any of it counts that is no chance."""
        if self.mismatch is None or in_finer_form(before.causes, after.causes):
            return True
        gain = (before.held_out.plain_mean - after.held_out.plain_mean) * self.fitter.noise.floor**2
        return bool(np.any(gain > MODEL_SELECTION.least_share * self.mismatch)) or self.takes_much(before, after)

    def only_much_matters(self, current: CandidateModel) -> bool:
        """Whether more than noise is left, and on the held-out records in every channel less of the whole mismatch than is worth a name:
        a further cause, other than a finer form of a law, must take much of it (`matters`). Never beside a law of several terms, of
        which one more must take less, and has many valleys."""
        if self.mismatch is None or current.errors.is_noise or any(c.prior.repeatable for c in current.causes):
            return False
        if self.parameters_may_mask_cause(current.fit) or self.unseen_in_held_out(current):
            return False
        left = current.held_out.plain_mean * self.fitter.noise.floor**2
        return bool(np.all(left <= MODEL_SELECTION.least_share * self.mismatch))

    def worth_its_form(self, plain: CandidateModel, finer: CandidateModel) -> bool:
        """Whether what a law has more than the plainer law that it generalises takes away a share of the whole mismatch of any channel on
        the held-out records that is worth a name, or a share of what the plainer one leaves there that one more term must take; always
        where it leaves noise alone."""
        if self.mismatch is None or self.reference((plain, finer)).is_noise:
            return True
        left, was = finer.held_out.plain_mean, plain.held_out.plain_mean
        much = (was - left) * self.fitter.noise.floor**2 > MODEL_SELECTION.least_share * self.mismatch
        of_the_rest = left < (1 - MODEL_SELECTION.least_further_share) * was
        return bool(np.any(much | of_the_rest))

    def takes_much(self, before: CandidateModel, after: CandidateModel) -> bool:
        """Whether `after` takes away much of what `before` leaves in any channel on the held-out records, however little that is
        of the whole mismatch; less is asked of one more term of a law that is there already, as a harmonic is."""
        laws = {(c.effect, c.location) for c in before.causes if c.prior.repeatable}
        added = [c for c in after.causes if c not in before.causes]
        further = bool(laws) and all((c.effect, c.location) in laws for c in added)
        most = 1 - (MODEL_SELECTION.least_further_share if further else MODEL_SELECTION.much)
        left, was = after.held_out.plain_mean, before.held_out.plain_mean
        shown = was > RESIDUAL_TESTS.error_ratio**2
        return bool(np.any(shown & (left < most * was)) and self.contradicted(after, before))

    def contradicted(self, before: CandidateModel, after: CandidateModel) -> bool:
        """Whether `after` predicts the held-out records worse than `before`, beyond chance."""
        errors = self.reference((before, after))
        lost = self.held_out_loss(after, errors) - self.held_out_loss(before, errors)
        return lost > MODEL_SELECTION.largest_contradiction

    def unseen_in_held_out(self, candidate: CandidateModel) -> bool:
        """Whether the residual exceeds the noise on the records to fit, but not on the held-out records."""
        most = RESIDUAL_TESTS.error_ratio**2
        return bool(np.any(candidate.fitted.white_mean > most) and np.all(candidate.held_out.white_mean < most))

    def within_model_form_error(self, bare: CandidateModel, current: CandidateModel, k: int) -> bool:
        """Whether cause k explains no more than the model-form error of another accepted cause (geometric mean of the squares
        on the records to fit and on the held-out records); a multiple of that where the 95 % interval of k's amplitude
        includes zero. `bare` is the model without k."""
        fit = current.fit
        amplitudes = [i for i, u in enumerate(fit.structure.free_parameters) if u.cause == k and u.amplitude]
        sd = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
        vague = bool(amplitudes) and all(
            abs(fit.theta[i] - fit.structure.free_parameters[i].nominal) < STATISTICS.z_95 * sd[i] for i in amplitudes
        )
        # beside k, another cause may take the place of an accepted one
        return self._explained_by_model_form_error(
            _lost(bare, current), bare, MODEL_SELECTION.vague_factor if vague else 1.0
        )

    def residual_within_model_form_error(self, current: CandidateModel) -> bool:
        """Whether the residual is no larger than the model-form error of a cause, so that further causes could not be trusted.
        False where parameters of the device may mask a cause, and where the noise is known from the residual alone."""
        if self.parameters_may_mask_cause(current.fit) or not self.fitter.noise.known.all():
            return False
        return self._explained_by_model_form_error(current.fitted.excess * current.held_out.excess, current)

    def _explained_by_model_form_error(self, squares: float, current: CandidateModel, times: float = 1.0) -> bool:
        """Whether `squares`, the product of those on the records to fit and on the held-out records, is at most the same product
        for the model-form error of a cause, multiplied by `times`."""
        if not any(cause.prior.model_form_error for cause in current.causes):
            return False
        (most,) = self.fit_candidate(Structure(current.fit.structure.device), None, steps=FIT.max_steps)
        for j, cause in enumerate(current.causes):
            if form_error := cause.prior.model_form_error:
                tried = self.fit_candidate(current.fit.restarted.without(j), None)
                # the model without one cause may diverge, or not stand at all
                lost = min(_lost(t, current) for t in (*tried, most))
                if squares < (form_error * times) ** 4 * lost:
                    return True
        return False


def in_finer_form(before: Sequence[Hypothesis], after: Sequence[Hypothesis]) -> bool:
    """Whether what is new in `after` are finer forms of the laws of `before` that are gone, and there is something new, no more of
    them than laws that are gone."""
    new = {c for c in after if c not in before}
    forms = [f for c in before if c not in after and c.effect != PARAMETER for f in c.finer]
    return bool(new) and len(after) <= len(before) and new <= set(forms)


def _lost(bare: CandidateModel, full: CandidateModel) -> float:
    """Product of the squares that `bare` leaves beyond `full` on the records to fit and on the held-out records."""
    pairs = ((bare.fitted, full.fitted), (bare.held_out, full.held_out))
    # not only what is beyond noise: where the residual alone tells the noise, nothing is
    return float(np.prod([max(a.plain.sum() - b.plain.sum(), 0.0) for a, b in pairs]))


def wins_by_block(before: Misfit, after: Misfit) -> bool:
    """Whether `after` leaves less than `before` in more than one lucky block.

    The paired differences of the blocks' squares, or of their logarithms, have a positive sum with confidence, by a bootstrap of
    the blocks, which count as independent (B. Efron, R. Tibshirani, An Introduction to the Bootstrap, 1993, ch. 8.6). Squares ask
    where most of the mismatch is, logarithms in most blocks; a short record often holds nearly all of its mismatch in two blocks,
    and only the second question has an answer there. Squares of each channel count over what `after` leaves of it, and noise is
    added to those of each block, so that quiet blocks do not vote.
    """
    scale = np.maximum(after.plain_mean, 1.0)
    old, new = (np.sum((m.plain + m.n_plain) / scale, axis=1) for m in (before, after))
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, len(old), (MODEL_SELECTION.block_draws, len(old)))
    gains = (old - new, np.log(np.maximum(old, 1e-300) / np.maximum(new, 1e-300)))
    return bool(
        np.sum(gains[0]) > 0 and any(np.mean(gain[drawn].sum(axis=1) <= 0) < MODEL_SELECTION.block_p for gain in gains)
    )


def numbers_in_each_record(causes: Sequence[Hypothesis]) -> int:
    """How many numbers some causes have that are others in each record."""
    return sum(state.per_record for c in causes if c.prior.of_each_record for state in c.law.states)

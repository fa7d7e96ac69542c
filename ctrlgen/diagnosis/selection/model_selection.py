"""Step 8: what a structure is worth beside another: on the records to fit, on those held out, at the price of its numbers.

T = objective on the records to fit + BIC's price of their numbers + -2 ln of how likely they make the held-out records,
where nothing was fitted, - twice the log prior odds of their causes: among equals the plainer one is named.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.estimation.structure import Structure
from ctrlgen.diagnosis.hypotheses.hypotheses import PARAMETER, Hypothesis
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, restart
from ctrlgen.diagnosis.selection.line_resolvability import lines_resolved
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.settings import MODEL_SELECTION, RESIDUAL_TESTS, STATISTICS


class ModelSelection:
    """Weighs trials against one another; `trial` fits a structure so far as it takes to know what a cause takes away."""

    def __init__(self, fitter: Fitter, candidate: Callable[..., CandidateModel]) -> None:
        self.fitter, self.fit_candidate = fitter, candidate
        self.n_fit = sum(int(fitter.noise.usable(r.valid).sum()) for r in fitter.fit_records)
        self.n_held = sum(int(fitter.noise.usable(r.valid).sum()) for r in fitter.held_out_records)

    def scored(self, fit: Fit, cause: Hypothesis | None) -> CandidateModel:
        """A fit with what the held-out records and the price of its numbers say."""
        structure, held_out_loss = fit.structure, self.fitter.held_out_deviance(fit)
        price = sum(u.cause is not None for u in structure.free_parameters) * np.log(max(self.n_fit, 2))
        price -= 2 * structure.log_prior_odds
        return CandidateModel(fit, held_out_loss, fit.objective + price + held_out_loss, cause)

    def advantage(self, a: CandidateModel, b: CandidateModel) -> float:
        """By how much `a` is better than `b`, and that is beyond what says nothing; negative where it is not.

        Where both leave more than noise, squares count in units of what the better one leaves a sample, on the records to
        fit and on those held out (quasi-likelihood): what neither explains does not choose between them.
        """
        best = min(a, b, key=lambda t: t.criterion)
        c_fit = max(best.fit.objective / max(self.n_fit, 1), 1.0)
        c_held = max(best.held_out_deviance / max(self.n_held, 1), 1.0)
        gain = (
            (b.fit.objective - a.fit.objective) / c_fit
            + (b.held_out_deviance - a.held_out_deviance) / c_held
            + b.complexity_penalty
            - a.complexity_penalty
        )
        both_are_noise = a.fit.is_noise and b.fit.is_noise and self.fitter.noise.known.all()
        slack = (
            MODEL_SELECTION.held_out_slack if both_are_noise else MODEL_SELECTION.excess_slack
        )  # alike on the records to fit, and neither law is right
        return (
            gain - MODEL_SELECTION.excess_slack * self.n_fit * (1 - 1 / c_fit) - slack * self.n_held * (1 - 1 / c_held)
        )

    def most_parsimonious(self, better: list[CandidateModel]) -> CandidateModel:
        """The best trial, or one of as few numbers that is no worse beyond the slack and is less rare."""
        first = better[0]
        for t in better:
            first = t if self.advantage(t, first) > 0 else first
        numbers = len(first.fit.structure.free_parameters)
        alike = [t for t in better if self.advantage(first, t) <= 0 and len(t.fit.structure.free_parameters) <= numbers]
        return min(alike, key=lambda t: (-t.fit.structure.log_prior_odds, t.criterion), default=first)

    @staticmethod
    def parameters_may_mask_cause(fit: Fit) -> bool:
        """Whether the device's own numbers stand so far off that they may hide a cause, at a price."""
        return fit.penalty > MODEL_SELECTION.hidden_penalty + 2 * len(fit.structure.free_parameters)

    def required_z2(self, current: CandidateModel, screened: Screened) -> float:
        """The z^2 that a cause must show: of its own size in the readings, or of the price at which the device hides it."""
        return (
            screened.threshold**2
            if self.parameters_may_mask_cause(current.fit)
            else max(screened.threshold**2, MODEL_SELECTION.material_share**2 * self.n_fit)
        )

    def physically_meaningful(self, candidate: CandidateModel, accepted: tuple[Hypothesis, ...] = ()) -> bool:
        """Whether every cause but those `accepted` has an amplitude inside its bounds, and a usual one, holds, and is no double."""
        structure = candidate.fit.structure
        if not lines_resolved(self.fitter.recording, candidate.fit, accepted):
            return False
        for k, cause in enumerate(structure.causes):
            if cause.effect != PARAMETER and cause not in accepted and not cause.law.holds(candidate.fit.values(k)):
                return False
        for unknown, value in zip(structure.free_parameters, candidate.fit.theta, strict=True):
            if not unknown.amplitude or structure.cause_of(unknown) in accepted:
                continue
            plausible = structure.plausible_range(unknown)
            if plausible and not plausible[0] <= value <= plausible[1]:
                return False
            span = 1e-6 * (unknown.high - unknown.low)
            if value >= unknown.high - span or (value <= unknown.low + span and unknown.low != unknown.nominal):
                return False
        return True

    def justified(self, before: CandidateModel, after: CandidateModel) -> bool:
        """Whether what `after` has more is worth it and means something."""
        return self.improves_enough(before, after) and self.physically_meaningful(after, before.fit.structure.causes)

    def improves_enough(self, before: CandidateModel, after: CandidateModel) -> bool:
        """Whether `after` explains enough more than `before` for its numbers, fitted and held out.

        What the held-out records confirm counts as much as what was fitted, up to the same amount: chance alone gives
        z^2 of 10 in both no more often than one of 17 in the first and of 2 in the other.
        """
        gain, confirmed = before.fit.objective - after.fit.objective, before.held_out_deviance - after.held_out_deviance
        added = len(after.fit.structure.free_parameters) - len(before.fit.structure.free_parameters)
        needed = MODEL_SELECTION.least_gain + added * np.log(max(self.n_fit, 2))
        if (
            before.fit.penalty - after.fit.penalty > MODEL_SELECTION.hidden_share * gain
        ):  # the device hid it at a price: it shows nowhere else
            return gain > needed and confirmed > -MODEL_SELECTION.largest_contradiction
        if (
            self.unseen_in_held_out(before)
            and gain > MODEL_SELECTION.most_of_mismatch * (before.fit.objective - self.n_fit)
            and confirmed > -MODEL_SELECTION.largest_contradiction
        ):
            return gain > needed
        if (
            gain + min(confirmed, gain) <= needed + MODEL_SELECTION.least_confirmed
            or gain <= MODEL_SELECTION.material_share**2 * self.n_fit
        ):
            return False
        return confirmed > max(
            MODEL_SELECTION.least_confirmed,
            MODEL_SELECTION.worthwhile_share * max(before.held_out_deviance - self.n_held, 0.0),
        )

    def unseen_in_held_out(self, candidate: CandidateModel) -> bool:
        """Whether the records to fit show, by the gate of adequacy, what the held-out ones do not."""
        most = RESIDUAL_TESTS.error_ratio**2 - 1
        return (
            candidate.fit.objective - self.n_fit > most * self.n_fit
            and candidate.held_out_deviance - self.n_held < most * self.n_held
        )

    def within_model_form_error(self, bare: CandidateModel, current: CandidateModel, k: int) -> bool:
        """Whether cause k takes away no more than the form of another's law may leave of what that one takes away, of the
        records to fit and of those held out (geometric mean); more, where k may be nothing (the 95 % interval of its
        amplitude reaches off)."""
        fit = current.fit
        own = [i for i, u in enumerate(fit.structure.free_parameters) if u.cause == k and u.amplitude]
        sd = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
        vague = bool(own) and all(
            abs(fit.theta[i] - fit.structure.free_parameters[i].nominal) < STATISTICS.z_95 * sd[i] for i in own
        )
        loss = max(bare.held_out_deviance - current.held_out_deviance, 0.0) * max(
            bare.fit.objective - current.fit.objective, 0.0
        )
        return self._explained_by_model_form_error(
            loss, bare, MODEL_SELECTION.vague_factor if vague else 1.0
        )  # beside k another may take a cause's place

    def residual_within_model_form_error(self, current: CandidateModel) -> bool:
        """Whether all that is left is no more than the form of a cause's law may leave: what would be found in it, would be
        doubtful. Not where the device hides something at a price, or where only what is left tells the noise."""
        if self.parameters_may_mask_cause(current.fit) or not self.fitter.noise.known.all():
            return False
        left = max(current.held_out_deviance - self.n_held, 0.0) * max(current.fit.objective - self.n_fit, 0.0)
        return self._explained_by_model_form_error(left, current)

    def _explained_by_model_form_error(self, squares: float, current: CandidateModel, times: float = 1.0) -> bool:
        """Whether the product of these squares, fitted and held out, is within what the form of a law is off, so many
        `times`, of what its cause takes away."""
        most = self.fit_candidate(
            Structure(current.fit.structure.device), steps=40
        )  # without one alone a fit may leave the numbers
        for j, cause in enumerate(current.fit.structure.causes):
            if form_error := cause.prior.model_form_error:
                without_one = self.fit_candidate(restart(current.fit).without(j))
                held_out_loss = min(without_one.held_out_deviance, most.held_out_deviance) - current.held_out_deviance
                fit_loss = min(without_one.fit.objective, most.fit.objective) - current.fit.objective
                if squares < (form_error * times) ** 4 * max(held_out_loss, 0.0) * max(fit_loss, 0.0):
                    return True
        return False

"""Model selection: compares candidate models on the records to fit, on the held-out records and by their complexity.

    T = objective + k ln n + held-out deviance - 2 ln(prior odds)

with the objective (whitened squares on the n samples to fit, plus the penalties of stated parameters), the k parameters of
the causes (as in BIC), the deviance -2 ln likelihood on the held-out records, to which nothing was fitted, and the prior
odds of the causes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.estimation.held_out import held_out_deviance
from ctrlgen.diagnosis.estimation.structure import Structure
from ctrlgen.diagnosis.hypotheses.hypotheses import PARAMETER, Hypothesis
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, restart
from ctrlgen.diagnosis.selection.line_resolvability import lines_resolved
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.settings import MODEL_SELECTION, RESIDUAL_TESTS, STATISTICS


class ModelSelection:
    """The tests by which candidate models are compared; `candidate` fits a structure for them."""

    def __init__(self, fitter: Fitter, candidate: Callable[..., CandidateModel]) -> None:
        self.fitter, self.fit_candidate = fitter, candidate
        self.n_fit = sum(int(fitter.noise.usable(r.valid).sum()) for r in fitter.fit_records)
        self.n_held = sum(int(fitter.noise.usable(r.valid).sum()) for r in fitter.held_out_records)

    def scored(self, fit: Fit, cause: Hypothesis | None) -> CandidateModel:
        """The candidate model of a fit, with its held-out deviance and criterion T."""
        structure, held_out_loss = fit.structure, held_out_deviance(self.fitter, fit)
        price = sum(u.cause is not None for u in structure.free_parameters) * np.log(max(self.n_fit, 2))
        price -= 2 * structure.log_prior_odds
        return CandidateModel(fit, held_out_loss, fit.objective + price + held_out_loss, cause)

    def advantage(self, a: CandidateModel, b: CandidateModel) -> float:
        """By how much the criterion of `a` is better than that of `b`, less the slack; negative where it is not better.

        Where both leave more than noise, squares are divided by the mean square that the better one leaves
        (quasi-likelihood), on the records to fit and on the held-out ones, and small differences of what neither explains
        do not count (slack).
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
        )  # both explain the records to fit, and neither law is exact
        return (
            gain - MODEL_SELECTION.excess_slack * self.n_fit * (1 - 1 / c_fit) - slack * self.n_held * (1 - 1 / c_held)
        )

    def most_parsimonious(self, better: list[CandidateModel]) -> CandidateModel:
        """The best candidate or, of those within the slack with no more parameters, the one with the largest prior odds."""
        first = better[0]
        for t in better:
            first = t if self.advantage(t, first) > 0 else first
        numbers = len(first.fit.structure.free_parameters)
        alike = [t for t in better if self.advantage(first, t) <= 0 and len(t.fit.structure.free_parameters) <= numbers]
        return min(alike, key=lambda t: (-t.fit.structure.log_prior_odds, t.criterion), default=first)

    @staticmethod
    def parameters_may_mask_cause(fit: Fit) -> bool:
        """Whether the device's parameters deviate so far from their stated values that they may mask a cause."""
        return fit.penalty > MODEL_SELECTION.hidden_penalty + 2 * len(fit.structure.free_parameters)

    def required_z2(self, current: CandidateModel, screened: Screened) -> float:
        """The z^2 that a hypothesis needs to be fitted: the screen's threshold and, unless parameters of the device may
        mask it, a material effect on the readings."""
        return (
            screened.threshold**2
            if self.parameters_may_mask_cause(current.fit)
            else max(screened.threshold**2, MODEL_SELECTION.material_share**2 * self.n_fit)
        )

    def physically_meaningful(self, candidate: CandidateModel, accepted: tuple[Hypothesis, ...] = ()) -> bool:
        """Whether each cause that is not yet `accepted` has an amplitude inside its bounds and its plausible range, fulfils the
        validity conditions of its law, and can be told apart from other lines of its kind."""
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
        """Whether `after` improves enough on `before`, and its new causes are physically meaningful."""
        return self.improves_enough(before, after) and self.physically_meaningful(after, before.fit.structure.causes)

    def improves_enough(self, before: CandidateModel, after: CandidateModel) -> bool:
        """Whether `after` lowers the objective and the held-out deviance enough for its additional parameters.

        The held-out gain counts as much as the gain on the records to fit, up to the same amount: chance gives z^2 = 10 on
        both no more often than 17 on the first and 2 on the second. Less is required of the held-out records where the
        device's parameters masked the cause, and where the held-out records cannot show it.
        """
        gain, confirmed = before.fit.objective - after.fit.objective, before.held_out_deviance - after.held_out_deviance
        added = len(after.fit.structure.free_parameters) - len(before.fit.structure.free_parameters)
        needed = MODEL_SELECTION.least_gain + added * np.log(max(self.n_fit, 2))
        if (
            before.fit.penalty - after.fit.penalty > MODEL_SELECTION.hidden_share * gain
        ):  # parameters of the device masked it, so the readings hardly show it
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
        """Whether the residual fails the residual test on the records to fit, and passes it on the held-out records."""
        most = RESIDUAL_TESTS.error_ratio**2 - 1
        return (
            candidate.fit.objective - self.n_fit > most * self.n_fit
            and candidate.held_out_deviance - self.n_held < most * self.n_held
        )

    def within_model_form_error(self, bare: CandidateModel, current: CandidateModel, k: int) -> bool:
        """Whether cause k explains no more than the model-form error of another accepted cause (geometric mean of the squares
        on the records to fit and on the held-out records); a multiple of that where the 95 % interval of k's amplitude
        includes zero. `bare` is the model without k."""
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
        )  # beside k, another cause may take the place of an accepted one

    def residual_within_model_form_error(self, current: CandidateModel) -> bool:
        """Whether the residual is no larger than the model-form error of a cause, so that further causes could not be trusted.
        False where parameters of the device may mask a cause, and where the noise is known from the residual alone."""
        if self.parameters_may_mask_cause(current.fit) or not self.fitter.noise.known.all():
            return False
        left = max(current.held_out_deviance - self.n_held, 0.0) * max(current.fit.objective - self.n_fit, 0.0)
        return self._explained_by_model_form_error(left, current)

    def _explained_by_model_form_error(self, squares: float, current: CandidateModel, times: float = 1.0) -> bool:
        """Whether `squares`, the product of those on the records to fit and on the held-out records, is at most the same product
        for the model-form error of a cause, multiplied by `times`."""
        most = self.fit_candidate(
            Structure(current.fit.structure.device), steps=40
        )  # the model without one cause may diverge
        for j, cause in enumerate(current.fit.structure.causes):
            if form_error := cause.prior.model_form_error:
                without_one = self.fit_candidate(restart(current.fit).without(j))
                held_out_loss = min(without_one.held_out_deviance, most.held_out_deviance) - current.held_out_deviance
                fit_loss = min(without_one.fit.objective, most.fit.objective) - current.fit.objective
                if squares < (form_error * times) ** 4 * max(held_out_loss, 0.0) * max(fit_loss, 0.0):
                    return True
        return False

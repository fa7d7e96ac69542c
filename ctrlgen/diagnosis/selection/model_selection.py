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
from ctrlgen.diagnosis.selection.candidate_model import Trial, cooled
from ctrlgen.diagnosis.selection.line_resolvability import resolved
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.settings import MODEL_SELECTION, RESIDUAL_TESTS, STATISTICS


class Weighing:
    """Weighs trials against one another; `trial` fits a structure so far as it takes to know what a cause takes away."""

    def __init__(self, fitter: Fitter, trial: Callable[..., Trial]) -> None:
        self.fitter, self.trial = fitter, trial
        self.n_fit = sum(int(fitter.noise.usable(r.valid).sum()) for r in fitter.fit_records)
        self.n_held = sum(int(fitter.noise.usable(r.valid).sum()) for r in fitter.held_out_records)

    def judged(self, fit: Fit, cause: Hypothesis | None) -> Trial:
        """A fit with what the held-out records and the price of its numbers say."""
        structure, held = fit.structure, self.fitter.held_out_deviance(fit)
        price = sum(u.cause is not None for u in structure.free_parameters) * np.log(max(self.n_fit, 2))
        price -= 2 * structure.log_prior_odds
        return Trial(fit, held, fit.objective + price + held, cause)

    def ahead(self, a: Trial, b: Trial) -> float:
        """By how much `a` is better than `b`, and that is beyond what says nothing; negative where it is not.

        Where both leave more than noise, squares count in units of what the better one leaves a sample, on the records to
        fit and on those held out (quasi-likelihood): what neither explains does not choose between them.
        """
        best = min(a, b, key=lambda t: t.total)
        c_fit = max(best.fit.objective / max(self.n_fit, 1), 1.0)
        c_held = max(best.held / max(self.n_held, 1), 1.0)
        gained = (b.fit.objective - a.fit.objective) / c_fit + (b.held - a.held) / c_held + b.price - a.price
        met = a.fit.is_noise and b.fit.is_noise and self.fitter.noise.known.all()
        slack = (
            MODEL_SELECTION.held_out_slack if met else MODEL_SELECTION.excess_slack
        )  # alike on the records to fit, and neither law is right
        return (
            gained
            - MODEL_SELECTION.excess_slack * self.n_fit * (1 - 1 / c_fit)
            - slack * self.n_held * (1 - 1 / c_held)
        )

    def plainest(self, better: list[Trial]) -> Trial:
        """The best trial, or one of as few numbers that is no worse beyond the slack and is less rare."""
        first = better[0]
        for t in better:
            first = t if self.ahead(t, first) > 0 else first
        numbers = len(first.fit.structure.free_parameters)
        alike = [t for t in better if self.ahead(first, t) <= 0 and len(t.fit.structure.free_parameters) <= numbers]
        return min(alike, key=lambda t: (-t.fit.structure.log_prior_odds, t.total), default=first)

    @staticmethod
    def hides(fit: Fit) -> bool:
        """Whether the device's own numbers stand so far off that they may hide a cause, at a price."""
        return fit.penalty > MODEL_SELECTION.hidden_penalty + 2 * len(fit.structure.free_parameters)

    def need(self, current: Trial, screened: Screened) -> float:
        """The z^2 that a cause must show: of its own size in the readings, or of the price at which the device hides it."""
        return (
            screened.threshold**2
            if self.hides(current.fit)
            else max(screened.threshold**2, MODEL_SELECTION.material_share**2 * self.n_fit)
        )

    def meant(self, trial: Trial, accepted: tuple[Hypothesis, ...] = ()) -> bool:
        """Whether every cause but those `accepted` has an amplitude inside its bounds, and a usual one, holds, and is no double."""
        structure = trial.fit.structure
        if not resolved(self.fitter.recording, trial.fit, accepted):
            return False
        for k, cause in enumerate(structure.causes):
            if cause.effect != PARAMETER and cause not in accepted and not cause.law.holds(trial.fit.values(k)):
                return False
        for unknown, value in zip(structure.free_parameters, trial.fit.theta, strict=True):
            if not unknown.amplitude or structure.cause_of(unknown) in accepted:
                continue
            plausible = structure.plausible_range(unknown)
            if plausible and not plausible[0] <= value <= plausible[1]:
                return False
            span = 1e-6 * (unknown.high - unknown.low)
            if value >= unknown.high - span or (value <= unknown.low + span and unknown.low != unknown.nominal):
                return False
        return True

    def justified(self, before: Trial, after: Trial) -> bool:
        """Whether what `after` has more is worth it and means something."""
        return self.worth(before, after) and self.meant(after, before.fit.structure.causes)

    def worth(self, before: Trial, after: Trial) -> bool:
        """Whether `after` explains enough more than `before` for its numbers, fitted and held out.

        What the held-out records confirm counts as much as what was fitted, up to the same amount: chance alone gives
        z^2 of 10 in both no more often than one of 17 in the first and of 2 in the other.
        """
        gained, confirmed = before.fit.objective - after.fit.objective, before.held - after.held
        added = len(after.fit.structure.free_parameters) - len(before.fit.structure.free_parameters)
        needed = MODEL_SELECTION.least_gain + added * np.log(max(self.n_fit, 2))
        if (
            before.fit.penalty - after.fit.penalty > MODEL_SELECTION.hidden_share * gained
        ):  # the device hid it at a price: it shows nowhere else
            return gained > needed and confirmed > -MODEL_SELECTION.largest_contradiction
        if (
            self.out_of_reach(before)
            and gained > MODEL_SELECTION.most_of_mismatch * (before.fit.objective - self.n_fit)
            and confirmed > -MODEL_SELECTION.largest_contradiction
        ):
            return gained > needed
        if (
            gained + min(confirmed, gained) <= needed + MODEL_SELECTION.least_confirmed
            or gained <= MODEL_SELECTION.material_share**2 * self.n_fit
        ):
            return False
        return confirmed > max(
            MODEL_SELECTION.least_confirmed, MODEL_SELECTION.worthwhile_share * max(before.held - self.n_held, 0.0)
        )

    def out_of_reach(self, trial: Trial) -> bool:
        """Whether the records to fit show, by the gate of adequacy, what the held-out ones do not."""
        most = RESIDUAL_TESTS.error_ratio**2 - 1
        return trial.fit.objective - self.n_fit > most * self.n_fit and trial.held - self.n_held < most * self.n_held

    def doubtful(self, bare: Trial, current: Trial, k: int) -> bool:
        """Whether cause k takes away no more than the form of another's law may leave of what that one takes away, of the
        records to fit and of those held out (geometric mean); more, where k may be nothing (the 95 % interval of its
        amplitude reaches off)."""
        fit = current.fit
        own = [i for i, u in enumerate(fit.structure.free_parameters) if u.cause == k and u.amplitude]
        sd = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
        vague = bool(own) and all(
            abs(fit.theta[i] - fit.structure.free_parameters[i].nominal) < STATISTICS.z_95 * sd[i] for i in own
        )
        lost = max(bare.held - current.held, 0.0) * max(bare.fit.objective - current.fit.objective, 0.0)
        return self._may_be_form(
            lost, bare, MODEL_SELECTION.vague_factor if vague else 1.0
        )  # beside k another may take a cause's place

    def of_form(self, current: Trial) -> bool:
        """Whether all that is left is no more than the form of a cause's law may leave: what would be found in it, would be
        doubtful. Not where the device hides something at a price, or where only what is left tells the noise."""
        if self.hides(current.fit) or not self.fitter.noise.known.all():
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
            if form_error := cause.prior.model_form_error:
                without = self.trial(cooled(current.fit).without(j))
                held = min(without.held, most.held) - current.held
                fitted = min(without.fit.objective, most.fit.objective) - current.fit.objective
                if squares < (form_error * times) ** 4 * max(held, 0.0) * max(fitted, 0.0):
                    return True
        return False

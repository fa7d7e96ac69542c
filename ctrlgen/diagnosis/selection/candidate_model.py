"""Records of the search: candidate models with what they leave, and rounds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.diagnosis.selection.failures import Failure
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.estimation.error_model import ErrorModel
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.misfit import Misfit


@dataclass(frozen=True, eq=False)
class CandidateModel:
    """A fitted structure and what it leaves.

    errors: noise and the discrepancy that the candidate itself leaves. fitted, held_out: its misfit on the records to fit and
    on the held-out records, by which models are compared. refit_penalty: -2 ln likelihood of the refit to the held-out records, 0
    where the parameters are as fitted. cause: the hypothesis that the candidate was fitted for. unmoved: its misfit on the held-out
    records with the parameters as fitted, where `held_out` is of such a refit.
    """

    fit: Fit
    errors: ErrorModel
    fitted: Misfit
    held_out: Misfit
    refit_penalty: float = 0.0
    cause: Hypothesis | None = None
    unmoved: Misfit | None = None

    @property
    def predicted(self) -> Misfit:
        """Its misfit on the held-out records with the parameters as fitted: what a reader is told."""
        return self.held_out if self.unmoved is None else self.unmoved

    @property
    def causes(self) -> tuple[Hypothesis, ...]:
        """The causes of its structure."""
        return self.fit.structure.causes

    @property
    def squares(self) -> np.ndarray:
        """The squares (n_y,) that it leaves on the records to fit, weighed as the scores of a screen are: by noise, and where it has
        discrepancy by that, under which a residual leaves one for each independent sample (`ErrorModel`)."""
        of_discrepancy = self.fitted.n_plain.sum(axis=0) / self.errors.tau
        return np.where(self.errors.rms > 0, of_discrepancy, self.fitted.white.sum(axis=0))


@dataclass(frozen=True, eq=False)
class Refusal:
    """A candidate model that was not taken as it was, because of the `reasons` against some of its `causes`, one each. `gain`: by how
    much its criterion T is better than that of what its round took; negative where it is worse."""

    candidate: CandidateModel
    causes: tuple[Hypothesis, ...]
    reasons: tuple[str, ...]
    gain: float = 0.0


@dataclass(frozen=True, eq=False)
class Attempt:
    """One fit of the search: in which `round` (from 1), from what numbers [SI] each cause of it was `started`, and the `candidate`
    that it reached, without the slopes and the residual of its fit."""

    round: int
    started: tuple[dict[str, float], ...]
    candidate: CandidateModel

    @classmethod
    def of(cls, round_: int, started: tuple[dict[str, float], ...], candidate: CandidateModel) -> Attempt:
        """The attempt that reached a candidate; slopes and residuals of all fits would fill the memory."""
        fit = candidate.fit
        light = replace(fit, residual=np.zeros(0), J=np.zeros((0, fit.J.shape[1])), initial_states=(), shapes=())
        return cls(round_, started, replace(candidate, fit=light))


@dataclass(frozen=True, eq=False)
class Round:
    """One round of the search.

    screened: its screen. candidates: its candidate models, the best first, with the `criteria` T of each. before: the model
    before, with the criterion `criterion_before`. refused: what was not taken, with the reasons, first what would gain most. failed: trials
    that could not be simulated, with the reason. gone_on_beside: the causes that were refused and beside which the search went on.
    """

    screened: Screened
    candidates: tuple[CandidateModel, ...]
    criteria: tuple[float, ...]
    before: CandidateModel
    criterion_before: float
    refused: tuple[Refusal, ...] = ()
    failed: tuple[Failure, ...] = ()
    gone_on_beside: tuple[Hypothesis, ...] = ()


def linearised_optimum(fit: Fit) -> float:
    """The objective at the optimum of a fit's linearisation: what remains once all free parameters have adapted."""
    step = np.linalg.lstsq(fit.J, fit.residual, rcond=None)[0]
    return float(np.sum((fit.residual - fit.J @ step) ** 2))

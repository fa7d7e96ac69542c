"""Records of the search: candidate models with their criterion, rounds, and the result."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.diagnosis.estimation.fit import Fit
from ctrlgen.diagnosis.estimation.structure import Structure
from ctrlgen.diagnosis.hypotheses.hypotheses import Hypothesis
from ctrlgen.diagnosis.selection.screen import Screened


@dataclass(frozen=True, eq=False)
class CandidateModel:
    """A fitted structure with its selection criterion.

    held_out_deviance: -2 ln likelihood on the held-out records. criterion: T (see `model_selection`), smaller is better.
    cause: the hypothesis that the candidate was fitted for.
    """

    fit: Fit
    held_out_deviance: float
    criterion: float
    cause: Hypothesis | None = None

    @property
    def complexity_penalty(self) -> float:
        """Penalty for the number of parameters and the prior odds of the causes."""
        return self.criterion - self.fit.objective - self.held_out_deviance


@dataclass(frozen=True, eq=False)
class Round:
    """One round of the search: its screen, its candidate models, the best first, and the model before."""

    screened: Screened
    candidates: tuple[CandidateModel, ...]
    before: CandidateModel


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The result of a search.

    nominal: the device as described, refitted within its stated uncertainty. chosen: the selected model.
    without_cause: the chosen model without each of its causes. rivals: for each cause, models with another cause in its
    place that explain the recording equally well. rounds: in order. final_screen: the screen of the chosen model.
    """

    nominal: CandidateModel
    chosen: CandidateModel
    without_cause: tuple[CandidateModel, ...]
    rivals: tuple[tuple[CandidateModel, ...], ...]
    rounds: tuple[Round, ...]
    final_screen: Screened


def linearised_optimum(fit: Fit) -> float:
    """The objective at the optimum of a fit's linearisation: what remains once all free parameters have adapted."""
    step = np.linalg.lstsq(fit.J, fit.residual, rcond=None)[0]
    return float(np.sum((fit.residual - fit.J @ step) ** 2))


def restart(fit: Fit) -> Structure:
    """The structure of a fit with all parameters starting at their fitted values."""
    s = fit.structure
    own = {u.path: float(v) for u, v in zip(s.free_parameters, fit.theta, strict=True) if u.cause is None}
    return Structure(s.device, s.causes, tuple(fit.values(k) for k in range(len(s.causes))), own)


def restart_with(fit: Fit, cause: Hypothesis, start: dict[str, float]) -> Structure:
    """The same with another cause, whose parameters start at `start` [SI]."""
    return restart(fit).with_cause(cause, start)

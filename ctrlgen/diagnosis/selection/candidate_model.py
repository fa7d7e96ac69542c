"""What a search tries and finds: structures fitted and judged, round by round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.diagnosis.estimation.fit import Fit
from ctrlgen.diagnosis.estimation.structure import Structure
from ctrlgen.diagnosis.hypotheses.hypotheses import Hypothesis
from ctrlgen.diagnosis.selection.screen import Screened


@dataclass(frozen=True, eq=False)
class CandidateModel:
    """One structure fitted, with `held`, its -2 ln likelihood on the held-out records (`Fitter.held_out`), and its total T."""

    fit: Fit
    held_out_deviance: float
    criterion: float
    cause: Hypothesis | None = None

    @property
    def complexity_penalty(self) -> float:
        """Of its numbers and of the prior odds of its causes."""
        return self.criterion - self.fit.objective - self.held_out_deviance


@dataclass(frozen=True, eq=False)
class Round:
    """What one round saw: its screen and its trials, best first."""

    screened: Screened
    candidates: tuple[CandidateModel, ...]
    before: CandidateModel


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The nominal fit, the chosen one, the chosen one without each of its causes, per cause the rivals that explain alike,
    and the rounds in order."""

    nominal: CandidateModel
    chosen: CandidateModel
    without_cause: tuple[CandidateModel, ...]
    rivals: tuple[tuple[CandidateModel, ...], ...]
    rounds: tuple[Round, ...]
    final_screen: Screened


def linearised_optimum(fit: Fit) -> float:
    """The objective once the free numbers of a fit that is not at its optimum have moved there, to first order."""
    step = np.linalg.lstsq(fit.J, fit.residual, rcond=None)[0]
    return float(np.sum((fit.residual - fit.J @ step) ** 2))


def restart(fit: Fit) -> Structure:
    """The structure with its causes and the device's own numbers starting where the fit ended."""
    s = fit.structure
    own = {u.path: float(v) for u, v in zip(s.free_parameters, fit.theta, strict=True) if u.cause is None}
    return Structure(s.device, s.causes, tuple(fit.values(k) for k in range(len(s.causes))), own)


def restart_with(fit: Fit, cause: Hypothesis, start: dict[str, float]) -> Structure:
    """The same with another cause, begun at `start` [SI]."""
    return restart(fit).with_cause(cause, start)

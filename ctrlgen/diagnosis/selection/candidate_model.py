"""What a search tries and finds: structures fitted and judged, round by round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.diagnosis.estimation.fit import Fit
from ctrlgen.diagnosis.estimation.structure import Structure
from ctrlgen.diagnosis.hypotheses.hypotheses import Hypothesis
from ctrlgen.diagnosis.selection.screen import Screened


@dataclass(frozen=True, eq=False)
class Trial:
    """One structure fitted, with `held`, its -2 ln likelihood on the held-out records (`Fitter.held_out`), and its total T."""

    fit: Fit
    held: float
    total: float
    cause: Hypothesis | None = None

    @property
    def price(self) -> float:
        """Of its numbers and of the prior odds of its causes."""
        return self.total - self.fit.objective - self.held


@dataclass(frozen=True, eq=False)
class Round:
    """What one round saw: its screen and its trials, best first."""

    screened: Screened
    trials: tuple[Trial, ...]
    before: Trial


@dataclass(frozen=True, eq=False)
class Search:
    """The nominal fit, the chosen one, the chosen one without each of its causes, per cause the rivals that explain alike,
    and the rounds in order."""

    nominal: Trial
    chosen: Trial
    bare: tuple[Trial, ...]
    rivals: tuple[tuple[Trial, ...], ...]
    rounds: tuple[Round, ...]
    last: Screened


def freed(fit: Fit) -> float:
    """The objective once the free numbers of a fit that is not at its optimum have moved there, to first order."""
    step = np.linalg.lstsq(fit.J, fit.residual, rcond=None)[0]
    return float(np.sum((fit.residual - fit.J @ step) ** 2))


def cooled(fit: Fit) -> Structure:
    """The structure with its causes and the device's own numbers starting where the fit ended."""
    s = fit.structure
    own = {u.path: float(v) for u, v in zip(s.free_parameters, fit.theta, strict=True) if u.cause is None}
    return Structure(s.device, s.causes, tuple(fit.values(k) for k in range(len(s.causes))), own)


def warm(fit: Fit, cause: Hypothesis, start: dict[str, float]) -> Structure:
    """The same with another cause, begun at `start` [SI]."""
    return cooled(fit).with_cause(cause, start)

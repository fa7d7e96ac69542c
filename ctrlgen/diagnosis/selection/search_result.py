"""The result of a search."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.diagnosis.selection.attribution import Attribution
from ctrlgen.diagnosis.selection.candidate_model import Attempt, CandidateModel, Round
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.robust_covariance import robust_deviations


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The result of a search.

    fitter: with the noise and the discrepancy learnt. nominal: the device as described, refitted within its stated uncertainty.
    chosen: the selected model. account: what each of its causes takes away of what `nominal` leaves. without_cause: the chosen
    model without each of its causes. rivals: for each cause, models with another cause in its place that explain the recording
    equally well. rounds: in order. final_screen: the screen of the chosen model. withdrawn: causes that were taken out at the
    end, because with them the held-out records are predicted worse than by the device as described. attempts: every fit of a
    model with causes, in order. offered: the hypotheses among which was searched.
    unlikely: for each cause, models with another one in its place that fit alike, of a size that is far less likely.
    """

    fitter: Fitter
    nominal: CandidateModel
    chosen: CandidateModel
    account: Attribution
    without_cause: tuple[CandidateModel, ...]
    rivals: tuple[tuple[CandidateModel, ...], ...]
    rounds: tuple[Round, ...]
    final_screen: Screened
    withdrawn: tuple[Hypothesis, ...] = ()
    attempts: tuple[Attempt, ...] = ()
    offered: tuple[Hypothesis, ...] = ()
    unlikely: tuple[tuple[CandidateModel, ...], ...] = ()

    def deviations(self) -> np.ndarray:
        """Standard deviation (k,) [SI] of each free number of the chosen model, of which what one law more would move it by is a part."""
        return np.hypot(robust_deviations(self.chosen.fit), self.final_screen.moves)

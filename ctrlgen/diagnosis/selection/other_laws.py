"""Causes that were accepted for what their names say, and by now stand for something else.

Objections are raised before a cause is accepted. While others came and went, its numbers moved on: they may have left their law's
range, or ended at a bound where it is another law, or its size may be zero within the intervals, as where a gain and a loop make up
what is a play. What is sound then takes its place where it explains alike, or nearly (`SEARCH.bound_slack`).
"""

from __future__ import annotations

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.confusable import explains_alike
from ctrlgen.diagnosis.selection.objections import another_law
from ctrlgen.diagnosis.selection.supported import amplitude_may_be_zero
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.estimation.fit import Fit


def stands_for_another(fit: Fit, k: int) -> bool:
    """Whether cause k is by now another law (`another_law`), or of a size that may be zero."""
    return another_law(fit, k) is not None or amplitude_may_be_zero(fit, k)


def takes_over(trials: Trials, rival: CandidateModel, current: CandidateModel, k: int) -> bool:
    """Whether a rival is sound, without cause k, and explains alike or nearly: of its causes that are not in `current` none stands for
    something else, and nothing speaks against any."""
    new = [j for j, c in enumerate(rival.causes) if c not in current.causes]
    if current.causes[k] in rival.causes or any(stands_for_another(rival.fit, j) for j in new):
        return False
    alike = explains_alike(trials.selection, rival, current, SEARCH.bound_slack)
    return alike and not trials.objections(rival, current.causes)

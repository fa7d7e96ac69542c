"""Numbers of the device that bend to do without a cause.

Where more than noise is left, a cause must take away a share of the whole mismatch that is worth a name. The model without it may leave as
little by numbers far from what the device file states: they are no answer, and with the stated ones all is left again.
"""

from __future__ import annotations

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.pruning import no_worse
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.selection.verdict import contradicts_datasheet
from ctrlgen.estimation.settings import FIT


def not_bent_away(
    trials: Trials, nominal: CandidateModel, bare: CandidateModel, accepted: CandidateModel
) -> CandidateModel:
    """The device as described, `nominal`, as the answer of a search that ends without causes; the model that its rounds `accepted` where
    `bare`, for which its causes were dropped, contradicts the device file and that model does not."""
    if not accepted.causes or not contradicts_datasheet(bare.fit):
        return nominal
    for again in trials.tried(accepted.fit.restarted, accepted.cause, steps=FIT.max_steps):
        sound = not trials.objections(again, again.causes) and not contradicts_datasheet(again.fit)
        if sound and trials.selection.improves_enough(nominal, again) and no_worse(trials, nominal, again) is again:
            return again
    return nominal

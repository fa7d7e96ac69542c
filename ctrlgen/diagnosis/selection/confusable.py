"""What makes two causes confusable: by their sensitivities before any fit, by the criterion T after both are fitted.

Two hypotheses look alike where the changes s_a and s_b of the readings that they cause, projected off what the free numbers can
do, have

    |cos(s_a, s_b)| >= `CONFUSABLE.cosine`;

a linear estimate of one amplitude beside the other is then arbitrary. Shape parameters are fixed there, and fits of them can make
two causes more alike, so that this only says what is to be expected of a recording (detectability, the figure of
confusability). What counts as an alternative of a finding is decided by fits: two models explain alike where

    T_rival - T_model < `CONFUSABLE.criterion`,

T being -2 ln of the likelihood with the price of the parameters (`model_selection`), both under common errors.
"""

from __future__ import annotations

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.selection.subset_search import Suspect
from ctrlgen.diagnosis.settings import CONFUSABLE
from ctrlgen.estimation.size_odds import prior_odds


def likeness(screened: Screened, a: Suspect, b: Suspect) -> float:
    """|cos| between the projected sensitivities of two suspects."""
    return float(abs(screened.cosine[a.index, b.index]))


def look_alike(screened: Screened, suspect: Suspect) -> list[Suspect]:
    """The suspects that look like one of them, at most `CONFUSABLE.most_listed`, the most similar first."""
    others = (s for s in screened.suspects if s.hypothesis != suspect.hypothesis)
    ranked = sorted(others, key=lambda s: -likeness(screened, suspect, s))
    return [s for s in ranked[: CONFUSABLE.most_listed] if likeness(screened, suspect, s) >= CONFUSABLE.cosine]


def explains_alike(compare: ModelSelection, rival: CandidateModel, model: CandidateModel, slack: float = 0.0) -> bool:
    """Whether a rival explains the recording as well as a model does, or better; worse by the `slack` too."""
    return compare.advantage(model, rival) < CONFUSABLE.criterion + slack


def explains_better(compare: ModelSelection, rival: CandidateModel, model: CandidateModel) -> bool:
    """Whether a rival explains the recording so much better that it is no alternative of the model but takes its place."""
    return compare.advantage(rival, model) > CONFUSABLE.criterion


def is_commoner(compare: ModelSelection, rival: CandidateModel, model: CandidateModel) -> bool:
    """Whether a rival explains no worse than a model does and is likelier beforehand, where noise alone is left: of laws that do the same
    the commoner stands first. Where more is left, a rival may be ahead by what it fits of that."""
    likelier = prior_odds(rival.fit) > prior_odds(model.fit)
    return likelier and compare.reference((rival, model)).is_noise and compare.advantage(rival, model) > 0

"""Rivals where every model leaves more than noise: what is left is then an error of the form of whichever law acts.

The criterion T counts independent samples by the time over which a residual forgets itself. An error of form forgets nothing: it is a
smooth function of the state and comes back wherever the machine does, so that a long record holds no more of it than a short one. Two laws
of which one leaves half as much of that as the other are no more told apart by a thousand samples than by a few. Hence

    T' = sum over channels and both kinds of records of m ln(q - 1) + k ln m - 2 ln(prior odds),   m = `CONFUSABLE.form_samples`,

q the mean square over that of the noise, as in `model_selection`, k the numbers of the causes. The penalty of the stated numbers is
not in it: an error of form bends them, and may bend those of the law that acts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import CONFUSABLE, SEARCH
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.misfit import Misfit
from ctrlgen.estimation.settings import STATISTICS
from ctrlgen.estimation.size_odds import prior_odds


def hidden_rivals(
    trials: Trials, current: CandidateModel, k: int, candidates: Sequence[CandidateModel]
) -> list[CandidateModel]:
    """Of the `candidates`, models with another cause in place of k, those from which `current` is not told because both leave errors of
    form: each fitted to its end, at most `CONFUSABLE.most_listed`, those that leave least first. None where `current` leaves noise alone,
    or what is noise is not known."""
    if current.errors.is_noise or not trials.fitter.noise.known.all():
        return []
    # by what they leave: those of earlier rounds have an objective under other errors
    near = [t for t in candidates if _may_replace(t, current, k) and hardly_told(current, t)]
    best: dict[Hypothesis | None, CandidateModel] = {}
    for t in sorted(near, key=lambda t: advantage_in_form(current, t)):
        if not trials.objections(t, current.causes):
            best.setdefault(t.cause, t)
    ends = trials.each(
        lambda branch, t: branch.converged(t, _enough(branch, current, t)),
        list(best.values())[: CONFUSABLE.most_listed],
    )
    bare = trials.tried(current.fit.restarted.without(k), None)
    return [
        t
        for t in ends
        if advantage_in_form(current, t) < CONFUSABLE.criterion and all(_explains_as_much(b, current, t) for b in bare)
    ]


def _enough(trials: Trials, current: CandidateModel, t: CandidateModel) -> float:
    """The objective to which a rival must come at least to be told no more, where it leaves less of all readings alike as it is fitted."""
    readings = 2 * t.fitted.plain.shape[1]  # of both kinds of records
    behind = max(advantage_in_form(current, t) - CONFUSABLE.criterion, 0.0)
    begun = trials.fitter.initial_objective(t.fit.restarted)
    return begun * float(np.exp(-behind / (readings * CONFUSABLE.form_samples)))


def hardly_told(current: CandidateModel, rival: CandidateModel) -> bool:
    """Whether `rival`, fitted to its end, may be one of the `hidden_rivals`."""
    return advantage_in_form(current, rival) < CONFUSABLE.unfinished * CONFUSABLE.criterion


def follows_the_motion_as_well(current: CandidateModel, k: int, rival: CandidateModel) -> bool:
    """Whether cause k acts with the motion, and a rival that is a function of time alone in its place is better by no more than errors of
    form are: at one speed a line follows those of a pitch too, and holds at that speed alone."""
    of_time = rival.cause is not None and rival.cause.prior.of_time and not current.causes[k].prior.of_time
    return of_time and not rival.errors.is_noise and advantage_in_form(rival, current) < CONFUSABLE.criterion


def advantage_in_form(a: CandidateModel, b: CandidateModel) -> float:
    """By how much T' of `a` is better than that of `b`; negative where it is worse."""
    m = CONFUSABLE.form_samples
    pairs = ((a.fitted, b.fitted), (a.held_out, b.held_out))
    left = sum(m * float(np.sum(np.log(_beyond_noise(of_b) / _beyond_noise(of_a)))) for of_a, of_b in pairs)
    numbers = [sum(u.cause is not None for u in t.fit.structure.free_parameters) for t in (a, b)]
    return left + (numbers[1] - numbers[0]) * float(np.log(m)) - 2 * (prior_odds(b.fit) - prior_odds(a.fit))


def _beyond_noise(left: Misfit) -> np.ndarray:
    """q - 1 of each channel, of a reading at its noise what chance makes of it."""
    chance = STATISTICS.chance_excess * np.sqrt(2 / np.maximum(left.n_plain.sum(axis=0), 1))
    return np.maximum(left.plain_mean - 1, chance)


def _explains_as_much(bare: CandidateModel, current: CandidateModel, rival: CandidateModel) -> bool:
    """Whether a rival takes away nearly as much as the cause in whose place it stands, without which `bare` is: beside what other laws
    leave, two small causes leave nearly the same, and so does none."""
    triples = ((bare.fitted, current.fitted, rival.fitted), (bare.held_out, current.held_out, rival.held_out))
    return all(b.excess - r.excess >= SEARCH.nearly_best * (b.excess - c.excess) for b, c, r in triples)


def _may_replace(t: CandidateModel, current: CandidateModel, k: int) -> bool:
    """Whether a rival is another cause than k, and no function of time alone unless that is one: such a one follows any error of form."""
    cause = current.causes[k]
    return t.cause is not None and t.cause != cause and (cause.prior.of_time or not t.cause.prior.of_time)

"""Causes taken out of a model: those that meet an objection, and those that it does not need.

A candidate is pruned, not discarded: without the causes that meet an objection it is fitted again and compared again, and
what is refused is kept with its reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, Refusal
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.estimation.hypothesis import Hypothesis


def all_pruned(trials: Trials, current: CandidateModel, candidates: Sequence[CandidateModel]) -> list[CandidateModel]:
    """The candidates that meet no objection, and of the others what is left without the causes that do."""
    by_causes: dict[frozenset[Any], CandidateModel] = {}
    for kept in trials.each(lambda branch, t: pruned(branch, t, current.causes), candidates):
        if kept is not None:
            by_causes.setdefault(frozenset(kept.causes), kept)
    return list(by_causes.values())


def pruned(trials: Trials, candidate: CandidateModel, accepted: Sequence[Hypothesis]) -> CandidateModel | None:
    """The candidate without the causes that meet an objection, fitted again; None where none of its new ones is left."""
    for _ in range(len(candidate.causes) + 1):
        against = trials.objections(candidate, accepted)
        if not against:
            return candidate
        causes = tuple(candidate.causes[k] for k in against)
        trials.refused.append(Refusal(candidate, causes, tuple(against.values())))
        structure = candidate.fit.restarted
        for k in sorted(against, reverse=True):
            structure = structure.without(k)
        if set(structure.causes) <= set(accepted):
            return None
        fitted = trials.tried(structure, None, None)
        if not fitted:
            return None
        candidate = fitted[0]
    return None


def without_needless(trials: Trials, current: CandidateModel) -> CandidateModel:
    """The model without the causes that it does not need."""
    for k in reversed(range(len(current.causes))):
        for bare in trials.tried(current.fit.restarted.without(k), None):
            if not _needed(trials, bare, current) or trials.selection.within_model_form_error(bare, current, k):
                current = bare
    return current


def _needed(trials: Trials, bare: CandidateModel, current: CandidateModel) -> bool:
    """Whether `current` is worth its further cause. Where more than noise is left, what was chosen among many before need only
    keep its advantage, and matter beside the others that came later."""
    compare = trials.selection
    if current.errors.is_noise:
        return compare.improves_enough(bare, current)
    return (
        compare.advantage(current, bare) > 0
        and compare.matters(bare, current)
        and not compare.contradicted(bare, current)
    )

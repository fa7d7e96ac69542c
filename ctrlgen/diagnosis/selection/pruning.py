"""Causes taken out of a model: those that meet an objection, and those that it does not need.

A candidate is pruned, not discarded: a cause that meets an objection is begun again from its next start, and where each meets
one, the candidate is fitted again without it and compared again. What is refused is kept with its reason.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from ctrlgen.diagnosis.selection.attribution import as_fitted
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, Refusal
from ctrlgen.diagnosis.selection.failures import FAILURES
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.selection.verdict import contradicts_datasheet, moved_numbers
from ctrlgen.diagnosis.settings import MODEL_SELECTION, SEARCH
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis
from ctrlgen.estimation.structure import Structure


def all_pruned(
    trials: Trials, current: CandidateModel, candidates: Sequence[CandidateModel], screened: Screened | None = None
) -> list[CandidateModel]:
    """The candidates that meet no objection, and of the others what is left without the causes that do, each begun again from
    where else the screen saw it, unless it takes away far less than a candidate that meets none and is enough: its best start did."""
    by_causes: dict[frozenset[Any], CandidateModel] = {}
    starts = {} if screened is None else {s.hypothesis: (s.start, *s.other_starts) for s in screened.suspects}
    sound = [t for t in candidates if starts and not trials.objections(t, current.causes)]
    most = max(
        (_taken(t, current) for t in sound if trials.selection.improves_enough(current, t)),
        default=0.0,
    )

    def one(branch: Trials, t: CandidateModel) -> CandidateModel | None:
        begun = starts if _taken(t, current) >= SEARCH.rival_share * most else {}
        return pruned(branch, t, current.causes, begun, current)

    for kept in trials.each(one, candidates):
        if kept is not None:
            by_causes.setdefault(frozenset(kept.causes), kept)
    return list(by_causes.values())


def _taken(t: CandidateModel, before: CandidateModel) -> float:
    """What a candidate takes away of the squares beyond noise that the model `before` leaves on the records to fit."""
    return before.fitted.excess - t.fitted.excess


def pruned(
    trials: Trials,
    candidate: CandidateModel,
    accepted: Sequence[Hypothesis],
    starts: Mapping[Hypothesis, Sequence[dict[str, float]]] = MappingProxyType({}),
    before: CandidateModel | None = None,
) -> CandidateModel | None:
    """The candidate without the causes that meet an objection, fitted again; None where none of its new ones is left. Where it
    scores better than the model `before`, each is begun again first in its other `starts`."""
    for _ in range(len(candidate.causes) + 1):
        against = trials.objections(candidate, accepted)
        if not against:
            return candidate
        causes = tuple(candidate.causes[k] for k in against)
        trials.refused.append(Refusal(candidate, causes, tuple(against.values())))
        if before is not None and trials.selection.advantage(candidate, before) > 0:
            again = _begun_elsewhere(trials, candidate, against, accepted, starts, before)
            if again is not None:
                return again
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


def _begun_elsewhere(
    trials: Trials,
    candidate: CandidateModel,
    against: Collection[int],
    accepted: Sequence[Hypothesis],
    starts: Mapping[Hypothesis, Sequence[dict[str, float]]],
    before: CandidateModel,
) -> CandidateModel | None:
    """The candidate that meets no objection and is better than `before`, one of its causes `against` which there is something
    begun in its next starts; None where there is none. Those of one cause are taken in their order, as the screen saw them; of
    several causes the few that come nearest when they are simulated."""
    structure, begins = candidate.fit.restarted, list[tuple[float, Hypothesis, Structure]]()
    several = len(against) > 1
    for k in against:
        cause = candidate.causes[k]
        for start in other_valleys(cause, starts.get(cause, ())):
            try:
                begun = structure.restarted(k, start)
                begins.append((trials.fitter.rough_objective(begun) if several else 0.0, cause, begun))
            except FAILURES as error:
                trials.note_failure(cause, error)
    for _, cause, begun in sorted(begins, key=lambda b: b[0])[: SEARCH.restarts]:
        try:
            fit = trials.fitter.fit(begun, steps=SEARCH.candidate_steps, enough=before.fit.objective)
            again = trials.scored(begun, fit, candidate.cause)
            if trials.selection.advantage(again, before) > 0 and not trials.objections(again, accepted):
                trials.keep(again, SEARCH.candidate_steps)
                return again
        except FAILURES as error:
            trials.note_failure(cause, error)
    return None


def other_valleys(cause: Hypothesis, starts: Sequence[dict[str, float]]) -> list[dict[str, float]]:
    """The starts beside the first, one of each shape: a phase or the amplitude is found from any, another period is not."""
    if cause.effect == PARAMETER:
        return []
    shape = [p.name for p in cause.law.params if p.off is None and p.unit != "deg"]
    valleys: dict[tuple[float, ...], dict[str, float]] = {}
    for start in starts:
        valleys.setdefault(tuple(start[name] for name in shape), start)
    return list(valleys.values())[1 : 1 + SEARCH.restarts]


def without_needless(trials: Trials, current: CandidateModel) -> CandidateModel:
    """The model without the causes that it does not need."""
    for k in reversed(range(len(current.causes))):
        for bare in trials.tried(current.fit.restarted.without(k), None):
            feigned = trials.selection.within_model_form_error(bare, current, k) and not _far_worse(bare, current)
            if (not is_needed(trials, bare, current) or feigned) and not trials.objections(bare, bare.causes):
                current = bare
    return current


def is_needed(trials: Trials, bare: CandidateModel, current: CandidateModel) -> bool:
    """Whether `current` is worth its further cause. Where more than noise is left, what was chosen among many before need only
    keep its advantage, and matter beside the others that came later, or keep the device's numbers from bending to do its part."""
    compare = trials.selection
    if current.errors.is_noise:
        return compare.improves_enough(bare, current)
    return (
        compare.advantage(current, bare) > 0
        and (compare.matters(bare, current) or _bends_without(bare, current))
        and not compare.contradicted(bare, current)
    )


def _bends_without(bare: CandidateModel, current: CandidateModel) -> bool:
    """Whether numbers of the device lie far from its file without a cause, and none contradicts it with that one."""
    return bool(moved_numbers(bare.fit, MODEL_SELECTION.bent)) and not contradicts_datasheet(current.fit)


def _far_worse(bare: CandidateModel, current: CandidateModel) -> bool:
    """Whether `bare` leaves so much more than `current` in a channel of the held-out records that no model-form error is that."""
    left, was = bare.held_out.plain_mean, current.held_out.plain_mean
    return bool(np.any(left > MODEL_SELECTION.beyond_form_error * np.maximum(was, 1.0)))


def no_worse(trials: Trials, nominal: CandidateModel, current: CandidateModel) -> CandidateModel:
    """The model without the causes with which its numbers, as fitted, predict the held-out records worse than the device as
    described does; that device where nothing else is left."""
    allowed = MODEL_SELECTION.worse * held_out_energy(trials, nominal)
    # two squares a number: what its uncertainty adds
    while current.causes and held_out_energy(trials, current) > allowed + 2 * _numbers(current):
        fits = [trials.tried(current.fit.restarted.without(k), None) for k in range(len(current.causes))]
        fewer = [trials.converged(t) for fitted in fits for t in fitted if t.causes]
        current = min(fewer, key=lambda t: held_out_energy(trials, t)) if fewer else nominal
    return current


def held_out_energy(trials: Trials, candidate: CandidateModel) -> float:
    """Sum of the squares, over the noise's, that a model with its numbers as fitted leaves on the held-out records."""
    return float(
        np.nan_to_num(as_fitted(trials.fitter, candidate.fit, trials.fitter.held_out_records).plain.sum(), nan=np.inf)
    )


def _numbers(candidate: CandidateModel) -> int:
    return sum(u.cause is not None for u in candidate.fit.structure.free_parameters)

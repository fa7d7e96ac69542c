"""Shapes that the records to fit hardly tell and the held-out records do: fits begun again at other values of them.

A contact under a lasting load creeps at up to v_s. Where the records to fit never rest, bristles that creep do as well there as any
error of their form does, and foretell a stage that slips away wherever the held-out records rest. Such fits are therefore compared
by the criterion T, which counts both kinds of records, and not by the objective of the fit alone.
"""

from __future__ import annotations

from collections.abc import Collection
from math import sqrt

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.failures import FAILURES
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import MODEL_SELECTION, SEARCH
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis


def begun_again(trials: Trials, candidate: CandidateModel, known: Collection[Hypothesis] = ()) -> CandidateModel:
    """The candidate with its causes, but those `known`, begun again at the lower bound of each shape for which their law's prior says so
    (`ParameterPrior.again_at_low`) and half way there by its logarithm, where it explains better so."""
    for k, cause in enumerate(candidate.causes):
        if cause in known or cause.effect == PARAMETER or candidate.errors.is_noise:
            continue
        channel = cause.channel_on(candidate.fit.structure.device)
        for p in cause.law.params:
            if cause.prior.of(p).again_at_low:
                candidate = _better(trials, candidate, k, p.name, cause.bounds(p, channel)[0])
    return candidate


def _better(trials: Trials, candidate: CandidateModel, k: int, name: str, value: float) -> CandidateModel:
    """The candidate, or that begun with the number `name` of cause k at `value` [SI], or half way there, where T is better."""
    best, here = candidate, candidate.fit.values(k)
    if here[name] <= SEARCH.same_start * value:
        return candidate
    for start in (value, sqrt(value * here[name])):
        structure = candidate.fit.restarted.restarted(k, here | {name: start})
        try:
            t = trials.scored(structure, trials.fitter.fit(structure, steps=SEARCH.candidate_steps), candidate.cause)
        except FAILURES as error:
            trials.note_failure(candidate.cause, error)
            continue
        if trials.selection.advantage(t, best) > MODEL_SELECTION.tie:
            best = t
    if best is not candidate:
        # it fits no better, so that no later fit of the same causes would give it back
        trials.fitted[frozenset(best.causes)] = (best, SEARCH.candidate_steps)
    return best

"""The history of a search for the result file: its rounds, the models tried in each, and what was decided."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import Field

from ctrlgen.core.units import difference, from_si
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, Refusal, Round
from ctrlgen.diagnosis.selection.cause_entry import Cause, EffectAt
from ctrlgen.diagnosis.selection.not_taken import held_out_rms
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.estimation.fit import Fit
from ctrlgen.reporting.result_file import FiniteOrNull, Keys, Number


class TriedCause(EffectAt):
    """A cause that a candidate model adds."""

    z: Number = Field(description="Score of the screen [standard deviations]; null where it was not screened.")
    accepted: bool = Field(description="Whether it is in the model after the round.")


class NumberEntry(Keys):
    """A number with its unit."""

    value: FiniteOrNull = Field(description="Value [unit].")
    unit: str = Field(description="Unit; 1 without one.")


class ModelEntry(Keys):
    """A model that was fitted, by what it leaves."""

    criterion: FiniteOrNull = Field(description="Selection criterion T: smaller is better.")
    fitted: FiniteOrNull = Field(description="Mean square of the residual on the records to fit, over the noise's.")
    held_out: FiniteOrNull = Field(description="Mean square of the residual on the held-out records, over the noise's.")
    held_out_error: dict[str, NumberEntry] = Field(
        description="Root mean square error on the held-out records by channel."
    )


class NotTakenEntry(Keys):
    """A model that scores better than what its round took, and was not taken."""

    causes: list[Cause] = Field(description="The causes that speak against it.")
    reasons: list[str] = Field(description="What speaks against each.")
    numbers: dict[str, NumberEntry] = Field(description="Their numbers as fitted, '<effect>.<name>'.")
    gain: FiniteOrNull = Field(description="By how much its criterion T is better than that of what was taken.")
    held_out_error: dict[str, NumberEntry] = Field(
        description="Root mean square error on the held-out records by channel."
    )


class CandidateModelEntry(ModelEntry):
    """One model that was fitted in a round."""

    causes: list[TriedCause] = Field(description="Causes that it adds to the model before the round.")
    outcome: str = Field(description="'taken', or why it was not.")


class RoundEntry(Keys):
    """One round of the search."""

    round: int = Field(description="Its number, from 1.")
    threshold: FiniteOrNull = Field(
        description="|z| that a recording without mismatch exceeds anywhere with 1 % chance."
    )
    suspects: int = Field(description="Hypotheses screened.")
    before: ModelEntry = Field(description="The model before the round.")
    candidates: list[CandidateModelEntry] = Field(description="Models fitted, the best first.")
    not_taken: list[NotTakenEntry] = Field(
        description="Models that score better than what was taken, with the reason, first what would gain most."
    )
    failed: list[str] = Field(description="Trials that could not be built or simulated, with the reason.")
    causes_after: list[tuple[str, str]] = Field(description="[effect, location] of the causes after the round.")
    decision: str = Field(description="What was decided, and why.")


def search_history(search: SearchResult) -> list[RoundEntry]:
    """The rounds in order."""
    following = [*(r.before for r in search.rounds[1:]), search.chosen]
    return [
        RoundEntry(
            round=k,
            threshold=round_.screened.threshold,
            suspects=len(round_.screened.suspects),
            before=ModelEntry(**_left(search, round_.before, round_.criterion_before)),
            candidates=[
                _tried(search, t, T, round_, then) for t, T in zip(round_.candidates, round_.criteria, strict=True)
            ],
            not_taken=[not_taken_entry(search, r) for r in round_.refused if r.gain > 0],
            failed=list(map(str, round_.failed)),
            causes_after=[(c.effect, c.location) for c in then.causes],
            decision=_decision(round_, then),
        )
        for k, (round_, then) in enumerate(zip(search.rounds, following, strict=True), 1)
    ]


def not_taken_entry(search: SearchResult, refusal: Refusal) -> NotTakenEntry:
    """What the result file says of a refusal."""
    return NotTakenEntry(
        causes=[Cause.model_validate(c, from_attributes=True) for c in refusal.causes],
        reasons=list(refusal.reasons),
        numbers=_numbers(refusal),
        gain=refusal.gain,
        held_out_error=held_out_error(search, refusal.candidate),
    )


def _numbers(refusal: Refusal) -> dict[str, NumberEntry]:
    """The numbers as fitted of the causes that are refused."""
    fit = refusal.candidate.fit
    return {
        f"{cause.effect}.{name}": NumberEntry(value=value, unit=unit)
        for cause in refusal.causes
        if cause in fit.structure.causes
        for name, (value, unit) in numbers_of_cause(fit, fit.structure.causes.index(cause)).items()
    }


def numbers_of_cause(fit: Fit, k: int) -> dict[str, tuple[float, str]]:
    """The numbers of cause k as fitted, with their units, by name."""
    return {
        u.name: (float(from_si(value, u.unit)), u.unit)
        for u, value in zip(fit.structure.free_parameters, fit.theta, strict=True)
        if u.cause == k
    }


def held_out_error(search: SearchResult, candidate: CandidateModel) -> dict[str, NumberEntry]:
    """The held-out errors of a model by channel, in the reader's units."""
    recording = search.fitter.recording
    return {
        channel: NumberEntry(value=float(rms) * difference(1.0, unit), unit=unit)
        for channel, unit, rms in zip(recording.channels, recording.units, held_out_rms(candidate), strict=True)
    }


def _left(search: SearchResult, candidate: CandidateModel, criterion: float) -> dict[str, Any]:
    """The keys of a `ModelEntry`."""
    return {
        "criterion": criterion,
        "fitted": float(np.mean(candidate.fitted.plain_mean)),
        "held_out": float(np.mean(candidate.predicted.plain_mean)),
        "held_out_error": held_out_error(search, candidate),
    }


def _tried(
    search: SearchResult, trial: CandidateModel, criterion: float, round_: Round, then: CandidateModel
) -> CandidateModelEntry:
    """The causes that one candidate model adds, its criterion and what came of it."""
    z = {s.hypothesis: s.z for s in round_.screened.suspects}
    added = [c for c in trial.causes if c not in round_.before.causes]
    why = {frozenset(r.candidate.causes): r.reasons[0] for r in reversed(round_.refused)}
    return CandidateModelEntry(
        causes=[TriedCause(effect=c.effect, location=c.location, z=z.get(c), accepted=c in then.causes) for c in added],
        outcome=why.get(frozenset(trial.causes), "taken" if all(c in then.causes for c in added) else "replaced"),
        **_left(search, trial, criterion),
    )


def _decision(round_: Round, then: CandidateModel) -> str:
    """What a round changed, or why it changed nothing."""
    if not round_.candidates:
        return "no hypothesis exceeds the threshold: stopped"
    if beside := [f"{c.effect} at {c.location}" for c in round_.gone_on_beside]:
        return f"the held-out records refuse each candidate alone: searched on beside {', '.join(beside)}"
    before = round_.before.causes
    added = [f"added {c.effect} at {c.location}" for c in then.causes if c not in before]
    dropped = [f"dropped {c.effect} at {c.location}" for c in before if c not in then.causes]
    return ", ".join([*added, *dropped]) or "no candidate is confirmed by the held-out records: stopped"

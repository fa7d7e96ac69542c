"""The history of a search for the result file: its rounds, the models tried in each, and what was decided."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, Round
from ctrlgen.diagnosis.selection.cause_entry import EffectAt
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.reporting.result_file import FiniteOrNull, Keys, Number


class TriedCause(EffectAt):
    """A cause that a candidate model adds."""

    z: Number = Field(description="Score of the screen [standard deviations]; null where it was not screened.")
    accepted: bool = Field(description="Whether it is in the model after the round.")


class RefusedEntry(Keys):
    """A model that scores better than what was taken, and was not taken."""

    causes: list[EffectAt] = Field(description="The causes that speak against it.")
    reasons: list[str] = Field(description="What speaks against each.")


class CandidateModelEntry(Keys):
    """One model that was fitted in a round."""

    causes: list[TriedCause] = Field(description="Causes that it adds to the model before the round.")
    criterion: FiniteOrNull = Field(description="Selection criterion T: smaller is better.")
    fitted: FiniteOrNull = Field(description="Mean square of the residual on the records to fit, over the noise's.")
    held_out: FiniteOrNull = Field(description="Mean square of the residual on the held-out records, over the noise's.")


class RoundEntry(Keys):
    """One round of the search."""

    round: int = Field(description="Its number, from 1.")
    threshold: FiniteOrNull = Field(
        description="|z| that a recording without mismatch exceeds anywhere with 1 % chance."
    )
    suspects: int = Field(description="Hypotheses screened.")
    criterion_before: FiniteOrNull = Field(description="Selection criterion T of the model before the round.")
    candidates: list[CandidateModelEntry] = Field(description="Models fitted, the best first.")
    refused: list[RefusedEntry] = Field(description="Models that score better than what was taken, with the reason.")
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
            criterion_before=round_.criterion_before,
            candidates=[_tried(t, T, round_, then) for t, T in zip(round_.candidates, round_.criteria, strict=True)],
            refused=[
                RefusedEntry(
                    causes=[EffectAt.model_validate(c, from_attributes=True) for c in r.causes], reasons=list(r.reasons)
                )
                for r in round_.refused
            ],
            failed=list(round_.failed),
            causes_after=[(c.effect, c.location) for c in then.causes],
            decision=_decision(round_.before, then, bool(round_.candidates)),
        )
        for k, (round_, then) in enumerate(zip(search.rounds, following, strict=True), 1)
    ]


def _tried(trial: CandidateModel, criterion: float, round_: Round, then: CandidateModel) -> CandidateModelEntry:
    """The causes that one candidate model adds, and its criterion."""
    z = {s.hypothesis: s.z for s in round_.screened.suspects}
    return CandidateModelEntry(
        causes=[
            TriedCause(effect=c.effect, location=c.location, z=z.get(c), accepted=c in then.causes)
            for c in trial.causes
            if c not in round_.before.causes
        ],
        criterion=criterion,
        fitted=float(np.mean(trial.fitted.plain_mean)),
        held_out=float(np.mean(trial.held_out.plain_mean)),
    )


def _decision(before: CandidateModel, then: CandidateModel, tried: bool) -> str:
    """What a round changed, or why it changed nothing."""
    if not tried:
        return "no hypothesis exceeds the threshold: stopped"
    added = [f"added {c.effect} at {c.location}" for c in then.causes if c not in before.causes]
    dropped = [f"dropped {c.effect} at {c.location}" for c in before.causes if c not in then.causes]
    return ", ".join([*added, *dropped]) or "no candidate is confirmed by the held-out records: stopped"

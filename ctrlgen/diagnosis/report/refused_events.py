"""An event that is refused: when it would be, and which rows would confirm it.

The held-out records of another run say nothing of what happened once in this one: lost counts, something that was dropped on the stage.
"""

from __future__ import annotations

from ctrlgen.diagnosis.selection.candidate_model import Refusal
from ctrlgen.diagnosis.selection.model_selection import Shortfall
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.recordings.recording import Recording
from ctrlgen.reporting.numbers import number

ITS_OWN_FILE = "what happened once in one file shows in the later rows of that file: let these alone be held out, and diagnose again"


def moment_of(refusal: Refusal, cause: Hypothesis) -> str:
    """', at 31.4 s' of an event; empty of any other cause."""
    names = cause.prior.moments
    causes = refusal.candidate.fit.structure.causes
    if not names or cause not in causes:
        return ""
    values = refusal.candidate.fit.values(causes.index(cause))
    return f", at {number(values[names[0]])} s"


def how_confirmed(recording: Recording, refusal: Refusal) -> list[str]:
    """What would confirm an event that the held-out records do not, as they are of other files than those to fit; nothing otherwise."""
    files = {role: {r.file for r in recording.records if r.role == role} for role in ("fit", "hold_out")}
    refused = any(
        cause.prior.moments and reason == Shortfall.UNCONFIRMED
        for cause, reason in zip(refusal.causes, refusal.reasons, strict=True)
    )
    return [ITS_OWN_FILE] if refused and not files["fit"] & files["hold_out"] else []

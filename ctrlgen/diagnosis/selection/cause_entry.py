"""How a cause is named: in a sentence, and in the result file."""

from __future__ import annotations

from pydantic import Field

from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis
from ctrlgen.reporting.result_file import Keys


def cause_name(cause: Hypothesis) -> str:
    """'coupling at stage:x of y', or 'mechanism:radius differs from its nominal value'."""
    if cause.effect == PARAMETER:
        return f"{cause.location} differs from its nominal value"
    return f"{cause.effect} at {cause.location}" + (f" of {cause.of}" if cause.of else "")


def cause_noun(cause: Hypothesis) -> str:
    """'coupling at stage:x of y', or 'a wrong mechanism:radius': as a part of a sentence."""
    return f"a wrong {cause.location}" if cause.effect == PARAMETER else cause_name(cause)


def trying(*causes: Hypothesis) -> str:
    """The message of progress while `causes` are tried."""
    return "trying " + ", ".join(f"{c.effect} at {c.location}" for c in causes)


class EffectAt(Keys):
    """An effect at a location."""

    effect: str = Field(description="Name of the effect, or 'parameter'.")
    location: str = Field(description="Place and channel, such as actuator:2X.")


class Cause(EffectAt):
    """An effect at a location, with its partner."""

    of: str | None = Field(description="The other channel of an effect between two; null for others.")

"""How the result file names a cause."""

from __future__ import annotations

from pydantic import Field

from ctrlgen.reporting.result_file import Keys


class EffectAt(Keys):
    """An effect at a location."""

    effect: str = Field(description="Name of the effect, or 'parameter'.")
    location: str = Field(description="Place and channel, such as actuator:2X.")


class Cause(EffectAt):
    """An effect at a location, with its partner."""

    of: str | None = Field(description="The other channel of an effect between two; null for others.")

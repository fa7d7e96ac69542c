"""A [[recording_effect]] table of a device file: an effect that one recording had, and that no other run has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

from ctrlgen.effects._effect import Effect
from ctrlgen.effects._table import effect_schema, read_effect


@dataclass(frozen=True)
class RecordingEffect:
    """An `effect` of the recording with the title `recording` alone, such as a drift, whose clock began with its records."""

    recording: str
    effect: Effect

    @property
    def text(self) -> str:
        """'drift at axis, of the recording "Sweep"'."""
        return f'{self.effect.kind} at {self.effect.at}, of the recording "{self.recording}"'


def read_recording_effect(given: Any) -> RecordingEffect:
    """What a table describes. Raises ValueError naming everything that is wrong with it."""
    if isinstance(given, RecordingEffect):
        return given
    if not isinstance(given, dict):
        raise ValueError(
            "a recording effect is a table: [[recording_effect]] with recording, kind, at and its parameters"
        )
    title = given.get("recording")
    if not isinstance(title, str):
        raise ValueError(
            'recording is missing: the title of the recording that has the effect, such as recording = "Sweep"'
        )
    return RecordingEffect(title, read_effect({key: value for key, value in given.items() if key != "recording"}))


class _TableReader:
    """Tells pydantic how a [[recording_effect]] table becomes a `RecordingEffect`."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        def validate(given: Any) -> RecordingEffect:
            try:
                return read_recording_effect(given)
            except ValueError as error:
                raise PydanticCustomError("effect", "{message}", {"message": str(error)}) from error

        return core_schema.no_info_plain_validator_function(validate)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """An [[effect]] table and the title of the recording."""
        return effect_schema("recording_effect", recording={"type": "string"})


RecordingEffectTable = Annotated[RecordingEffect, _TableReader()]

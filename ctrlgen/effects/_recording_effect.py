"""A [[recording_effect]] table of a device file: an effect that one recording had, and that no other run has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from ctrlgen.effects._effect import Effect
from ctrlgen.effects._table import TableReader, read_effect


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


RecordingEffectTable = Annotated[
    RecordingEffect, TableReader(read_recording_effect, "recording_effect", before=("recording",))
]

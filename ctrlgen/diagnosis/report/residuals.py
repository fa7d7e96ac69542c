"""The held-out residuals that the figures of a diagnosis draw."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.recordings.recording import Record
from ctrlgen.reporting.plots import COLOURS

BEFORE, AFTER, NOISE = COLOURS[2], COLOURS[0], "#d9d9d9"
WIDTH = 8.6


class Residuals:
    """Held-out residuals of the nominal and of the chosen model, in the recording's units."""

    def __init__(self, diagnosis: Diagnosis) -> None:
        self.diagnosis, self.recording, fitter = diagnosis, diagnosis.recording, diagnosis.fitter
        self.records: list[Record] = fitter.held_out_records
        self.settled = self.recording.kind == "poses"
        search = diagnosis.search
        self.scales = [from_si(1.0, unit) - from_si(0.0, unit) for unit in self.recording.units]
        self.before, self.after = (
            [np.where(r.valid, r.observed - fitter.predict(trial.fit, r), np.nan) * self.scales for r in self.records]
            for trial in (search.nominal, search.chosen)
        )
        self.changed = bool(diagnosis.findings)

    def spans(self) -> Iterator[tuple[int, np.ndarray]]:
        """(record, its abscissa): seconds or poses, the records one after another."""
        first = 0.0
        for k, record in enumerate(self.records):
            n, step = len(record.time), 1.0 if self.settled else record.sample_time
            yield k, first + step * np.arange(n)
            first += step * n

    def floor(self, i: int) -> float | None:
        """Noise standard deviation of channel i in its unit, None where it is not known."""
        return self.diagnosis.held_out[self.recording.channels[i]].noise_floor

    def in_units(self, i: int, values: np.ndarray) -> np.ndarray:
        """Readings of channel i, in SI, in its unit."""
        return from_si(values, self.recording.units[i])

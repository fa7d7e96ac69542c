"""A delay of half a sample: a drive that is held between its samples, and was taken as linear, is late by that."""

from __future__ import annotations

from collections.abc import Sequence

from ctrlgen.core.units import to_si
from ctrlgen.diagnosis.report.narrative import interval
from ctrlgen.diagnosis.selection.findings import Finding
from ctrlgen.estimation.hypothesis import PARAMETER
from ctrlgen.recordings.recording import Recording

NEAR = 0.02
"""Of a sample: how near half of one a delay is that may be it, beside its interval. Judgement."""
HALF = (
    "a delay of {} is half a sample: so late is a drive that is held between its samples and read as linear; write "
    'between_samples = "held" in the recording if it is held'
)


def half_a_sample(recording: Recording, findings: Sequence[Finding]) -> list[str]:
    """What is told of delays that may be how the drive goes on between its samples: that are told from none and from a whole sample."""
    rates = {r.sample_time for r in recording.records if r.linear and r.role != "rest"}
    told = []
    for finding in findings:
        if finding.effect == PARAMETER or not finding.cause.law.moves_in_time or finding.cause.law.shifts_drive:
            continue
        late = finding.parameters[finding.cause.law.amplitude().name]
        low, high = (to_si(end, late.unit) for end in late.ci95)
        if any(0 < low - NEAR * h <= h / 2 <= high + NEAR * h < h for h in rates):
            told.append(HALF.format(interval(late)))
    return told

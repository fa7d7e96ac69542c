"""Recordings that a diagnosis could not hold in the memory of this machine are refused before any work."""

from __future__ import annotations

import os

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.recordings.recording import Recording

OF_A_READING = 6_000.0
"""Bytes that a diagnosis takes for each reading of each row: sensitivities to the numbers of the laws that are tried at once. Of 20,000
rows of six readings it takes 0.96 GB, 0.3 of them the program's own (`docs/evidence/processor_time.md`)."""


def physical_memory() -> float:
    """Bytes of the machine's memory; infinite where the system does not tell."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # Windows has no sysconf
        return float("inf")


def refuse_what_memory_cannot_hold(recording: Recording) -> None:
    """Raises InputError with the number of rows that this machine can hold."""
    rows, channels = sum(len(r.time) for r in recording.records), len(recording.channels)
    needed, there = OF_A_READING * rows * channels, physical_memory()
    if needed <= there:
        return
    held = int(there / OF_A_READING / channels)
    what = f"{rows} rows of {number_of(channels, 'reading')} would take about {needed / 1e9:.3g} GB in a diagnosis, and this machine"
    mend = f"at most {held} rows. `low_pass`, `keep_every` or `rows` make them fewer"
    raise InputError(recording.title, [Fault("record", f"{what} has {there / 1e9:.3g}: {mend}")])

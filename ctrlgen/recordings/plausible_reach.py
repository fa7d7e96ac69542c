"""Readings that lie further from all others than any device moves: a lost sign, another range of a counter, a broken transfer."""

from __future__ import annotations

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.units import from_si
from ctrlgen.model.model import Model
from ctrlgen.recordings.recording import Record, Recording
from ctrlgen.reporting.numbers import number

BEYOND = 1000.0
"""Times the device's own size from the median of a record: no motion of it, and no unit that is taken for another, in single rows."""


def reach_notes(recording: Recording, model: Model) -> list[str]:
    """A sentence for each reading of which single samples lie more than `BEYOND` times its typical size from the others.

    Samples that were marked as outliers count: they are not used, and still say that something is wrong with all of them.
    """
    said = []
    for i, (name, unit) in enumerate(zip(recording.channels, recording.units, strict=True)):
        role, _, channel = name.partition(".")
        if role not in ("reading", "pose"):
            continue
        size = float(model.signals[role].scale[model.signals[role].channels.index(channel)])
        found = [(record, *_beyond(record, i, size)) for record in recording.records]
        record, rows, far = max(found, key=lambda f: f[2], default=(None, [], 0.0))
        if record is None or not rows:
            continue
        reached, own = (number(abs(float(from_si(v, unit) - from_si(0.0, unit))), 3) for v in (far, size))
        where = f"{number_of(len(rows), 'sample')} of {record.name}, first at {record.time[rows[0]]:.6g} s"
        what = f"{name} lies {reached} {unit} from its other samples, {far / size:.3g} times the device's own size"
        said.append(f"{what} of {own} {unit}, in {where}: was a sign lost, or did a counter begin again?")
    return said


def _beyond(record: Record, i: int, size: float) -> tuple[list[int], float]:
    """The rows whose reading lies beyond, the marked ones among them, and how far [SI] the furthest does."""
    y = record.observed[:, i]
    known = y[np.isfinite(y)]
    away = np.abs(y - np.median(known)) if len(known) else np.zeros(len(y))
    for row, channel, height in record.spikes:
        if channel == i:
            away[row] = abs(height)
    rows = np.flatnonzero(away > BEYOND * size)
    return rows.tolist(), float(away[rows].max(initial=0.0))

"""Readings of a displacement beyond the ends of it that the device file states."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.recordings.moved import Moved
from ctrlgen.recordings.recording import Recording
from ctrlgen.reporting.numbers import number

BEYOND = 0.02
"""Of the range that is stated: a stage that is driven to its end rings, and a sensor's scale is off, by less. Judgement."""


def travel_notes(recording: Recording, seen: Moved) -> list[str]:
    """A sentence for each reading of a displacement itself that goes beyond the ends that the device file states for it."""
    said = []
    for i, (name, unit) in enumerate(zip(recording.channels, recording.units, strict=True)):
        read = [r.observed[r.valid[:, i], i] for r in recording.records]
        y = np.concatenate(read) if read else np.zeros(0)
        for low, high, what in _ends(seen, name) if len(y) else ():
            over = BEYOND * (
                high - low if np.isfinite(high - low) else max(abs(v) for v in (low, high) if np.isfinite(v))
            )
            if y.min() < low - over or y.max() > high + over:
                least, most, *ends = (number(float(from_si(v, unit)), 3) for v in (y.min(), y.max(), low, high))
                said.append(
                    f"{name} goes from {least} to {most} {unit}, beyond the {what} of {ends[0]} to {ends[1]} {unit} that the device file "
                    "states: is that right, and is the reading zero at home?"
                )
    return said


def _ends(seen: Moved, name: str) -> list[tuple[float, float, str]]:
    """The lowest and highest displacement [SI] that `name` reads by its limits, and their labels; none where it reads anything else."""
    model, (role, _, channel) = seen.bare, name.partition(".")
    if role not in model.signals or channel not in model.signals[role].channels:
        return []
    read = model.closed(model.signals[role].expr)[model.signals[role].channels.index(channel)]
    return [
        (*limit.bounds, limit.label)
        for limit in model.limits
        for bounded in ca.vertsplit(model.closed(limit.expr))
        if any(ca.is_equal(bounded, z) and ca.is_equal(read, z) for z in ca.vertsplit(model.z))
    ]

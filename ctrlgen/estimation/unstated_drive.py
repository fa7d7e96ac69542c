"""A drive of which nobody states whether it is held or linear between its samples: what the readings fit.

A smooth drive does not tell. Read wrongly it is late, or early, by half a sample, which is a law of the library and no physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.estimation.described_device import described
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER
from ctrlgen.recordings.recording import Record, Recording
from ctrlgen.reporting.numbers import number

BETTER, SAME = 1e-3, 1e-2
"""Shares of the squares of what is left: less, and it makes no difference how the drive is read; by which two readings of it may differ
where one of them needs a law less. Judgement."""
TAKEN = (
    "whether the drive is held or linear between its samples is not stated: {} is taken, with which the device as described leaves {} "
    "times the noise in the records to fit, and {} times with the other; write between_samples if you know it"
)
TURNED = (
    "whether the drive is held or linear between its samples is not stated: {} is taken, because with the other the answer needed another "
    "law, or left more; write between_samples if you know it"
)


def is_open(recording: Recording) -> bool:
    """Whether a record is moved of which nobody states how its drive goes on between samples."""
    return any(r.either and r.role != "rest" for r in recording.records)


def read_as(recording: Recording, linear: bool) -> Recording:
    """The recording with every drive that may be either read as linear, or as held."""
    records = (replace(r, linear=linear) if r.either else r for r in recording.records)
    return replace(recording, records=tuple(records))


def turned(recording: Recording, read: Recording) -> Recording:
    """The `recording` read the other way than `read` is, for good, with a note that says so."""
    linear = not any(r.linear for r in read.records if r.either)
    records = (replace(r, linear=linear, either=False) if r.either else r for r in recording.records)
    return replace(recording, records=tuple(records), notes=(*recording.notes, TURNED.format(_way(linear))))


def as_described_fits(device: Device, fitter: Fitter) -> Fitter:
    """The fitter with such drives read as the device as described fits the readings better, and a note of it; as linear where that makes
    no difference."""
    if not is_open(fitter.recording):
        return fitter
    ways = {linear: replace(fitter, recording=read_as(fitter.recording, linear)) for linear in (True, False)}
    left = {linear: _left(*described(way, device)) for linear, way in ways.items()}
    if not left[False] < (1 - BETTER) * left[True] and not left[True] < (1 - BETTER) * left[False]:
        return ways[True]
    linear = left[True] < left[False]
    note = TAKEN.format(_way(linear), *(number(np.sqrt(left[way])) for way in (linear, not linear)))
    chosen = ways[linear]
    return replace(chosen, recording=replace(chosen.recording, notes=(*chosen.recording.notes, note)))


def fits_the_other_way(fitter: Fitter, fit: Fit) -> bool:
    """Whether a fitted model with such drives read the other way leaves less, or as little without a law by which a reading is late."""
    if not is_open(fitter.recording):
        return False
    linear = any(r.linear for r in fitter.recording.records if r.either)
    other = replace(fitter, recording=read_as(fitter.recording, not linear))
    plain, most = fit.restarted, 1 - SAME
    for k in reversed(range(len(plain.causes))):
        if plain.causes[k].effect != PARAMETER and plain.causes[k].law.moves_in_time:
            plain, most = plain.without(k), 1 + SAME
    return _left(other, other.fit(plain)) < most * _left(fitter, fit)


def _left(fitter: Fitter, fit: Fit) -> float:
    """Mean squares of what a fit leaves of such records, in those of the noise."""
    records: Sequence[Record] = [r for r in fitter.fit_records if r.either]
    squares = [((r.observed - fitter.predict(fit, r)) / fitter.noise.floor)[r.valid] ** 2 for r in records]
    return float(np.mean(np.concatenate(squares)))


def _way(linear: bool) -> str:
    return "linear" if linear else "held"

"""A drive of which nobody states what it does between its samples: held, in straight lines or a smooth curve, as the readings have it.

A slow drive does not tell. One that is read wrongly is late, or early, by half a sample, or, where lines are taken for a curve, too weak
by (w h)^2 / 12 at a frequency w: laws of the library, such as a reading that picks up -h^2 F / (12 m) of a force F, and no physics.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from operator import itemgetter

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.estimation.described_device import described
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record, Recording
from ctrlgen.reporting.numbers import number

LINEAR, SMOOTH, HELD = WAYS = ("linear", "smooth", "held")
BETTER, SAME = 1e-3, 1e-2
"""Shares of the squares of what is left: less, and it makes no difference how the drive is read; by which two readings of it may differ
where one of them needs a law less. Judgement."""
TAKEN = (
    "what the drive does between its samples is not stated: {} is taken, with which the answer leaves {} times the noise in the records to "
    "fit, and {}; write between_samples if you know it"
)


def is_open(recording: Recording) -> bool:
    """Whether there is a record to fit of which nobody states how its drive goes on between samples."""
    return any(r.either and r.role == "fit" for r in recording.records)


def way_of(recording: Recording) -> str:
    """The one of `WAYS` in which such drives of a recording are read."""
    r = next(r for r in recording.records if r.either)
    return SMOOTH if r.smooth else LINEAR if r.linear else HELD


def read_as(recording: Recording, way: str) -> Recording:
    """The recording with every drive that may be either read in one of `WAYS`."""

    def read(r: Record) -> Record:
        return replace(r, linear=way != HELD, smooth=way == SMOOTH) if r.either else r

    return replace(recording, records=tuple(map(read, recording.records)))


def as_described_fits(device: Device, fitter: Fitter) -> Fitter:
    """The fitter with such drives read as the device as described fits the readings best; as linear where that makes no difference, and
    as those of the records to fit where these are all stated alike."""
    if not is_open(fitter.recording):
        return _as_those_to_fit(fitter)
    ways = {way: replace(fitter, recording=read_as(fitter.recording, way)) for way in WAYS}
    left = {way: _left(*described(read, device)) for way, read in ways.items()}
    best = min(WAYS, key=left.__getitem__)
    return ways[best if left[best] < (1 - BETTER) * left[LINEAR] else LINEAR]


def _as_those_to_fit(fitter: Fitter) -> Fitter:
    stated = {r.linear for r in fitter.recording.records if r.role == "fit"}
    if len(stated) != 1 or not any(r.either for r in fitter.recording.records):
        return fitter
    return replace(fitter, recording=read_as(fitter.recording, LINEAR if stated.pop() else HELD))


def read_better(fitter: Fitter, fit: Fit) -> Fitter:
    """The fitter with such drives read as a fitted model leaves clearly least, its numbers fitted again; as given where none does so."""
    if not is_open(fitter.recording):
        return fitter
    left, best = min(_left_in_other_ways(fitter, fit.restarted), key=itemgetter(0))
    return best if left < (1 - SAME) * _left(fitter, fit) else fitter


def read_with_less(fitter: Fitter, fit: Fit) -> Fitter:
    """The fitter with such drives read as a fitted model leaves as little without a law by which a reading is late, or without any one law
    that it needs as they are read now; otherwise as it leaves clearly less; as given where none does so."""
    if not is_open(fitter.recording):
        return fitter
    now, others = _left(fitter, fit), _left_in_other_ways(fitter, fit.restarted)
    left, best = min(others, key=itemgetter(0))
    enough = (1 + SAME) * min(now, left)
    ways = [other for at_least, other in others if at_least < enough]  # with a law less no less is left
    simpler = []
    for plain, timed in _with_less(fit.restarted) if ways else ():
        most = enough if timed else min(enough, (1 - SAME) * _left(fitter, fitter.fit(plain)))
        simpler += [found for other in ways if (found := (_left(other, other.fit(plain)), other))[0] < most]
    if simpler:
        return min(simpler, key=itemgetter(0))[1]
    return best if left < (1 - SAME) * now else fitter


def _left_in_other_ways(fitter: Fitter, structure: Structure) -> list[tuple[float, Fitter]]:
    """What a structure leaves, fitted with such drives read in each other way."""
    return [(_left(other, other.fit(structure)), other) for other in _other_ways(fitter)]


def _other_ways(fitter: Fitter) -> list[Fitter]:
    now = way_of(fitter.recording)
    return [replace(fitter, recording=read_as(fitter.recording, way)) for way in WAYS if way != now]


def _with_less(structure: Structure) -> Iterator[tuple[Structure, bool]]:
    """The structure without all laws of timing, and without any other one of its laws; and whether it is the first."""
    timed = [k for k, c in enumerate(structure.causes) if c.effect != PARAMETER and c.law.moves_in_time]
    if timed:
        plain = structure
        for k in reversed(timed):
            plain = plain.without(k)
        yield plain, True
    for k in range(len(structure.causes)):
        if k not in timed:
            yield structure.without(k), False


def told_of_reading(fitter: Fitter, fit: Fit) -> list[str]:
    """In which way such drives are read, with what a fitted model leaves in each; nothing where all is stated."""
    if not is_open(fitter.recording):
        return []
    others = [
        f"{number(np.sqrt(_left(other, fit)))} times with {way_of(other.recording)}" for other in _other_ways(fitter)
    ]
    return [TAKEN.format(way_of(fitter.recording), number(np.sqrt(_left(fitter, fit))), " and ".join(others))]


def _left(fitter: Fitter, fit: Fit) -> float:
    """Mean squares of what a fit leaves of such records, in those of the noise."""
    records = [r for r in fitter.fit_records if r.either]
    squares = [((r.observed - fitter.predict(fit, r)) / fitter.noise.floor)[r.valid] ** 2 for r in records]
    return float(np.mean(np.concatenate(squares)))

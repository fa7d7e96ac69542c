"""How far the records go along what a law repeats with, and the longest period of which they can show that it repeats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.devices import Device, ImposedPhysics
from ctrlgen.diagnosis.settings import OBJECTIONS
from ctrlgen.effects import Place
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, nominal_physics
from ctrlgen.recordings.recording import Recording


def way_covered(recording: Recording, cause: Hypothesis, device: Device) -> float:
    """How far the reading, or the axis, of a cause that repeats along it goes in the records to fit [SI]; no end where none is read."""
    records = [r for r in recording.records if r.role == "fit"]
    channel = f"reading.{cause.at}"
    if cause.law.place is Place.FORCE and isinstance(nominal_physics(device), ImposedPhysics):
        place = cause.acts_on(device)[0]
        return float(max(np.ptp(r.drive[:, place]) for r in records))
    if channel not in recording.channels:
        return np.inf
    i = recording.channels.index(channel)
    read = np.concatenate([r.observed[r.valid[:, i], i] for r in records])
    return float(np.ptp(read)) if len(read) else np.inf


def where_it_turns(suspected: Sequence[Hypothesis], recording: Recording, device: Device) -> list[Hypothesis]:
    """The hypotheses without laws that repeat once a turn of readings that go through too little of one."""
    least = 2 * np.pi * OBJECTIONS.least_turn

    return [h for h in suspected if not h.prior.once_a_turn or way_covered(recording, h, device) >= least]


def with_longest_periods(suspected: Sequence[Hypothesis], recording: Recording, device: Device) -> list[Hypothesis]:
    """The hypotheses, those of laws that repeat along a way with the longest period that is seen to repeat: one that is shorter grows into
    no longer one while other causes come and go, as it would where two causes nearly make up for one another."""

    def told(h: Hypothesis) -> Hypothesis:
        if h.effect == PARAMETER or not h.prior.is_pitch:
            return h
        return replace(h, longest_period=way_covered(recording, h, device) / OBJECTIONS.fewest_pitches)

    return [told(h) for h in suspected]


def both_ways(drives: Sequence[np.ndarray]) -> bool:
    """Whether any column of the drives (n, n_u) rises and falls, in one record or in two, by more than one that stands still changes."""
    span = np.ptp(np.concatenate(drives), axis=0)
    falls = np.max([np.max(np.maximum.accumulate(u) - u, axis=0) for u in drives], axis=0)
    rises = np.max([np.max(u - np.minimum.accumulate(u), axis=0) for u in drives], axis=0)
    return bool(np.any(np.minimum(falls, rises) > OBJECTIONS.standing * span))


def moves_one_way(recording: Recording, device: Device) -> bool:
    """Whether every axis whose motion is imposed goes one way alone in all records: its dry friction is a constant then."""
    physics = nominal_physics(device)
    if recording.kind != "series" or not isinstance(physics, ImposedPhysics):
        return False
    axes = len(physics.axes)
    return not both_ways([r.drive[:, :axes] for r in recording.records if r.role != "rest"])

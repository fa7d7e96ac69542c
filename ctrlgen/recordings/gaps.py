"""Rows that are missing in a series: the drive is bridged across them where it is known, else the record ends and another begins.

A gap is no new experiment: a device that remembers goes on remembering. What is bridged are rows of the drive alone; a reading is
never filled in. Where recording.toml does not say what the drive did, it must tell itself: it steps, and stands at one value on both
sides or steps by a clock, or trials in rows that are there show that a straight line, or a drive as smooth as around, is right.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np
from threadpoolctl import threadpool_limits

from ctrlgen.recordings import drive_across_gaps
from ctrlgen.recordings.drive_across_gaps import Way
from ctrlgen.recordings.preprocessing import WHOLE_SAMPLES
from ctrlgen.recordings.recording import Record

Gap = Literal["linear", "held", "split"]

SHORTEST = {"series": 20, "poses": 3}  # rows below which a record says nothing
BREAK = 1.5  # sample times without a sample: a gap
LONGEST = 100  # rows of a gap that is bridged unasked
RIGHT = 2e-3  # of the drive's range: how far off a bridge may be that nobody asked for
# Rows in all of which a bridge of a device without inertia may be that far off, and farther in fewer: what it leaves in a memory grows
# with how long it lasts, and a mass alone is kicked by the least.
BRIEF = 5
REST_SAMPLES = 5  # on each side of a gap, over which the drive must be at rest
STEPPED = 0.5  # of the samples around differ from the one before, at most, where a drive steps
# steps that tell the clock of a drive that steps: a chance divisor of so many distances is one in thirty
FEWEST_STEPS = 6
DWELLS = 4.0  # times a gap in the usual time between steps, from which on two equal sides have no step between
AROUND = 50  # rows on each side that tell how much a drive changes in as many rows as a gap has
USUAL = 3.0  # times that change, beyond which a drive jumped inside of the gap
TOLD = 1e-6  # of the drive's range: how far off a bridge must be for a note to say so
LISTED_CUTS = 5  # places at which a record was cut that a note names


def bridged(record: Record, gap: Gap | None, inertial: bool = True) -> tuple[Record, list[str]]:
    """The record with the rows that it lacks, their readings not valid, and their drive as `gap` says or, unasked, as each drive tells;
    gaps that cannot be bridged stay as they were. A note on how many were, and the longest."""
    whole, kept = _on_its_grid(record)
    known = np.isfinite(whole.drive).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], known, [True]]).astype(int))).reshape(-1, 2)
    inside = [(a, b) for a, b in edges.tolist() if a > 0 and b < len(known)]
    drives = [_Drive(u, inertial) for u in whole.drive.T] if inside else []
    drive, valid, sizes = whole.drive.copy(), whole.valid.copy(), []
    for a, b in inside:
        if b - a > (known.sum() if gap else LONGEST):
            continue
        told = [drive_across_gaps.across(d.u, a, b, gap) if gap and gap != "split" else d.across(a, b) for d in drives]
        values = [v for v in told if v is not None]
        if len(values) < len(drives):
            continue
        drive[a:b] = np.where(np.isfinite(drive[a:b]), drive[a:b], np.column_stack(values))
        valid[a:b] = False
        kept[a:b] = True
        sizes.append(b - a)
    if not sizes:
        return record, []
    ways = [gap] if gap else sorted({way for d in drives for way in d.ways})
    off = max(d.off for d in drives)
    right = f" (within {100 * off:.1g} % of its range, by trials)" if off > TOLD else ""
    count = (
        f"{len(sizes)} gaps, the longest of {max(sizes)} samples, are"
        if len(sizes) > 1
        else f"a gap of {sizes[0]} samples is"
    )
    note = (
        f"{record.name}: {count} bridged, {sum(sizes)} samples in all: the drive is taken as {' or '.join(map(str, ways))} there{right}; "
        "readings of theirs are not used."
    )
    observed = np.where(valid, whole.observed, np.nan)
    return rows_of(replace(whole, drive=drive, valid=valid, observed=observed), kept), [note]


class _Drive:
    """One drive (n,), NaN where it is not known, and what it tells of its gaps: `ways` that it was taken across them, and `off`, the
    largest error in trials of those [range of the drive]."""

    def __init__(self, u: np.ndarray, inertial: bool) -> None:
        self.u = u
        self.brief = 1 if inertial else BRIEF
        self.ways: set[Way] = set()
        self.off = 0.0
        self.span = float(np.nanmax(u) - np.nanmin(u))
        change = np.diff(u) != 0
        pairs = np.isfinite(u[1:]) & np.isfinite(u[:-1])
        self.moves = np.where(pairs, change, np.nan)
        alone = pairs[1:-1] & change[1:-1] & ~change[:-2] & ~change[2:]
        steps = np.flatnonzero(alone) + 2
        self.step = int(steps[0]) if len(steps) else 0
        self.clock = int(np.gcd.reduce(np.diff(steps))) if len(steps) > FEWEST_STEPS else 1
        self.dwell = float(np.median(np.diff(steps))) if len(steps) > 1 else len(u)

    def across(self, a: int, b: int) -> np.ndarray | None:
        """The drive (b - a,) in rows a to b, half open; None where it does not tell."""
        around = self.moves[max(a - AROUND, 0) : b + AROUND]
        stepped = np.nanmean(around) <= STEPPED if np.isfinite(around).any() else False
        return self._held(a, b) if stepped else self._as_elsewhere(a, b)

    def _held(self, a: int, b: int) -> np.ndarray | None:
        """A drive that mostly stands still: at the one value of both sides, or from one to the other where its clock strikes once."""
        before, after, length = self.u[a - 1], self.u[b], b - a
        strikes = [k for k in range(a, b + 1) if (k - self.step) % self.clock == 0] if self.clock > 1 else []
        if before == after and (length <= self.dwell / DWELLS or (self.clock > 1 and len(strikes) <= 1)):
            self.ways.add("held")
            return np.full(length, before)
        if len(strikes) == 1 and before != after:
            self.ways.add("held")
            return np.where(np.arange(a, b) < strikes[0], before, after)
        return None

    def _as_elsewhere(self, a: int, b: int) -> np.ndarray | None:
        """A drive that moves: linear or smooth, whichever is right in trials around."""
        ways: tuple[Way, ...] = ("linear", "smooth")
        errors = {way: drive_across_gaps.error(self.u, a, b, way) for way in ways}
        values = {way: drive_across_gaps.across(self.u, a, b, way) for way in ways}
        best = min(ways, key=lambda way: errors[way])
        # beside a step, what is smooth elsewhere goes astray
        apart = float(np.abs(values["smooth"] - values["linear"]).max())
        if apart > (USUAL * errors["linear"] + RIGHT) * self.span:
            best = "linear"
        if errors[best] > RIGHT * max(self.brief / (b - a), 1.0) or self._jumps(a, b):
            return None
        self.ways.add(best)
        self.off = max(self.off, errors[best])
        return values[best]

    def _jumps(self, a: int, b: int) -> bool:
        """Whether it changes more across rows a to b than around in as many rows."""
        apart = b - a + 1
        sides = (self.u[max(a - AROUND - apart, 0) : a], self.u[b : b + AROUND + apart])
        near = np.concatenate([np.abs(side[apart:] - side[:-apart]) for side in sides])
        usual = np.max(near[np.isfinite(near)], initial=0.0)
        return bool(abs(self.u[b] - self.u[a - 1]) > USUAL * usual)


def _on_its_grid(record: Record) -> tuple[Record, np.ndarray]:
    """The record with a row without numbers for every sample that is missing in time, where a gap is a whole number of samples and not
    longer than the record; and which rows (n,) it had."""
    steps = np.diff(record.time) / record.sample_time
    missing = np.where(steps > BREAK, np.round(steps) - 1, 0).astype(int)
    missing[(np.abs(steps - np.round(steps)) > WHOLE_SAMPLES) | (missing > len(record.time))] = 0
    if not missing.any():
        return record, np.ones(len(record.time), bool)
    places = np.arange(len(record.time)) + np.concatenate([[0], np.cumsum(missing)])
    n = int(places[-1]) + 1
    drive, observed = np.full((n, record.drive.shape[1]), np.nan), np.full((n, record.observed.shape[1]), np.nan)
    drive[places], observed[places] = record.drive, record.observed
    valid, there, rows = np.zeros((n, record.valid.shape[1]), bool), np.zeros(n, bool), np.arange(n)
    valid[places], there[places] = record.valid, True
    ambient = None if record.ambient is None else np.interp(rows, places, record.ambient)
    time = np.interp(rows, places, record.time)
    return replace(record, time=time, drive=drive, observed=observed, valid=valid, ambient=ambient), there


def rows_of(record: Record, kept: np.ndarray) -> Record:
    """The rows `kept` (n,) bool of a record."""
    ambient = None if record.ambient is None else record.ambient[kept]
    time, drive, observed, valid = (v[kept] for v in (record.time, record.drive, record.observed, record.valid))
    return replace(record, time=time, drive=drive, observed=observed, valid=valid, ambient=ambient)


def stretches(record: Record, gap: Gap | None = None, inertial: bool = True) -> tuple[list[Record], list[str]]:
    """The record with short gaps bridged, cut at the others in time and where a drive is missing, and joined across one in which the
    drive rests; and a note on what was done. `gap` says what the drive does in all of them; a device that is not `inertial` follows a
    drive at once, and a bridge may be rougher the shorter it is."""
    # one thread: the matrices are small
    with threadpool_limits(1):
        record, bridged_notes = (record, []) if gap == "split" else bridged(record, gap, inertial)
    known = np.isfinite(record.drive).all(1)
    breaks = (np.flatnonzero(np.diff(record.time) > BREAK * record.sample_time) + 1).tolist()
    edges = np.flatnonzero(np.diff(np.r_[False, known, False].astype(int)))
    bounds = [(a, b) for a, b in edges.reshape(-1, 2).tolist()]
    cuts = [(a, b) for low, high in bounds for a, b in _split(low, high, breaks)]
    if len(cuts) == 1 and cuts[0] == (0, len(known)):
        return [record], bridged_notes
    notes = bridged_notes
    parts: list[Record] = []
    for a, b in cuts:
        stretch = rows_between(record, a, b)
        joined = _joined(parts[-1], stretch) if parts and gap != "split" else None
        if joined:
            missing = len(joined.time) - len(parts[-1].time) - len(stretch.time)
            after = f"{parts[-1].time[-1]:.6g} s"
            notes.append(
                f"{record.name}: {missing} samples are missing after {after} while the drive rests; marked, not used."
            )
            parts[-1] = joined
        else:
            parts.append(stretch)
    kept = [stretch for stretch in parts if len(stretch.time) >= SHORTEST["series"]]
    dropped = sum(len(stretch.time) for stretch in parts) - sum(len(stretch.time) for stretch in kept)
    if not notes[len(bridged_notes) :] and len(parts) == 1:
        count = len(known) - len(parts[0].time)
        notes.append(
            f"{record.name}: a drive is missing in {count} samples at its beginning or end; they are left out."
        )
    if len(parts) > 1:
        more = ", ..." if len(parts) > LISTED_CUTS + 1 else ""
        at = ", ".join(f"{stretch.time[0]:.6g} s" for stretch in parts[1 : LISTED_CUTS + 1]) + more
        notes.append(
            f"{record.name}: the drive is not known across gaps, so the record is used as {len(kept)} records, cut before {at}"
            + (f"; {dropped} samples in stretches shorter than {SHORTEST['series']} are left out." if dropped else ".")
        )
        kept = [replace(stretch, name=f"{stretch.name} from {stretch.time[0]:.6g} s") for stretch in kept]
    return kept, notes


def _split(a: int, b: int, breaks: list[int]) -> list[tuple[int, int]]:
    """The half-open range a to b cut at the `breaks` inside it."""
    edges = [a, *(k for k in breaks if a < k < b), b]
    return list(pairwise(edges))


def rows_between(record: Record, a: int, b: int) -> Record:
    """Rows a to b, half open, of a record."""
    ambient = None if record.ambient is None else record.ambient[a:b]
    return replace(
        record,
        time=record.time[a:b],
        drive=record.drive[a:b],
        observed=record.observed[a:b],
        valid=record.valid[a:b],
        ambient=ambient,
        spikes=tuple((k - a, i, size) for k, i, size in record.spikes if a <= k < b),
        held=tuple((max(j - a, 0), min(k, b) - a, i) for j, k, i in record.held if j < b and a < k),
    )


def _joined(before: Record, after: Record) -> Record | None:
    """Both records with rows marked not valid between; None unless the drive rests on both sides at the same values and the
    gap is a whole number of samples, no more than the shorter of the two records has."""
    around = np.vstack([before.drive[-REST_SAMPLES:], after.drive[:REST_SAMPLES]])
    steps = (after.time[0] - before.time[-1]) / before.sample_time
    missing = round(steps) - 1
    shortest = min(len(before.time), len(after.time))
    moves = len(around) < 2 * REST_SAMPLES or (around != around[0]).any()
    if moves or abs(steps - round(steps)) > WHOLE_SAMPLES or missing > shortest:
        return None
    time = before.time[-1] + before.sample_time * np.arange(1, missing + 1)
    blank = np.full((missing, before.observed.shape[1]), np.nan)
    ambient = None
    if before.ambient is not None and after.ambient is not None:
        between = np.interp(time, [before.time[-1], after.time[0]], [before.ambient[-1], after.ambient[0]])
        ambient = np.r_[before.ambient, between, after.ambient]
    return replace(
        before,
        time=np.r_[before.time, time, after.time],
        drive=np.vstack([before.drive, np.tile(around[0], (missing, 1)), after.drive]),
        observed=np.vstack([before.observed, blank, after.observed]),
        valid=np.vstack([before.valid, np.zeros(blank.shape, dtype=bool), after.valid]),
        ambient=ambient,
    )

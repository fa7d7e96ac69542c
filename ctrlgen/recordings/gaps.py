"""Rows that are missing in a series: the drive is bridged across them where it is known, else the record ends and another begins.

A gap is no new experiment: a device that remembers goes on remembering. What is bridged are rows of the drive alone; a reading is
never filled in. Where recording.toml does not say what the drive did, it tells itself (`bridges`), and how right that is. What matters is
what an error of it does to the readings after the gap (`after_gaps`): those that it changes by more than a fraction of their noise carry
no weight; where these would be too many, or the drive is not known at all, the record ends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
from threadpoolctl import threadpool_limits

from ctrlgen.core.counts import number_of
from ctrlgen.recordings import drive_across_gaps
from ctrlgen.recordings.after_gaps import FRACTION, Described
from ctrlgen.recordings.after_gaps import Gap as AfterGap
from ctrlgen.recordings.bridges import Bridge, DriveWithGaps
from ctrlgen.recordings.preprocessing import WHOLE_SAMPLES
from ctrlgen.recordings.recording import Record
from ctrlgen.recordings.usual_step import BREAK

Gap = Literal["linear", "held", "split"]

SHORTEST = {"series": 20, "poses": 3}  # rows below which a record says nothing
LONGEST = 100  # rows of a gap that is bridged unasked
# of a drive's range: a bridge that may be farther off has lost where the drive turned, and what remembers it is known to no twentieth
LOST = 0.05
DEAREST = (
    0.2  # of a record's rows whose readings gaps may cost behind them: beyond it a memory that is begun anew is cheaper
)
REST_SAMPLES = 5  # on each side of a gap, over which the drive must be at rest
TOLD = 1e-6  # of the drive's range: how far off a bridge must be for a note to say so
LISTED_CUTS = 5  # places at which a record was cut that a note names


@dataclass(frozen=True)
class _Bridged:
    """A gap of rows `a` to `b`, half open, and how each drive is taken there."""

    a: int
    b: int
    bridges: tuple[Bridge, ...]

    @property
    def off(self) -> np.ndarray:
        """How far each drive (n_u,) may be off [its range]."""
        return np.array([bridge.off for bridge in self.bridges])

    def into(self, drive: np.ndarray) -> None:
        """Writes the drives that are missing into `drive` (n, n_u)."""
        rows = drive[self.a : self.b]
        rows[:] = np.where(np.isfinite(rows), rows, np.column_stack([bridge.values for bridge in self.bridges]))


def bridged(record: Record, gap: Gap | None, device: Described | None = None) -> tuple[Record, list[str]]:
    """The record with the rows that it lacks and their drive as `gap` says or, unasked, as each drive tells, their readings not valid then;
    gaps that cannot be bridged stay as they were. Readings after a gap that the `device` as described says are still wrong are not valid
    either. A note on how many were bridged, the longest, and what that leaves."""
    whole, kept = _on_its_grid(record)
    known = np.isfinite(whole.drive).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], known, [True]]).astype(int))).reshape(-1, 2)
    inside = [(a, b) for a, b in edges.tolist() if a > 0 and b < len(known)]
    drives = [DriveWithGaps(u) for u in whole.drive.T] if inside else []
    told: list[_Bridged] = []
    for a, b in inside:
        if b - a > (known.sum() if gap else LONGEST):
            continue
        if gap and gap != "split":
            bridges = [Bridge(drive_across_gaps.across(d.u, a, b, gap), 0.0, gap) for d in drives]
        else:
            bridges = [d.across(a, b) for d in drives]
        if all(bridge.off <= LOST for bridge in bridges):
            told.append(_Bridged(a, b, tuple(bridges)))
    drive, valid = whole.drive.copy(), whole.valid.copy()
    for each in told:
        each.into(drive)
    told, wrong = _followed(replace(whole, drive=drive), told, device)
    if not told:
        return record, []
    drive = whole.drive.copy()
    for each in told:
        each.into(drive)
        valid[each.a : each.b] &= gap is not None  # a drive that is stated there is known there
        kept[each.a : each.b] = True
    after = int((wrong & valid).any(axis=1).sum())
    valid &= ~wrong
    observed = np.where(valid, whole.observed, np.nan)
    return rows_of(replace(whole, drive=drive, valid=valid, observed=observed), kept), [
        _note(record.name, told, after, valid)
    ]


def _followed(record: Record, told: list[_Bridged], device: Described | None) -> tuple[list[_Bridged], np.ndarray]:
    """Of the gaps that the drives of a bridged record tell those after which few enough readings are wrong, the cheapest first; and which
    readings (n, n_y) are."""
    squares = np.zeros(record.observed.shape)
    if device is None or not told:
        return told, squares > 0
    # gaps that stay open are at any value: only differences are taken
    record = replace(record, drive=_without_nan(record.drive))
    spans = np.ptp(record.drive, axis=0)
    wrong = device.after(record, [AfterGap(g.a, g.b, g.off * spans) for g in told])
    more = [len(record.time) - g.b - len(w) for g, w in zip(told, wrong, strict=True)]
    costs = [_cost(w, n) for w, n in zip(wrong, more, strict=True)]
    order = np.argsort(costs, kind="stable")
    cheap = order[np.cumsum(np.array(costs)[order]) <= DEAREST * len(record.time)]
    for k in cheap.tolist():
        squares[told[k].b :] += np.pad(wrong[k] ** 2, ((0, more[k]), (0, 0)), mode="edge")
    return [told[k] for k in sorted(cheap.tolist())], squares > FRACTION**2


def _cost(wrong: np.ndarray, more: int) -> int:
    """Rows after a gap in which it leaves a reading too `wrong` (rows, n_y) [its noise], and the `more` that follow."""
    rows = np.any(wrong > FRACTION, axis=1)
    return int(rows.sum() + rows[-1] * more)


def _without_nan(drive: np.ndarray) -> np.ndarray:
    """The drives (n, n_u) with straight lines where they are missing."""
    rows = np.arange(len(drive))
    return np.column_stack([np.interp(rows, np.flatnonzero(ok := np.isfinite(u)), u[ok]) for u in drive.T])


def _note(name: str, told: list[_Bridged], after: int, valid: np.ndarray) -> str:
    """How many gaps were bridged, how, and how many samples after them are not used."""
    sizes = [g.b - g.a for g in told]
    ways = sorted({bridge.way for g in told for bridge in g.bridges})
    off = max(g.off.max() for g in told)
    right = f" (within {100 * off:.1g} % of its range, by trials)" if off > TOLD else ""
    count = (
        f"{len(sizes)} gaps, the longest of {number_of(max(sizes), 'sample')}, are"
        if len(sizes) > 1
        else f"a gap of {number_of(sizes[0], 'sample')} is"
    )
    used = sum(int(valid[g.a : g.b].any(axis=1).sum()) for g in told)
    theirs = f"readings of {used} of them are used" if used else "readings of theirs are not used"
    more = f", nor of {number_of(after, 'sample')} after them, which that changes" if after else ""
    return (
        f"{name}: {count} bridged, {number_of(sum(sizes), 'sample')} in all: the drive is taken as {' or '.join(ways)} there{right}; "
        f"{theirs}{more}."
    )


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


def stretches(
    record: Record, gap: Gap | None = None, device: Described | None = None
) -> tuple[list[Record], list[str]]:
    """The record with short gaps bridged, cut at the others in time and where a drive is missing, and joined across one in which the
    drive rests; and a note on what was done. `gap` says what the drive does in all of them; the `device` as described says what an error
    of it would do to the readings, which without it end with the gap."""
    # one thread: the matrices are small
    with threadpool_limits(1):
        record, bridged_notes = (record, []) if gap == "split" else bridged(record, gap, device)
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
        stretch = replace(rows_between(record, a, b), resumed=bool(parts))
        joined = _joined(parts[-1], stretch) if parts and gap != "split" else None
        if joined:
            missing = len(joined.time) - len(parts[-1].time) - len(stretch.time)
            after = f"{parts[-1].time[-1]:.6g} s"
            notes.append(
                f"{record.name}: {number_of(missing, 'sample is', 'samples are')} missing after {after} while the drive rests; "
                "marked, not used."
            )
            parts[-1] = joined
        else:
            parts.append(stretch)
    kept = [stretch for stretch in parts if len(stretch.time) >= SHORTEST["series"]]
    dropped = sum(len(stretch.time) for stretch in parts) - sum(len(stretch.time) for stretch in kept)
    if not notes[len(bridged_notes) :] and len(parts) == 1:
        count = number_of(len(known) - len(parts[0].time), "sample")
        notes.append(f"{record.name}: a drive is missing in {count} at its beginning or end: left out.")
    if len(parts) > 1:
        more = ", ..." if len(parts) > LISTED_CUTS + 1 else ""
        lost = number_of(dropped, "sample is", "samples are")
        at = ", ".join(f"{stretch.time[0]:.6g} s" for stretch in parts[1 : LISTED_CUTS + 1]) + more
        notes.append(
            f"{record.name}: the drive is not known across gaps, so the record is used as {number_of(len(kept), 'record')}, cut before {at}"
            + (f"; {lost} left out, in stretches shorter than {SHORTEST['series']}." if dropped else ".")
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

"""Validation of a recording before it is diagnosed: faults refuse it, doubtful samples are marked in `valid` and noted.

Refused: time that does not increase or is unevenly sampled, drives that are missing or beyond the device's limits, channels
with too few numbers, records in which nothing changes, held-out data that are fitted as well, too few samples to hold any
out.
Marked or noted: gaps, missing samples, outliers, stuck and clipped stretches, dead channels, jitter below 1 %.
No reading is filled in. A drive is across short gaps where that is right enough (`gaps`); where it is not known one record ends and another
begins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault
from ctrlgen.core.units import from_si, show
from ctrlgen.devices.limit import spans
from ctrlgen.model.model import Model
from ctrlgen.recordings.after_gaps import Described
from ctrlgen.recordings.alike_units import unit_within
from ctrlgen.recordings.gaps import SHORTEST, Gap, rows_between, stretches
from ctrlgen.recordings.implausible_note import Implausible
from ctrlgen.recordings.outliers import held_for, outliers, stuck_samples
from ctrlgen.recordings.recording import Record
from ctrlgen.recordings.usual_step import BREAK

JITTER = 0.01  # of the sample time, rms
NOTED_JITTER = 0.001  # of the sample time, rms: from here on it is noted
DIVISIBLE = {"series": 200, "poses": 12}  # rows from which a part can be held out
HELD_OUT = 0.3  # of a series, at its end: random samples would leak through the device's memory
EVERY = 3  # of poses, the third, sixth, ... are held out
OVER_LIMIT = 1e-6  # of the drive's range: rounding of the file
RESTLESS = 0.01  # of the drive's range: more is no rest
MOST_RUNS = 20  # that follow one another in a file: a time that falls more often is out of order
REPEAT_BLOCKS = 10  # into which a held-out record is cut to be looked for among the fitted ones


@dataclass(frozen=True)
class ChannelNames:
    """Names of the drives and observed channels of a record, and the reader's unit of each."""

    drives: tuple[str, ...]
    drive_units: tuple[str, ...]
    observed: tuple[str, ...]
    units: tuple[str, ...]


class MissingSamples(str):
    """A note on samples of a channel without a reading, which a reader who bridges such gaps leaves out."""


@dataclass(frozen=True)
class Validated:
    """The result of validation: usable records, notes on what was marked, and the faults that refuse the recording."""

    records: tuple[Record, ...] = ()
    notes: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()


def validate_record(
    record: Record,
    kind: str,
    model: Model,
    names: ChannelNames,
    where: str,
    gap: Gap | None = None,
    noise: Mapping[str, float] = MappingProxyType({}),
) -> Validated:
    """One record as read -> its uninterrupted stretches with every doubtful sample marked.

    `record.valid` is False in channels that this record has no column for; `kind` is "series" or "poses"; `where` is the
    record's place in recording.toml, such as "record[0]". `gap`: what the drive does across rows that are missing, where the
    file says it; `noise`: the standard deviation that it states for some observed channels [SI].
    """
    recorded = np.any(record.valid, axis=0)
    faults = _missing_numbers(record, kind, names, where, recorded) + _beyond_limits(record, kind, model, names, where)
    notes: list[str] = []
    parts = [record]
    if kind == "series" and len(record.time) >= SHORTEST[kind]:
        sample_time, clock_notes, clock_faults = _sample_time(record, where)
        faults += clock_faults
        if not faults:
            parts, gap_notes = stretches(
                replace(record, sample_time=sample_time), gap, Described(model, names.observed, noise)
            )
            notes = clock_notes + gap_notes
            if not parts:
                faults = [Fault(where, _no_stretch(record, gap, gap_notes))]
    faults = faults or _nothing_changes(record, where)
    if faults:
        return Validated(faults=tuple(faults))
    if record.role != "rest" and (record.drive == record.drive[0]).all():
        notes.append(
            f"{record.name}: no drive moves; the readings show only drift, noise, or the effect of earlier motion."
        )
    marked = []
    for stretch in parts:
        stretch, mark_notes = mark(stretch, kind, names, recorded)
        marked.append(stretch)
        notes += mark_notes
    return Validated(tuple(marked), tuple(notes))


def _no_stretch(record: Record, gap: Gap | None, notes: Sequence[str]) -> str:
    """Why nothing is left of a record between its gaps, and what to do."""
    if not np.isfinite(record.drive).all(axis=1).any():  # then no gap has a beginning or an end
        what = f"{record.name}: no row states every drive, so that it is known of none what it did together with the others"
        return f"{what}; record all drives at one rate, or resample them to the rows of one"
    mend = "record without gaps"
    if gap not in ("held", "linear"):
        instead = ' in place of "split"' if gap == "split" else ""
        mend = f'write gap = "held" or "linear"{instead} if the drive is so between the rows that state it, or {mend}'
    return f"{notes[-1]} No usable stretch remains; {mend}"


def _missing_numbers(record: Record, kind: str, names: ChannelNames, where: str, recorded: np.ndarray) -> list[Fault]:
    """Faults of channels without numbers and of records too short."""
    n = len(record.drive)
    if n < SHORTEST[kind]:
        what = number_of(n, "sample" if kind == "series" else "pose")
        return [Fault(where, f"{record.name} has {what}; at least {SHORTEST[kind]} are needed: record longer")]
    faults = []
    for i, name in enumerate(names.drives):
        missing = np.flatnonzero(~np.isfinite(record.drive[:, i]))
        if len(missing) == n:
            faults.append(Fault(f"{where}.columns.{name!r}", "holds no number at all; name the column of this drive"))
        elif len(missing) and kind == "poses":
            what = f"has no number in row {missing[0]} ({len(missing)} of {n} rows); leave those poses out of the file, or out with `rows`"
            faults.append(Fault(f"{where}.columns.{name!r}", what))
    for i, name in enumerate(names.observed):
        count = int(np.isfinite(record.observed[:, i]).sum())
        if recorded[i] and count < SHORTEST[kind]:
            numbers = number_of(count, "number")
            what = (
                f"has {numbers} in {n} rows of {record.name}, but {SHORTEST[kind]} are needed; leave this channel out"
            )
            faults.append(Fault(f"{where}.columns.{name!r}", what))
    if record.ambient is not None and not np.isfinite(record.ambient).all():
        k = int(np.flatnonzero(~np.isfinite(record.ambient))[0])
        what = f"has no number in row {k}; give a constant temperature, or a column without missing numbers"
        faults.append(Fault(f"{where}.conditions.ambient", what))
    return faults


def _beyond_limits(record: Record, kind: str, model: Model, names: ChannelNames, where: str) -> list[Fault]:
    """Faults of drives that the device's own limits exclude: the unit, the sign or the device is wrong."""
    faults = []
    for i, (low, high) in enumerate(zip(*model.u_bounds, strict=True)):
        u, unit = record.drive[:, i], names.drive_units[i]
        excess = np.fmax(u - high, low - u)
        count = int((excess > OVER_LIMIT * spans((low, high))).sum())
        if not count:
            continue
        k = int(np.nanargmax(excess))
        row = f"{record.time[k]:.6g} s" if kind == "series" and np.isfinite(record.time[k]) else f"row {k}"
        limits = " to ".join("no limit" if not np.isfinite(b) else show(b, unit) for b in (low, high))
        other = (
            unit_within(float(np.nanmax(np.abs(u))), max(abs(low), abs(high)), unit) if count > len(u) // 2 else None
        )
        mend = f'if its numbers are in {other}, write unit = "{other}"; else ' if other else ""
        what = (
            f"reaches {show(u[k], unit)} at {row}, the device allows {limits} ({count} of {number_of(len(u), 'sample')} beyond); "
            f"{mend}check the column's unit and sign, or the limit in the device file"
        )
        faults.append(Fault(f"{where}.columns.{names.drives[i]!r}", what))
    return faults


def _nothing_changes(record: Record, where: str) -> list[Fault]:
    """A fault where every drive and every channel is constant."""
    still = np.all(record.drive == record.drive[:1]) and all(_constant(y) for y in record.observed.T)
    if still and record.role != "rest":
        what = f"{record.name}: every drive and every channel is constant, nothing can be learnt from it; check the columns"
        return [Fault(where, what)]
    return []


def _constant(y: np.ndarray) -> bool:
    finite = y[np.isfinite(y)]
    return bool(len(finite) == 0 or (finite == finite[0]).all())


def _sample_time(record: Record, where: str) -> tuple[float, list[str], list[Fault]]:
    """The sample time [s], notes and faults of the time stamps."""
    t = record.time
    missing = np.flatnonzero(~np.isfinite(t))
    if len(missing):
        what = f"has no number in row {missing[0]} ({len(missing)} of {len(t)} rows); repair the file, or leave them out with `rows`"
        return np.nan, [], [Fault(f"{where}.time", what)]
    step = np.diff(t)
    backward = np.flatnonzero(step <= 0)
    if len(backward):
        k = int(backward[0])
        mend = "sort the rows, remove repeated ones, or give sample_rate if the samples are evenly spaced"
        if np.all(t[backward + 1] <= t[0] + np.median(step)) and len(backward) <= MOST_RUNS:
            runs = pairwise([0, *(backward + 1).tolist(), len(t)])
            listed = ", ".join(f"rows = [{a}, {b}]" for a, b in runs)
            mend = f"it begins again as another run does: write a record for each of {listed}"
        what = (
            f"does not increase from row {k} ({t[k]:.9g} s) to row {k + 1} ({t[k + 1]:.9g} s), {number_of(len(backward), 'such step')} in "
            f"all; {mend}"
        )
        return np.nan, [], [Fault(f"{where}.time", what)]
    regular = step[step <= BREAK * np.median(step)]
    sample_time = float(f"{regular.mean():.9g}")  # the same for records that differ by rounding
    jitter = float(np.sqrt(np.mean((regular / sample_time - 1) ** 2)))
    if jitter > JITTER:
        what = (
            f"is uneven: steps differ from {sample_time:.6g} s by {100 * jitter:.2g} % (rms; {100 * JITTER:g} % is allowed); "
            "resample to an even grid and say how in `source`, or give sample_rate if only the time stamps are rounded"
        )
        return np.nan, [], [Fault(f"{where}.time", what)]
    notes = []
    if jitter > NOTED_JITTER:
        notes.append(
            f"{record.name}: time stamps jitter by {100 * jitter:.2g} % of the sample time (rms); samples are taken as evenly spaced."
        )
    return sample_time, notes, []


def mark(record: Record, kind: str, names: ChannelNames, recorded: np.ndarray) -> tuple[Record, list[str]]:
    """The record with outliers and stuck stretches NaN and not valid; a note for each kind of mark and for dead channels."""
    observed, valid = record.observed.copy(), record.valid.copy()
    notes: list[str] = []
    spikes: list[tuple[int, int, float]] = []
    for i, name in enumerate(names.observed):
        if not recorded[i]:
            continue
        title, y = f"{record.name}, {name}", record.observed[:, i]
        missing = ~np.isfinite(y) & record.valid[:, i]
        marks = {"missing": missing}
        if _constant(y):
            value = y[np.isfinite(y)]
            state = "has no valid sample" if not len(value) else f"reads {show(value[0], names.units[i])} throughout"
            if record.role != "rest":
                notes.append(f"{title}: {state}; the channel may be dead.")
        elif kind == "series":
            stuck = stuck_samples(y, record.drive)
            if (rows := held_for(y, record.drive)) > 1:
                what = f"changes in one row of {rows} alone: it was read at a lower rate and held, by up to {rows - 1} rows too late"
                notes.append(
                    Implausible(
                        f"{name} {what}; empty the rows of {record.name} that repeat it, and the others are used"
                    )
                )
            marks["in stretches that repeat one value to the last bit (stuck or clipped)"] = stuck
            marks["outliers"] = far = outliers(np.where(stuck, np.nan, y), record.drive)
            spikes += [(k, i, float(y[k] - chord)) for k, chord in _chords(y, far)]
        for what, chosen in marks.items():
            if chosen.any():
                first = f"{record.time[chosen.argmax()]:.6g} s" if kind == "series" else f"row {chosen.argmax()}"
                one = chosen.sum() == 1
                seen = f"{chosen.sum()} of {len(y)} samples {'is' if one else 'are'}"
                what = "an outlier" if one and what == "outliers" else what
                note = f"{title}: {seen} {what} (first at {first}); not used."
                notes.append(MissingSamples(note) if chosen is missing else note)
                valid[chosen, i] = False
        observed[~valid[:, i], i] = np.nan
    return replace(record, observed=observed, valid=valid, spikes=tuple(spikes)), notes


def _chords(y: np.ndarray, marked: np.ndarray) -> list[tuple[int, float]]:
    """Row and value on the chord between its neighbours of each `marked` sample of `y` (n,)."""
    rows, kept = np.flatnonzero(marked), np.flatnonzero(~marked & np.isfinite(y))
    return list(zip(rows.tolist(), np.interp(rows, kept, y[kept]).tolist(), strict=True)) if len(kept) else []


def compare_records(records: Sequence[Record], wheres: Sequence[str], names: ChannelNames) -> list[Fault]:
    """Faults between records: drives that move in a record at rest, and held-out data that are fitted as well.

    `wheres` are the records' places in recording.toml.
    """
    faults = []
    span = np.max([np.nanmax(r.drive, 0) for r in records], 0) - np.min([np.nanmin(r.drive, 0) for r in records], 0)
    for record, where in zip(records, wheres, strict=True):
        moves = np.ptp(record.drive, axis=0)
        worst = int(np.argmax(moves - RESTLESS * span))
        if record.role == "rest" and moves[worst] > RESTLESS * span[worst]:
            unit = names.drive_units[worst]
            size = f"{from_si(moves[worst], unit) - from_si(0.0, unit):.4g} {unit}"
            what = f'{record.name} has role "rest", but {names.drives[worst]} moves by {size}; write role = "fit"'
            faults.append(Fault(f"{where}.role", what))
        for other in records:
            if record.role == "hold_out" and other.role == "fit" and _repeats(record, other):
                what = f"{record.name} holds the data of {other.name}, which is fitted; hold out other data"
                faults.append(Fault(where, what))
    return faults


def _repeats(held_out: Record, fitted: Record) -> bool:
    """Whether most of `held_out` occurs in `fitted` number for number."""
    a, b = (np.nan_to_num(np.hstack([r.drive, r.observed]), nan=0.0) for r in (fitted, held_out))
    content, size = a.tobytes(), max(1, len(b) // REPEAT_BLOCKS)
    blocks = [b[k : k + size] for k in range(0, len(b), size)]
    telling = [block.tobytes() for block in blocks if len(b) < 2 * REPEAT_BLOCKS or np.ptp(block, axis=0).max() > 0]
    return bool(telling) and 2 * sum(block in content for block in telling) > len(telling)


def with_hold_out(records: Sequence[Record], kind: str) -> Validated:
    """The records with a held-out part: as given, else the end of the longest series, which goes on from what the device remembers of
    the rest, or every third of its poses.

    Held-out poses keep their place: both parts have every row, with the other part's samples marked not valid, so that
    a device with a memory is simulated over the whole sequence.
    """
    fits = [record for record in records if record.role == "fit"]
    if not fits:
        return Validated(faults=(Fault("record", 'none has role = "fit"; give at least one record to fit'),))
    if any(record.role == "hold_out" for record in records):
        return Validated(tuple(records))
    longest = max(fits, key=lambda record: len(record.time))
    n, least = len(longest.time), DIVISIBLE[kind]
    if n < least:
        what = f'none has role = "hold_out", and {longest.name} is too short to divide ({number_of(n, "row")}, {least} are needed)'
        thinned = ", or raise low_pass, after which fewer rows are kept" if longest.band is not None else ""
        return Validated(faults=(Fault("record", f"{what}; record a second run{thinned}"),))
    if kind == "series":
        cut = round((1 - HELD_OUT) * n)
        parts = [rows_between(longest, 0, cut), replace(rows_between(longest, cut, n), role="hold_out", resumed=True)]
        labels = (f"first {cut} of {n}", f"last {n - cut} of {n}")
        how = f"its last {n - cut} of {n} samples"
    else:
        third = np.arange(n) % EVERY == EVERY - 1
        parts = [_only(longest, ~third), replace(_only(longest, third), role="hold_out")]
        labels, how = ("two of three", "every third"), f"every third of its {n} poses"
    parts = [replace(part, name=f"{part.name} ({label})") for part, label in zip(parts, labels, strict=True)]
    notes = [
        f'No record has role = "hold_out": of {longest.name}, {how} are held out; a second run of another kind would prove more.'
    ]
    if kind == "series" and (parts[1].drive == parts[1].drive[0]).all():
        notes.append(
            'In the held-out part no drive moves, so it proves little: give a record that moves role = "hold_out".'
        )
    return Validated(tuple(p for r in records for p in (parts if r is longest else [r])), tuple(notes))


def _only(record: Record, rows: np.ndarray) -> Record:
    """The record with the samples outside `rows` (n,) bool marked not valid."""
    valid = record.valid & rows[:, None]
    return replace(record, valid=valid, observed=np.where(valid, record.observed, np.nan))

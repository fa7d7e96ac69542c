"""Step 0 of the diagnosis: what a recording is worth. Faults refuse it; the rest is marked in `valid` and said in a note.

Refused: time that does not rise or is sampled unevenly, drives that are missing or beyond the device's limits, channels
of few numbers, records in which nothing happens, held-out data that were fitted, too little to hold anything out.
Marked or noted: gaps, missing samples, spikes, stuck and clipped stretches, dead channels, jitter below 1 %.
Nothing is filled in: where the drive is not known a record ends and another begins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ctrlgen.core.errors import Fault
from ctrlgen.core.units import from_si, show
from ctrlgen.model.model import Model
from ctrlgen.recordings.outliers import outliers, stuck_samples
from ctrlgen.recordings.recording import Record

JITTER = 0.01  # of the sample time, rms
BREAK = 1.5  # sample times without a sample: a gap
SHORTEST = {"series": 20, "poses": 3}  # rows without which a record says nothing
DIVISIBLE = {"series": 200, "poses": 12}  # rows from which a part can be held out
HELD_OUT = 0.3  # of a series, at its end: random samples would leak through the device's memory
EVERY = 3  # of poses, the third, sixth, ... are held out
OVER_LIMIT = 1e-6  # of the drive's range: rounding of the file
RESTLESS = 0.01  # of the drive's range: more is no rest


@dataclass(frozen=True)
class ChannelNames:
    """What a reader calls things: the drives and observed channels of a record, and their units."""

    drives: tuple[str, ...]
    drive_units: tuple[str, ...]
    observed: tuple[str, ...]
    units: tuple[str, ...]


@dataclass(frozen=True)
class Validated:
    """What became of a record: its usable stretches, what was marked, why it is refused."""

    records: tuple[Record, ...] = ()
    notes: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()


def validate_record(record: Record, kind: str, model: Model, names: ChannelNames, where: str) -> Validated:
    """One record as read -> its stretches without a break, each sample marked.

    `record.valid` says which channels it has columns for; `where` is its place in recording.toml.
    """
    spoken = record.valid.any(0)
    faults = _empty(record, kind, names, where, spoken) + _beyond_limits(record, kind, model, names, where)
    notes: list[str] = []
    pieces = [record]
    if kind == "series" and len(record.time) >= SHORTEST[kind]:
        period, said, wrong = _clock(record, where)
        faults += wrong
        if not faults:
            pieces, notes = _stretches(replace(record, sample_time=period))
            notes = said + notes
            if not pieces:
                faults = [Fault(where, f"{record.name}: {notes[-1]} Nothing is left; record without gaps")]
    faults = faults or _nothing_happens(record, where)
    if faults:
        return Validated(faults=tuple(faults))
    if record.role != "rest" and (record.drive == record.drive[0]).all():
        notes.append(f"{record.name}: no drive moves; what the reading does is drift, noise, or what came before.")
    marked = []
    for piece in pieces:
        piece, said = _mark(piece, kind, names, spoken)
        marked.append(piece)
        notes += said
    return Validated(tuple(marked), tuple(notes))


def _empty(record: Record, kind: str, names: ChannelNames, where: str, spoken: np.ndarray) -> list[Fault]:
    """Faults of channels without numbers and of records too short."""
    n = len(record.drive)
    if n < SHORTEST[kind]:
        what = "samples" if kind == "series" else "poses"
        return [Fault(where, f"{record.name} has {n} {what}; {SHORTEST[kind]} or more are needed: record longer")]
    faults = []
    for i, name in enumerate(names.drives):
        lost = np.flatnonzero(~np.isfinite(record.drive[:, i]))
        if len(lost) == n:
            faults.append(Fault(f"{where}.columns.{name!r}", "holds no number at all; name the column of this drive"))
        elif len(lost) and kind == "poses":
            what = f"has no number in row {lost[0]} ({len(lost)} of {n}); leave those poses out of the file or by rows"
            faults.append(Fault(f"{where}.columns.{name!r}", what))
    for i, name in enumerate(names.observed):
        count = int(np.isfinite(record.observed[:, i]).sum())
        if spoken[i] and count < SHORTEST[kind]:
            what = (
                f"has {count} numbers in {n} rows of {record.name}, {SHORTEST[kind]} are needed; leave this channel out"
            )
            faults.append(Fault(f"{where}.columns.{name!r}", what))
    if record.ambient is not None and not np.isfinite(record.ambient).all():
        k = int(np.flatnonzero(~np.isfinite(record.ambient))[0])
        what = f"has no number in row {k}; give a constant, or a column without holes"
        faults.append(Fault(f"{where}.conditions.ambient", what))
    return faults


def _beyond_limits(record: Record, kind: str, model: Model, names: ChannelNames, where: str) -> list[Fault]:
    """Drives that the device's own limits exclude: a wrong unit, sign or device."""
    faults = []
    for i, (low, high) in enumerate(zip(*model.u_bounds, strict=True)):
        u, unit = record.drive[:, i], names.drive_units[i]
        span = high - low if np.isfinite(high - low) else max(abs(b) for b in (low, high, 0.0) if np.isfinite(b))
        over = np.fmax(u - high, low - u)
        count = int((over > OVER_LIMIT * span).sum())
        if not count:
            continue
        k = int(np.nanargmax(over))
        row = f"{record.time[k]:.6g} s" if kind == "series" and np.isfinite(record.time[k]) else f"row {k}"
        sides = " to ".join("no limit" if not np.isfinite(b) else show(b, unit) for b in (low, high))
        what = (
            f"reaches {show(u[k], unit)} at {row}, the device allows {sides} ({count} of {len(u)} samples beyond); "
            "check the column's unit and sign, or the limit in the device file"
        )
        faults.append(Fault(f"{where}.columns.{names.drives[i]!r}", what))
    return faults


def _nothing_happens(record: Record, where: str) -> list[Fault]:
    """Records in which drive and channels are constant."""
    still = np.all(record.drive == record.drive[:1]) and all(_constant(y) for y in record.observed.T)
    if still and record.role != "rest":
        what = f"{record.name}: every drive and every channel is constant, nothing can be learnt; check the columns"
        return [Fault(where, what)]
    return []


def _constant(y: np.ndarray) -> bool:
    finite = y[np.isfinite(y)]
    return bool(len(finite) == 0 or (finite == finite[0]).all())


def _clock(record: Record, where: str) -> tuple[float, list[str], list[Fault]]:
    """The sample time [s], notes and faults of the time stamps."""
    t = record.time
    lost = np.flatnonzero(~np.isfinite(t))
    if len(lost):
        what = (
            f"has no number in row {lost[0]} ({len(lost)} of {len(t)} rows); repair the file or leave them out by rows"
        )
        return np.nan, [], [Fault(f"{where}.time", what)]
    step = np.diff(t)
    back = np.flatnonzero(step <= 0)
    if len(back):
        k = int(back[0])
        what = (
            f"does not rise from row {k} ({t[k]:.9g} s) to row {k + 1} ({t[k + 1]:.9g} s), {len(back)} such in all; "
            "sort the rows, remove doubled ones, or give sample_rate if the samples are evenly spaced"
        )
        return np.nan, [], [Fault(f"{where}.time", what)]
    period = float(np.median(step))
    regular = step[step <= BREAK * period]
    period = float(f"{regular.mean():.9g}")  # the same for records that differ by rounding
    jitter = float(np.sqrt(np.mean((regular / period - 1) ** 2)))
    if jitter > JITTER:
        what = (
            f"is uneven: steps differ from {period:.6g} s by {100 * jitter:.2g} % (rms; 1 % is allowed); resample to an even "
            "grid and say how in `source`, or give sample_rate if only the time stamps are rounded"
        )
        return np.nan, [], [Fault(f"{where}.time", what)]
    notes = []
    if jitter > JITTER / 10:
        notes.append(
            f"{record.name}: time stamps jitter by {100 * jitter:.2g} % of the sample time (rms); taken as even."
        )
    return period, notes, []


def _stretches(record: Record) -> tuple[list[Record], list[str]]:
    """The record cut at gaps in time and where a drive is missing; joined over what is missing while the drive rests."""
    known = np.isfinite(record.drive).all(1)
    breaks = (np.flatnonzero(np.diff(record.time) > BREAK * record.sample_time) + 1).tolist()
    edges = np.flatnonzero(np.diff(np.r_[False, known, False].astype(int)))
    bounds = [(a, b) for a, b in edges.reshape(-1, 2).tolist()]
    cuts = [(a, b) for lo, hi in bounds for a, b in _split(lo, hi, breaks)]
    if len(cuts) == 1 and cuts[0] == (0, len(known)):
        return [record], []
    notes, parts = [], []
    for a, b in cuts:
        part = _rows(record, a, b)
        bridged = parts and _bridge(parts[-1], part)
        if bridged:
            missing = len(bridged.time) - len(parts[-1].time) - len(part.time)
            at = f"{parts[-1].time[-1]:.6g} s"
            notes.append(f"{record.name}: {missing} samples are missing after {at} while the drive rests; marked.")
            parts[-1] = bridged
        else:
            parts.append(part)
    kept = [part for part in parts if len(part.time) >= SHORTEST["series"]]
    dropped = sum(len(part.time) for part in parts) - sum(len(part.time) for part in kept)
    if not notes and len(parts) == 1:
        count = len(known) - len(parts[0].time)
        notes.append(f"{record.name}: a drive is missing in {count} samples at its begin or end; they are left out.")
    if len(parts) > 1:
        at = ", ".join(f"{part.time[0]:.6g} s" for part in parts[1:6]) + (", ..." if len(parts) > 6 else "")
        notes.append(
            f"{record.name}: the drive is not known across gaps, so it is read as {len(kept)} records, cut before {at}"
            + (f"; {dropped} samples in stretches below {SHORTEST['series']} are left out." if dropped else ".")
        )
        kept = [replace(part, name=f"{part.name} from {part.time[0]:.6g} s") for part in kept]
    return kept, notes


def _split(a: int, b: int, breaks: list[int]) -> list[tuple[int, int]]:
    edges = [a, *(k for k in breaks if a < k < b), b]
    return list(pairwise(edges))


def _rows(record: Record, a: int, b: int) -> Record:
    """Rows a to b of a record."""
    fields = {name: getattr(record, name)[a:b] for name in ("time", "drive", "observed", "valid")}
    return replace(record, **fields, ambient=None if record.ambient is None else record.ambient[a:b])


def _bridge(before: Record, after: Record) -> Record | None:
    """Both with marked rows between, if the drive was at rest on both sides and the gap is a whole number of samples."""
    rest = np.vstack([before.drive[-5:], after.drive[:5]])
    steps = (after.time[0] - before.time[-1]) / before.sample_time
    missing = round(steps) - 1
    shortest = min(len(before.time), len(after.time))
    if len(rest) < 10 or (rest != rest[0]).any() or abs(steps - round(steps)) > 0.1 or missing > shortest:
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
        drive=np.vstack([before.drive, np.tile(rest[0], (missing, 1)), after.drive]),
        observed=np.vstack([before.observed, blank, after.observed]),
        valid=np.vstack([before.valid, np.zeros(blank.shape, dtype=bool), after.valid]),
        ambient=ambient,
    )


def _mark(record: Record, kind: str, names: ChannelNames, spoken: np.ndarray) -> tuple[Record, list[str]]:
    """Spikes and stuck stretches made NaN and invalid; a sentence for each kind of mark and for dead channels."""
    observed, valid, notes = record.observed.copy(), record.valid.copy(), []
    for i, name in enumerate(names.observed):
        if not spoken[i]:
            continue
        title, y = f"{record.name}, {name}", record.observed[:, i]
        found = {"missing": ~np.isfinite(y) & record.valid[:, i]}
        if _constant(y):
            value = y[np.isfinite(y)]
            reads = "has no valid sample" if not len(value) else f"reads {show(value[0], names.units[i])} throughout"
            if record.role != "rest":
                notes.append(f"{title}: {reads}; a dead channel?")
        elif kind == "series":
            frozen = stuck_samples(y, record.drive)
            found["in stretches that repeat themselves to the last bit (stuck or clipped)"] = frozen
            found["spikes"] = outliers(np.where(frozen, np.nan, y), record.drive)
        for what, where in found.items():
            if where.any():
                first = f"{record.time[where.argmax()]:.6g} s" if kind == "series" else f"row {where.argmax()}"
                notes.append(f"{title}: {where.sum()} of {len(y)} samples are {what} (first at {first}); not used.")
                valid[where, i] = False
        observed[~valid[:, i], i] = np.nan
    return replace(record, observed=observed, valid=valid), notes


def compare_records(records: Sequence[Record], wheres: Sequence[str], names: ChannelNames) -> list[Fault]:
    """Faults between records: rest that moves, and held-out data that were fitted. `wheres` are their places."""
    faults = []
    span = np.max([np.nanmax(r.drive, 0) for r in records], 0) - np.min([np.nanmin(r.drive, 0) for r in records], 0)
    for record, where in zip(records, wheres, strict=True):
        moves = np.ptp(record.drive, axis=0)
        worst = int(np.argmax(moves - RESTLESS * span))
        if record.role == "rest" and moves[worst] > RESTLESS * span[worst]:
            unit = names.drive_units[worst]
            size = f"{from_si(moves[worst], unit) - from_si(0.0, unit):.4g} {unit}"
            what = f'{record.name} is called rest, but {names.drives[worst]} moves by {size}; write role = "fit"'
            faults.append(Fault(f"{where}.role", what))
        for other in records:
            if record.role == "hold_out" and other.role == "fit" and _repeats(record, other):
                what = f"{record.name} holds the data of {other.name}, which is fitted; hold out other data"
                faults.append(Fault(where, what))
    return faults


def _repeats(held: Record, fitted: Record) -> bool:
    """Whether most of `held` stands in `fitted` number for number."""
    a, b = (np.nan_to_num(np.hstack([r.drive, r.observed]), nan=0.0) for r in (fitted, held))
    text, size = a.tobytes(), max(1, len(b) // 10)
    blocks = [b[k : k + size] for k in range(0, len(b), size)]
    telling = [block.tobytes() for block in blocks if len(b) < 20 or np.ptp(block, axis=0).max() > 0]
    return bool(telling) and 2 * sum(block in text for block in telling) > len(telling)


def with_hold_out(records: Sequence[Record], kind: str) -> Validated:
    """The records with a held-out part: as given, else the end of the longest series, or every third of its poses.

    Held-out poses keep their place: both parts have every row, with the other part's samples marked not valid, so that
    a device with a memory sees the whole sequence.
    """
    fits = [record for record in records if record.role == "fit"]
    if not fits:
        return Validated(faults=(Fault("record", 'has none with role = "fit"; there is nothing to learn from'),))
    if any(record.role == "hold_out" for record in records):
        return Validated(tuple(records))
    longest = max(fits, key=lambda record: len(record.time))
    n, least = len(longest.time), DIVISIBLE[kind]
    if n < least:
        what = (
            f'has none with role = "hold_out", and {longest.name} is too short to divide ({n} rows, {least} are needed)'
        )
        return Validated(faults=(Fault("record", f"{what}; record a second run"),))
    if kind == "series":
        cut = round((1 - HELD_OUT) * n)
        parts = (_rows(longest, 0, cut), replace(_rows(longest, cut, n), role="hold_out"))
        labels = (f"first {cut} of {n}", f"last {n - cut} of {n}")
        how = f"its last {n - cut} of {n} samples"
    else:
        third = np.arange(n) % EVERY == EVERY - 1
        parts = (_only(longest, ~third), replace(_only(longest, third), role="hold_out"))
        labels, how = ("two of three", "every third"), f"every third of its {n} poses"
    parts = tuple(replace(part, name=f"{part.name} ({label})") for part, label in zip(parts, labels, strict=True))
    note = (
        f"No record is held out: {how} are held out of {longest.name}; a second run of another kind would prove more."
    )
    still = kind == "series" and (parts[1].drive == parts[1].drive[0]).all()
    rests = (
        ("In what is held out no drive moves, so it proves little: name a record that moves hold_out.",)
        if still
        else ()
    )
    return Validated(tuple(p for r in records for p in (parts if r is longest else (r,))), (note, *rests))


def _only(record: Record, rows: np.ndarray) -> Record:
    """The record with the samples outside `rows` (n,) marked."""
    valid = record.valid & rows[:, None]
    return replace(record, valid=valid, observed=np.where(valid, record.observed, np.nan))

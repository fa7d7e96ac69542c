"""Long records with fewer rows, where that loses nothing.

A recorder is often many times faster than the controller whose drive it writes down. Of such a record one row in m is enough where

- every drive is held over whole groups of m rows, and is then kept exactly; or it is so smooth that the straight lines between the kept
  rows miss it by less, in terms of a reading, than the readings' noise over the root of their number, which no fit can tell;
- what the readings do above half the new rate is not of the drive: its part that follows the drive's steps is no larger than noise
  gives by chance, nor is it larger in some places than in others, as ringing would be.

The readings are averaged by a linear-phase low-pass (a Kaiser window), so that white noise falls by the
root of m, and what is kept belongs to the instants of the kept rows; of a device that follows within a row, over the group of its step.
Outliers and stuck stretches are marked before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.signal import firwin, resample_poly

from ctrlgen.core.counts import number_of
from ctrlgen.recordings.outliers import outliers, stuck_samples
from ctrlgen.recordings.recording import Record
from ctrlgen.recordings.validation import JITTER

LONG = 200_000
"""Rows from which a record is thinned: below, a diagnosis takes minutes as it is."""
ENOUGH = 40_000
"""Rows that are kept at least: further ones would not make a diagnosis faster by much."""
FEWEST = 200
"""Rows that are kept at least of a short record beside a long one: as many as can be divided."""
LED_IN, WINDOW = 16, ("kaiser", 12.0)
"""Kept rows on either side that the low-pass reaches, and its window: 118 dB, of 100 um less than a nanometre. At the ends of a record
their readings are not used."""
SLICE, AROUND = 200_000, 300
"""Rows among which outliers are sought at once, and rows around them that are looked at too: a window of the local noise is shorter."""
BLOCK = 8
"""Kept rows in a stretch whose energy above the new rate is compared with that of the others."""
LOUDER = 2.0
"""Times the median energy of the stretches that one may have: of 64 numbers of white noise one in ten million has more."""
BY_CHANCE = 4.0
"""Times the energy that noise alone gives, by chance, to the part that follows the drive. It would be 1 for white noise."""
ROUGH = 1e-3
"""Of its range that a smooth drive may hold above the new rate, as noise of its own reading."""
LISTED = 0.5
"""Share of a kept row's readings that must be there."""
UNEVEN = 0.5
"""Of a row's time, by which one may be off: beyond, rows are missing."""


@dataclass(frozen=True)
class Thinnable:
    """How many rows one may stand for, `most`; 1 where none may, and `why`. The drives are held over groups of `group` rows, 0 where they
    never move, None where they are curves; the first group that changes them begins at row `first`. `at_once`: the readings are there
    within the row of a step, and are averaged over its group instead of about its instant."""

    most: int
    why: str = ""
    group: int | None = 0
    first: int = 0
    at_once: bool = False

    def allows(self, m: int) -> bool:
        """Whether one row may stand for `m`, which is no more than `most`."""
        return self.group is None or self.group % m == 0


def factors(rows: int, least: int) -> list[int]:
    """How many rows one may stand for at all, the largest first: 1, 2, 4, 5, 8 and their tens, with halves between."""
    steps = [k * 10**e for e in range(6) for k in (1, 1.6, 2, 2.5, 4, 5, 8)]
    return sorted({int(k) for k in steps if k == int(k) and 1 < k <= rows / least}, reverse=True)


def marked(record: Record) -> Record:
    """The record with outliers and stuck readings not valid, sought among some rows at a time."""
    observed, valid = record.observed, record.valid.copy()
    for begin in range(0, len(observed), SLICE):
        a, b = max(0, begin - AROUND), min(len(observed), begin + SLICE + AROUND)
        inner = slice(begin - a, min(begin + SLICE, len(observed)) - a)
        for i in range(observed.shape[1]):
            y, u = observed[a:b, i], record.drive[a:b]
            if np.isfinite(y).sum() < SLICE // 1000 or not np.isfinite(u).all():
                continue
            stuck = stuck_samples(y, u)
            bad = stuck | outliers(np.where(stuck, np.nan, y), u)
            valid[a:b, i][inner] &= ~bad[inner]
    return replace(record, valid=valid & np.isfinite(observed))


def thinnable(record: Record, least: int) -> Thinnable:
    """How many rows of a record with marked readings one may stand for, so that `least` are kept."""
    step = np.diff(record.time)
    if not np.isfinite(record.drive).all() or not np.isfinite(step).all():
        return Thinnable(1, "a drive or a time is missing in some rows")
    off = step / np.mean(step) - 1 if len(step) and np.mean(step) > 0 else np.ones(1)
    if np.abs(off).max() > UNEVEN or np.sqrt(np.mean(off**2)) > JITTER:
        return Thinnable(1, "rows are missing, or are not even in time")
    group, first = _held(record)
    tried = factors(len(record.time), least)
    if _in_lines(record) or group == 1:
        return _smooth(record, tried)
    for m in (m for m in tried if group % m == 0):
        if all(_nothing_of_the_drive(record, i, m, first % m) for i in range(record.observed.shape[1])):
            return Thinnable(m, "", group, first)
        if all(_nothing_within(record, i, m, first % m) for i in range(record.observed.shape[1])):
            return Thinnable(m, "", group, first, True)
    why = f"the drives are held over {group} rows, and within them the readings follow"
    return Thinnable(1, why if any(group % m == 0 for m in tried) else f"the drives are held over {group} rows only")


def _in_lines(record: Record) -> bool:
    """Whether the drives are stated to go in straight lines: of others, those that stand still for several rows were held."""
    return record.linear and not record.either


def _held(record: Record) -> tuple[int, int]:
    """Over groups of how many rows every drive is held, 0 where it never moves, and the first row of a group."""
    changes = np.flatnonzero(np.any(np.diff(record.drive, axis=0) != 0, axis=1)) + 1
    if not len(changes):
        return 0, 0
    return (int(np.gcd.reduce(np.diff(changes))) if len(changes) > 1 else 0), int(changes[0])


def _smooth(record: Record, tried: Sequence[int]) -> Thinnable:
    """Of a record whose drive is a curve."""
    sizes = np.array([_range(y[v]) for y, v in zip(record.observed.T, record.valid.T, strict=True)])
    for m in tried:
        parts = [_above(_bridged(record, i), m, 0) for i in range(record.observed.shape[1])]
        if any(_louder_somewhere(r, m) for r in parts):
            continue
        allowed = min(
            (np.sqrt(np.mean(r**2) / len(r)) / s for r, s in zip(parts, sizes, strict=True) if s), default=0.0
        )
        if all(_straight_enough(u, m, allowed) for u in record.drive.T):
            return Thinnable(m, "", None)
    return Thinnable(
        1, "the drives are not held, and straight lines between fewer rows would miss them by more than the noise"
    )


def _straight_enough(u: np.ndarray, m: int, allowed: float) -> bool:
    """Whether straight lines between every m-th value of a drive miss it by less than a share `allowed` of its range."""
    if (size := _range(u)) == 0:
        return True
    kept = _low_passed(u, m)
    smooth = _between(kept, m, len(u))
    lines = np.interp(np.arange(len(u)), m * np.arange(len(kept)), kept)
    inner = slice(LED_IN * m, -LED_IN * m)
    off = np.sqrt(np.mean((lines - smooth)[inner] ** 2)) / size
    rough = np.sqrt(np.mean((u - smooth)[inner] ** 2)) / size
    return bool(off <= allowed and rough <= ROUGH)


def _nothing_of_the_drive(record: Record, i: int, m: int, phase: int) -> bool:
    """Whether a reading does nothing above the new rate that the drive's steps at the kept rows do."""
    r = _above(_bridged(record, i), m, phase)
    if not r.any():
        return True
    if _louder_somewhere(r, m):
        return False
    u = record.drive[phase::m]
    steps = np.diff(u, axis=0, prepend=u[:1])
    begin = m - (m - 1) // 2  # a kept row, the one after the led-in ones, is in the middle of its group
    count = min((len(r) - begin) // m, len(steps) - LED_IN - 2)
    if count < 1:
        return False
    groups = r[begin : begin + count * m].reshape(-1, m)
    rows = LED_IN + 1 + np.arange(count)
    return _by_chance(groups, np.hstack([steps[rows + k] for k in (-1, 0, 1)]))


def _nothing_within(record: Record, i: int, m: int, phase: int) -> bool:
    """Whether a reading stays where it is within the groups over which the drives are held."""
    y = _bridged(record, i)[phase:]
    groups = y[: len(y) // m * m].reshape(-1, m)
    groups = groups - groups.mean(axis=1, keepdims=True)
    u = record.drive[phase::m][: len(groups)]
    steps = np.diff(u, axis=0, prepend=u[:1])
    return not _louder_somewhere(groups.ravel(), m) and _by_chance(groups[1:], np.hstack([steps[1:], steps[:-1]]))


def _by_chance(groups: np.ndarray, X: np.ndarray) -> bool:
    """Whether no more of the rows of `groups` (n, m) follows the steps `X` (n, p) than of noise does."""
    X = X[:, X.any(axis=0)]
    if not X.shape[1] or not groups.any():
        return True
    if len(X) < 10 * X.shape[1]:
        return False
    X = X / np.sqrt(np.mean(X**2, axis=0))
    following = X @ np.linalg.lstsq(X, groups, rcond=1e-9)[0]
    return bool(np.mean(following**2) <= BY_CHANCE * X.shape[1] / len(X) * np.mean(groups**2))


def _louder_somewhere(r: np.ndarray, m: int) -> bool:
    """Whether what is above the new rate is larger in some stretch than noise would be."""
    block = max(BLOCK * m, 64)
    energy = np.mean(r[: len(r) // block * block].reshape(-1, block) ** 2, axis=1)
    return bool(energy.max(initial=0.0) > LOUDER * np.median(energy)) if len(energy) else False


def _above(y: np.ndarray, m: int, phase: int) -> np.ndarray:
    """What every m-th value from `phase` on, low-passed, does not hold of `y`; zero at the ends, where the low-pass is led in."""
    kept = _low_passed(y[phase:], m)
    r = y[phase:] - _between(kept, m, len(y) - phase)
    r[: LED_IN * m] = r[-LED_IN * m :] = 0.0
    return r[LED_IN * m : len(r) - LED_IN * m]


def _low_passed(y: np.ndarray, m: int) -> np.ndarray:
    return np.asarray(resample_poly(y, 1, m, window=_taps(m), padtype="line"))


def _between(kept: np.ndarray, m: int, rows: int) -> np.ndarray:
    """The curve of which every m-th value is kept."""
    return np.asarray(resample_poly(kept, m, 1, window=_taps(m), padtype="line")[:rows])


@cache
def _taps(m: int) -> np.ndarray:
    return np.asarray(firwin(2 * LED_IN * m + 1, 1 / m, window=WINDOW))


def _bridged(record: Record, i: int) -> np.ndarray:
    """A reading with straight lines across what is not valid."""
    good = record.valid[:, i]
    if good.all() or not good.any():
        return record.observed[:, i] if good.all() else np.zeros(len(good))
    rows = np.arange(len(good))
    return np.interp(rows, rows[good], record.observed[good, i])


def _range(values: np.ndarray) -> float:
    return float(np.ptp(values)) if len(values) else 0.0


def common(each: Sequence[Thinnable]) -> int:
    """How many rows one may stand for in all records alike, so that their noise stays one."""
    most = min((can.most for can in each), default=1)
    tried = (m for m in (most, *factors(most, 1)) if m <= most and all(can.allows(m) for can in each))
    return next(tried, 1)


def thinned(record: Record, m: int, can: Thinnable) -> Record:
    """One row in m of a record with marked readings: drives as they are held, or their curve; readings averaged.

    A drive that was held a row at a time is half a row later than its values, and so is the curve that it becomes.
    """
    held, phase = can.group is not None, can.first % m
    lead = 1 if held and phase else 0  # a group before the first change
    rows = np.arange(phase - lead * m, len(record.time), m)
    observed = np.empty((len(rows), record.observed.shape[1]))
    valid = np.zeros(observed.shape, bool)
    for i in range(observed.shape[1]):
        y = _bridged(record, i)[phase:]
        starts = np.arange(0, len(y), m)
        mean = (
            np.add.reduceat(y, starts) / np.add.reduceat(np.ones(len(y)), starts) if can.at_once else _low_passed(y, m)
        )
        observed[lead:, i] = mean[: len(rows) - lead]
        there = np.add.reduceat(record.valid[phase:, i], np.arange(0, len(record.time) - phase, m))
        valid[lead:, i] = there[: len(rows) - lead] > LISTED * m
    observed[:lead] = np.nan
    if not can.at_once:
        valid[: lead + LED_IN] = valid[-LED_IN:] = False
    if held:
        drive = record.drive[np.maximum(rows, 0)]
    else:
        drive = np.column_stack([_low_passed(u if record.linear else _half_a_row_later(u), m) for u in record.drive.T])
    ambient = None if record.ambient is None else _low_passed(record.ambient[phase:], m)
    if ambient is not None and lead:
        ambient = np.concatenate([ambient[:1], ambient])
    step = float(record.time[-1] - record.time[0]) / (len(record.time) - 1)
    return replace(
        record,
        time=record.time[0] + step * rows,
        sample_time=record.sample_time * m,
        drive=drive,
        observed=np.where(valid, observed, np.nan),
        valid=valid,
        linear=_in_lines(record) if held else True,
        either=False,  # between rows that are an average of several, straight lines are right
        ambient=None if ambient is None else ambient[: len(rows)],
    )


def _half_a_row_later(u: np.ndarray) -> np.ndarray:
    return 0.5 * (u + np.concatenate([u[:1], u[:-1]]))


def note(record: Record, m: int, rows: int, lost: int) -> str:
    """What was done to a record, in a line."""
    return (
        f"{record.name}: {rows} rows are thinned to {len(record.time)}, each the average of {m} readings: {_because(record)}, and what the "
        f"readings do faster is no answer to the drives. White noise falls by {np.sqrt(m):.3g}"
        + (
            f"; {number_of(lost, 'outlier or stuck reading was', 'outliers and stuck readings were')} left out before."
            if lost
            else "."
        )
    )


def _because(record: Record) -> str:
    return "straight lines between them give the drives" if _in_lines(record) else "the drives are held meanwhile"


def not_thinned(record_name: str, rows: int, why: str) -> str:
    """That a long record stays as it is, and what the reader can do."""
    return (
        f"{record_name}: {rows} rows are used as they are, which takes long, for fewer would lose something: {why}. "
        "`low_pass`, `keep_every` or `rows` make them fewer."
    )

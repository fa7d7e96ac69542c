"""Numbers that begin again from the other end of their range: counters of so many bits, signed counts that were written without their sign,
angles after a whole turn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

BITS = (8, 10, 12, 14, 16, 24, 32)  # of counters
TURN = 360.0  # degrees
JUMP = 0.75  # of the range: what falls so far from one row to the next began again
STEADY = 0.25  # of the range: what moves less between all other rows does not jump otherwise
EVEN = 0.25  # of a step: how exactly a clock that began again goes on
DIFFERENT = 16  # counts, with their sign, from which they are a motion about zero: two ends with noise hold fewer
SLOW = 10.0  # usual steps that such a motion spans at least


AGAIN = {2.0**bits: f"its counter of {bits} bits" for bits in (16, 24, 32)} | {
    size: f"it counts to {size:g} and"
    for size in (60.0, 1e3, 3600.0, 6e4, 86400.0, 1e6, 3.6e6, 8.64e7, 604800.0, 6.048e8)
}
"""After how much a clock begins again: a counter, or what is over whole seconds, minutes, hours, days and weeks, as GPS
counts them, in s and parts of it."""


class Wrapped(NamedTuple):
    """A range after which numbers begin again, in words, and the rows before which they do; whether they are `signed` counts that were
    written without their sign."""

    size: float
    words: str
    rows: np.ndarray
    signed: bool = False

    @property
    def told(self) -> str:
        """What is to be told of them, behind their column and the times that they jump."""
        if not self.signed:
            return f"as numbers do that begin again: write it unwrapped (numpy.unwrap with period={self.size:.15g})"
        mend = f"write {self.size:.15g} less for those from {self.size / 2:.15g} on (numpy.unwrap with period={self.size:.15g})"
        return f"as signed counts do that are written without their sign: {mend}"


def wrapped(values: np.ndarray) -> Wrapped | None:
    """How the numbers (n,) of a column begin again; None where they do not.

    They jump by nearly their whole range, whole numbers that of a counter or others a turn, and move little before, after and elsewhere.
    Numbers that stand still at the ends of their range are full steps of a drive, unless they are a smooth motion about zero as signed
    counts: noise of a few counts about zero jumps in every other row and repeats its numbers.
    """
    known = np.flatnonzero(np.isfinite(values))
    y = values[known]
    if len(y) < 4:
        return None
    low, high = float(y.min()), float(y.max())
    size, words = _range(y, low, high)
    if size == 0.0:
        return None
    steps = np.diff(y)
    jumps = np.abs(steps) > JUMP * size
    if size != TURN and low >= 0 and jumps.any() and _are_signed(y, size):
        return Wrapped(size, words, known[np.flatnonzero(jumps) + 1], signed=True)
    others = np.abs(steps[~jumps])
    if not 0 < jumps.sum() < len(steps) / 4 or others.max() > STEADY * size:
        return None
    through = steps[jumps] - size * np.sign(steps[jumps])
    beside = np.flatnonzero(jumps)
    moving = steps[np.clip(beside - 1, 0, None)] != 0
    if np.abs(through).max() > 2 * max(others.max(), 1.0 if size != TURN else 0.0) or not moving.all():
        return None
    return Wrapped(size, words, known[beside + 1])


def _are_signed(y: np.ndarray, size: float) -> bool:
    """Whether whole numbers (n,) are a slow motion about zero once those of the upper half of their range are taken as negative."""
    signed = np.where(y >= size / 2, y - size, y)
    steps = np.abs(np.diff(signed))
    if len(np.unique(signed)) < DIFFERENT or steps.max() > STEADY * size:
        return False
    crossing = np.diff(signed < 0)
    elsewhere = steps[~crossing].max(initial=1.0)
    return bool(np.ptp(signed) > SLOW * np.median(steps) and steps[crossing].max(initial=0.0) <= 2 * elsewhere)


def _range(y: np.ndarray, low: float, high: float) -> tuple[float, str]:
    """The range of a counter or of a turn that numbers fill; 0 where they fill none."""
    span = high - low
    for bits in BITS:
        size = 2.0**bits
        filled = JUMP * size < span < size and ((low >= 0 and high < size) or (-size / 2 <= low and high < size / 2))
        if filled and np.all(y == np.round(y)):
            return size, f"{bits} bits"
    if JUMP * TURN < span <= TURN and low >= -TURN / 2 and high <= TURN:
        return TURN, "a turn of 360"
    return 0.0, ""


def unwrapped_clock(values: np.ndarray, first: float) -> tuple[np.ndarray, str]:
    """The numbers (n,) of a clock since its `first`, without the falls where it began again (`AGAIN`), and a note; as they are where it
    did not.

    Only where it goes on by its usual step. A clock that begins at zero may be a second record instead, and is left.
    """
    steps = np.diff(values)
    falls = np.flatnonzero(steps < 0)
    if not len(falls) or not np.all(np.isfinite(values)):
        return values, ""
    usual = float(np.median(steps))
    size = next((size for size in AGAIN if np.all(np.abs(steps[falls] + size - usual) <= EVEN * usual)), 0.0)
    if not size or not usual > 0 or first <= usual:
        return values, ""
    turns = np.zeros(len(values))
    turns[falls + 1] = size
    note = f"{AGAIN[size]} begins again before row {falls[0] + 1}"
    note += f" and {len(falls) - 1} more times" if len(falls) > 1 else ""
    return values + np.cumsum(turns), f"{note}: time goes on evenly"

"""Numbers that begin again from the other end of their range: counters of so many bits, angles after a whole turn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

BITS = (8, 10, 12, 14, 16, 24, 32)  # of counters
TURN = 360.0  # degrees
JUMP = 0.75  # of the range: what falls so far from one row to the next began again
STEADY = 0.25  # of the range: what moves less between all other rows does not jump otherwise
EVEN = 0.25  # of a step: how exactly a clock that began again goes on


class Wrapped(NamedTuple):
    """A range after which numbers begin again, in words, and the rows before which they do."""

    size: float
    words: str
    rows: np.ndarray


def wrapped(values: np.ndarray) -> Wrapped | None:
    """How the numbers (n,) of a column begin again; None where they do not.

    They jump by nearly their whole range, whole numbers that of a counter or others a turn, and move little before, after and elsewhere.
    Numbers that stand still at the ends of their range are full steps of a drive.
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
    others = np.abs(steps[~jumps])
    if not 0 < jumps.sum() < len(steps) / 4 or others.max() > STEADY * size:
        return None
    through = steps[jumps] - size * np.sign(steps[jumps])
    beside = np.flatnonzero(jumps)
    moving = steps[np.clip(beside - 1, 0, None)] != 0
    if np.abs(through).max() > 2 * max(others.max(), 1.0 if size != TURN else 0.0) or not moving.all():
        return None
    return Wrapped(size, words, known[beside + 1])


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
    """The whole numbers (n,) of a clock since its `first`, without the falls where its counter of 16 or 32 bits began again, and a note; as
    they are where it did not.

    Only where it goes on by its usual step. A clock that begins at zero may be a second record instead, and is left.
    """
    steps = np.diff(values)
    falls = np.flatnonzero(steps < 0)
    if not len(falls) or not np.all(np.isfinite(values)) or np.any(values != np.round(values)):
        return values, ""
    usual = float(np.median(steps))
    bits = next((b for b in (16, 32) if np.all(np.abs(steps[falls] + 2.0**b - usual) <= EVEN * usual)), 0)
    if not bits or not usual > 0 or first <= usual:
        return values, ""
    turns = np.zeros(len(values))
    turns[falls + 1] = 2.0**bits
    note = f"its counter of {bits} bits begins again before row {falls[0] + 1}"
    note += f" and {len(falls) - 1} more times" if len(falls) > 1 else ""
    return values + np.cumsum(turns), f"{note}: time goes on evenly"

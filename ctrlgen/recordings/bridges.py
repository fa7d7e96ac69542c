"""One drive across rows that are missing: what it tells of them itself, and how far that may be off.

A drive steps, and stands at one value on both sides or steps by a clock; or it turns from one straight line to another; or trials in
rows that are there show how right a straight line is, or a drive as smooth as around.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ctrlgen.recordings import drive_across_gaps
from ctrlgen.recordings.drive_across_gaps import Way

STEPPED = 0.5  # of the samples around differ from the one before, at most, where a drive steps
# steps that tell the clock of a drive that steps: a chance divisor of so many distances is one in thirty
FEWEST_STEPS = 6
DWELLS = 4.0  # times a gap in the usual time between steps, from which on two equal sides have no step between
AROUND = 50  # rows on each side that tell how much a drive changes in as many rows as a gap has
USUAL = 3.0  # times that change, beyond which a drive jumped inside of the gap
RIGHT = 2e-3  # of the range: by so much a smooth bridge may differ from a straight line where that is exact in trials


class Bridge(NamedTuple):
    """The drive (rows,) in a gap, taken by `way`, and how far it may be `off` [range of the drive]; infinite where nothing tells it."""

    values: np.ndarray
    off: float
    way: Way


class DriveWithGaps:
    """One drive (n,), NaN where it is not known."""

    def __init__(self, u: np.ndarray) -> None:
        self.u = u
        self.span = float(np.nanmax(u) - np.nanmin(u))
        change = np.diff(u) != 0
        pairs = np.isfinite(u[1:]) & np.isfinite(u[:-1])
        self.moves = np.where(pairs, change, np.nan)
        alone = pairs[1:-1] & change[1:-1] & ~change[:-2] & ~change[2:]
        steps = np.flatnonzero(alone) + 2
        sizes = np.abs(u[steps] - u[steps - 1])
        self.usual_step = float(np.median(sizes) / self.span) if len(steps) else 0.0
        self.step = int(steps[0]) if len(steps) else 0
        self.clock = int(np.gcd.reduce(np.diff(steps))) if len(steps) > FEWEST_STEPS else 1
        self.dwell = float(np.median(np.diff(steps))) if len(steps) > 1 else len(u)

    def across(self, a: int, b: int) -> Bridge:
        """The drive in rows a to b, half open."""
        if np.isfinite(self.u[a:b]).all():  # another drive is missing
            return Bridge(self.u[a:b], 0.0, "held")
        around = self.moves[max(a - AROUND, 0) : b + AROUND]
        stepped = np.nanmean(around) <= STEPPED if np.isfinite(around).any() else False
        if not stepped:
            return self._as_elsewhere(a, b)
        ramps = (self.moves[max(a - 2, 0) : a - 1] == 1).any() or (self.moves[b : b + 1] == 1).any()
        return self._straight(a, b) if ramps else self._held(a, b)

    def _held(self, a: int, b: int) -> Bridge:
        """A drive that mostly stands still: at the one value of both sides, or from one to the other where its clock strikes once, else
        at some moment."""
        before, after, length = self.u[a - 1], self.u[b], b - a
        strikes = [k for k in range(a, b + 1) if (k - self.step) % self.clock == 0] if self.clock > 1 else []
        if before == after:
            told = length <= self.dwell / DWELLS or (self.clock > 1 and len(strikes) <= 1)
            return Bridge(np.full(length, before), 0.0 if told else self.usual_step, "held")
        if len(strikes) == 1:
            return Bridge(np.where(np.arange(a, b) < strikes[0], before, after), 0.0, "held")
        linear = drive_across_gaps.across(self.u, a, b, "linear")
        return Bridge(linear, abs(after - before) / self.span, "linear")

    def _straight(self, a: int, b: int) -> Bridge:
        """A drive that stands still or goes straight, perhaps with a corner in the gap: off by what either side, gone on with, says."""
        linear, rows = drive_across_gaps.across(self.u, a, b, "linear"), np.arange(b - a)
        ways = np.nan_to_num(
            [self.u[a - 1] - self.u[a - 2], self.u[b + 1] - self.u[b]] if b + 1 < len(self.u) else [0.0, 0.0]
        )
        on = self.u[a - 1] + ways[0] * (rows + 1), self.u[b] - ways[1] * (rows[::-1] + 1)
        return Bridge(linear, min(np.abs(linear - v).max() for v in on) / self.span, "linear")

    def _as_elsewhere(self, a: int, b: int) -> Bridge:
        """A drive that moves: linear or smooth, whichever is right in trials around."""
        ways: tuple[Way, ...] = ("linear", "smooth")
        errors = {way: drive_across_gaps.error(self.u, a, b, way) for way in ways}
        values = {way: drive_across_gaps.across(self.u, a, b, way) for way in ways}
        best = min(ways, key=lambda way: errors[way])
        # beside a step, what is smooth elsewhere goes astray
        apart = float(np.abs(values["smooth"] - values["linear"]).max()) / self.span
        if apart > USUAL * errors["linear"] + RIGHT:
            best = "linear"
        jump = abs(self.u[b] - self.u[a - 1]) / self.span if self._jumps(a, b) else 0.0
        return Bridge(values[best], max(errors[best], jump), best)

    def _jumps(self, a: int, b: int) -> bool:
        """Whether it changes more across rows a to b than around in as many rows."""
        apart = b - a + 1
        sides = (self.u[max(a - AROUND - apart, 0) : a], self.u[b : b + AROUND + apart])
        near = np.concatenate([np.abs(side[apart:] - side[:-apart]) for side in sides])
        usual = np.max(near[np.isfinite(near)], initial=0.0)
        return bool(abs(self.u[b] - self.u[a - 1]) > USUAL * usual)

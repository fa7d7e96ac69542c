"""Samples of one channel that must not count: isolated outliers, and stretches where the sensor stuck or clipped.

They are marked, never replaced.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ctrlgen.numerics.quantisation_step import quantisation_step

MAD = 1.4826  # standard deviation over median absolute value, normal distribution


@dataclass(frozen=True)
class OutlierSettings:
    """When a sample or a few count as an isolated outlier."""

    threshold: float = 8.0
    """Local standard deviations by which each lies off the chord between its neighbours."""
    widest: int = 3
    """Samples in an outlier; what lasts longer may be motion."""
    fewest: int = 50
    """Finite samples below which there is no local noise to compare with."""
    fewest_whole: float = 0.5
    """Share of the rows with a number in both neighbours too, below which the median of the deviation is that of straight lines."""
    window: int = 201
    """Samples over which the noise counts as local."""
    side: int = 4
    """Samples on either side that are compared with a straight line."""
    on_line: float = 0.3
    """Share of an outlier's size by which those may lie off the line."""
    least_around: int = 5
    """Samples around, also where the record ends: two make a line, three more tell whether it is one."""
    after_jump: int = 10
    """Samples after a jump of the drive in which the device may do anything."""
    jump: float = 6.0
    """Robust standard deviations of the drive's steps; a larger step is a jump."""
    smallest_jump: float = 0.01
    """Share of the drive's range; a smaller step is none."""
    rounding: float = 1e-9
    """Share of a channel's range: smaller differences are rounding of the file or of a simulation."""


@dataclass(frozen=True)
class StuckSettings:
    """When equal samples in a row count as a sensor that sticks or clips."""

    shortest_run: int = 8
    """Equal samples in a row of a noisy channel."""
    shortest_at_end: int = 5
    """Equal samples in a row at the end of the range."""
    moves: float = 0.05
    """Share of the drive's range by which it moves while the channel does not."""
    fewest_pairs: int = 50
    """Pairs of samples that tell whether a channel is noisy."""
    steps_at_speed: float = 10.0
    """Quantisation steps a sample: the channel is not slowing down."""
    range_at_speed: float = 1e-3
    """Share of the range a sample, likewise."""
    fewest_differences: int = 20
    """Successive differences that tell how often the sign changes."""
    sign_changes: float = 0.25
    """Share of successive differences that change sign: two thirds in white noise, few in motion."""


@dataclass(frozen=True)
class HeldSettings:
    """From how many changes, and of which share of them one rate apart, a channel is known to be held between its readings. Judgement."""

    fewest: int = 20
    usual: float = 0.8


OUTLIERS, STUCK, HELD = OutlierSettings(), StuckSettings(), HeldSettings()


def outliers(values: np.ndarray, drive: np.ndarray) -> np.ndarray:
    """Where one channel `values` (n,) leaves for at most `OUTLIERS.widest` samples and comes back: (n,) bool.

    A stretch of w = 1 ... `OUTLIERS.widest` samples is an outlier where each of them lies off the chord between the samples before
    and after the stretch by more than `OUTLIERS.threshold` sigma, all on one side, and the samples around continue on a straight
    line. sigma is the local median absolute value of the same statistic (w = 1: half the second difference), so it holds
    for coloured noise too. Nothing next to a jump of the `drive` (n, n_u) is marked, nor within ten samples after it: there
    the device itself may move so. NaN is no outlier. A channel that is read so seldom that most rows have a neighbour without a number
    is judged by its readings alone, one after the other: with straight lines between them the median would be that of the lines.
    """
    marked = np.zeros(len(values), dtype=bool)
    finite, near_jump = np.isfinite(values), _near_jump(drive)
    if finite.sum() < OUTLIERS.fewest:
        return marked
    if np.mean(finite[1:-1] & finite[:-2] & finite[2:]) < OUTLIERS.fewest_whole:
        marked[finite] = _off_line(values[finite], near_jump[finite])
        return marked
    return _off_line(values, near_jump)


def _off_line(values: np.ndarray, near_jump: np.ndarray) -> np.ndarray:
    """(n,) the outliers of `values` (n,), few of them without a number."""
    n, marked, finite = len(values), np.zeros(len(values), dtype=bool), np.isfinite(values)
    y = np.interp(np.arange(n), np.flatnonzero(finite), values[finite])  # for the statistic only
    floor = max(quantisation_step(values[finite], fewest=2), OUTLIERS.rounding * np.ptp(y)) / 2
    for width in range(1, OUTLIERS.widest + 1):
        off = _off_chord(y, width)
        sigma = MAD * scipy.ndimage.median_filter(np.abs(off.mean(1)), min(OUTLIERS.window, len(off)), mode="reflect")
        size = np.abs(off).min(1)
        one_sided = np.abs(np.sign(off).sum(1)) == width
        for start in (np.flatnonzero(one_sided & (size > OUTLIERS.threshold * np.maximum(sigma, floor))) + 1).tolist():
            stretch = slice(start, start + width)
            if not near_jump[stretch].any() and finite[stretch].all() and _isolated(y, start, width, size[start - 1]):
                marked[stretch] = True
    return marked


def _off_chord(y: np.ndarray, width: int) -> np.ndarray:
    """Row k: samples k + 1 .. k + width minus the chord from sample k to sample k + width + 1, (m, width)."""
    m = len(y) - width - 1
    before, after = y[:m], y[width + 1 :]
    share = np.arange(1, width + 1) / (width + 1)
    chord = before[:, None] * (1 - share) + after[:, None] * share
    return np.lib.stride_tricks.sliding_window_view(y[1 : m + width], width) - chord


def _isolated(y: np.ndarray, start: int, width: int, size: float) -> bool:
    """Whether the signal goes on after the stretch as it came, which it does not after a step nor while ringing.

    One of the samples around, not adjacent to the stretch, may be another outlier and is left out.
    """
    around = np.r_[max(start - OUTLIERS.side, 0) : start, start + width : min(start + width + OUTLIERS.side, len(y))]
    not_adjacent = around[(around < start - 1) | (around > start + width)]
    return any(_straight(y, around[around != other], start, OUTLIERS.on_line * size) for other in (-1, *not_adjacent))


def _straight(y: np.ndarray, samples: np.ndarray, start: int, within: float) -> bool:
    """Whether enough `samples` are given and all lie `within` a straight line."""
    if len(samples) < OUTLIERS.least_around:
        return False
    line = np.polyfit(samples - start, y[samples], 1)
    return bool(np.abs(y[samples] - np.polyval(line, samples - start)).max() < within)


def _near_jump(drive: np.ndarray) -> np.ndarray:
    """(n,) bool: from one sample before a jump of any drive to ten samples after it."""
    step = np.abs(np.diff(drive, axis=0, prepend=drive[:1]))
    usual = OUTLIERS.jump * MAD * np.median(step, axis=0)
    jump = (step > np.maximum(usual, OUTLIERS.smallest_jump * np.ptp(drive, axis=0)) * (1 + 1e-9)).any(1)
    near = np.convolve(jump, np.ones(OUTLIERS.after_jump + 2), "full")[1 : len(jump) + 1]
    return near > 0


def stuck_samples(observed: np.ndarray, drive: np.ndarray) -> np.ndarray:
    """Where one channel `observed` (n,) repeats itself to the last bit although it should not: (n,) bool.

    A stretch of eight equal samples or more counts where the channel is known to be noisy while the drive rests, or,
    where the drive never rests, where the drive (n, n_u) moves meanwhile and the channel repeats itself nowhere else.
    At the end of the channel's range five samples suffice where the channel is noisy otherwise, or where it ran into the
    end at speed while the drive moved: it is clipped. What else stands there is clipped too, however short.
    Coarsely quantised channels at rest, and stages held by friction, repeat themselves rightly and are not marked.
    """
    marked = np.zeros(len(observed), dtype=bool)
    runs = [(a, b) for a, b in _runs(observed) if b - a >= STUCK.shortest_at_end]
    if not runs or np.nanmin(observed) == np.nanmax(observed):
        return marked
    at_rest, elsewhere, alternates = _noisiness(observed, drive, runs)
    span, ends = np.ptp(drive, axis=0), (np.nanmin(observed), np.nanmax(observed))
    for a, b in runs:
        first_half = drive[a : (a + b) // 2]  # the rest of the stretch may be dead time
        moves = bool((np.ptp(first_half, axis=0) > STUCK.moves * span)[span > 0].any())
        frozen = b - a >= STUCK.shortest_run and (at_rest or (at_rest is None and moves and elsewhere))
        clipped = observed[a] in ends and ((moves and _at_speed(observed, a, b)) or (elsewhere and alternates))
        if clipped:
            marked |= observed == observed[a]
        elif frozen:
            marked[a:b] = True
    return marked


def held_for(observed: np.ndarray, drive: np.ndarray) -> int:
    """The rows for which one channel `observed` (n,) is held, where it changes in one row of so many alone while the drive (n, n_u)
    moves in others too: it was read at a lower rate. 1 where it is not held."""
    changes = np.flatnonzero(observed[1:] != observed[:-1]) + 1
    apart = np.diff(changes)
    if len(apart) < HELD.fewest or not np.isfinite(observed).all():
        return 1
    rows = int(np.gcd.reduce(apart))
    moving = np.flatnonzero((np.diff(drive, axis=0) != 0).any(axis=1)) + 1
    followed = len(moving) == 0 or bool(np.all((moving - moving[0]) % rows == 0))
    return 1 if followed or np.mean(apart == rows) < HELD.usual else rows


def _runs(y: np.ndarray) -> list[tuple[int, int]]:
    """Half-open stretches of equal finite samples."""
    ends = np.flatnonzero(~(y[1:] == y[:-1])) + 1  # NaN equals nothing
    edges = np.r_[0, ends, len(y)]
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def _noisiness(y: np.ndarray, drive: np.ndarray, runs: list[tuple[int, int]]) -> tuple[bool | None, bool, bool]:
    """Whether successive samples differ while the drive rests (None: it never does) and outside the runs, and whether the
    differences outside the runs alternate in sign as noise does."""
    equal = y[1:] == y[:-1]
    inside = np.zeros(len(y) - 1, dtype=bool)
    for a, b in runs:
        inside[a : b - 1] = True
    resting = (np.diff(drive, axis=0) == 0).all(1)
    at_rest = None
    if resting.sum() >= STUCK.fewest_pairs:
        at_rest = bool(
            equal[resting].mean() < 0.5 and equal[resting & ~inside].mean() < 0.2 and _alternates(y, resting)
        )
    elsewhere = bool((~inside).sum() >= STUCK.fewest_pairs and equal[~inside].mean() < 0.2)
    return at_rest, elsewhere, _alternates(y, ~inside)


def _alternates(y: np.ndarray, chosen: np.ndarray) -> bool:
    """Whether successive differences change sign as often as those of noise do; settling and ringing seldom do."""
    step = np.where(chosen & np.isfinite(y[1:]) & np.isfinite(y[:-1]), np.diff(y), 0.0)
    both = (step[1:] != 0) & (step[:-1] != 0)
    return bool(both.sum() >= STUCK.fewest_differences and (step[1:] * step[:-1] < 0)[both].mean() > STUCK.sign_changes)


def _at_speed(y: np.ndarray, a: int, b: int) -> bool:
    """Whether the stretch y[a:b] was entered or left at speed, not by slowing down."""
    step = quantisation_step(y[np.isfinite(y)], fewest=2)
    speed = max(STUCK.steps_at_speed * step, STUCK.range_at_speed * (np.nanmax(y) - np.nanmin(y)))
    sides = [(a - 2, a - 1)] * (a >= 2) + [(b, b + 1)] * (b + 1 < len(y))
    return any(abs(y[j] - y[i]) >= speed for i, j in sides)

"""Samples that must not count: spikes of the instrument and stretches where it stuck or clipped. Found, never filled."""

from __future__ import annotations

import numpy as np
import scipy

SPIKE = 8.0  # standard deviations of the local high-pass noise
WIDEST = 3  # samples in a spike; what lasts longer may be motion
WINDOW = 201  # samples over which noise is called local
LEAST_AROUND = 5  # samples beside a spike, also where the record ends: two make a line, three tell whether it is one
AFTER_JUMP = 10  # samples after a jump of the drive in which the device may do anything
STUCK = 8  # equal samples in a row
RAIL_RUN = 5  # equal samples in a row at the end of the range


def outliers(observed: np.ndarray, drive: np.ndarray) -> np.ndarray:
    """Where one channel `observed` (n,) leaves for at most three samples and comes back: (n,) bool.

    A stretch of w = 1, 2 or 3 samples is a spike where every one of them stands off the chord between the samples
    before and after it by more than 8 sigma, on one side, and the neighbours do not. sigma is the local median
    absolute value of the same statistic (w = 1: half the second difference), hence right for coloured noise too.
    Nothing next to a jump of the `drive` (n, n_u) is marked, nor what follows it within ten samples. NaN is no spike.
    """
    n = len(observed)
    marked = np.zeros(n, dtype=bool)
    finite = np.isfinite(observed)
    if finite.sum() < 50:  # no local noise to speak of
        return marked
    y = np.interp(np.arange(n), np.flatnonzero(finite), observed[finite])  # for the statistic only
    floor = quantum(y) / 2
    moved = _near_jump(drive)
    for width in range(1, WIDEST + 1):
        off = _off_chord(y, width)
        sigma = 1.4826 * scipy.ndimage.median_filter(np.abs(off.mean(1)), min(WINDOW, len(off)), mode="reflect")
        size = np.abs(off).min(1)
        one_sided = np.abs(np.sign(off).sum(1)) == width
        for start in np.flatnonzero(one_sided & (size > SPIKE * np.maximum(sigma, floor))) + 1:
            block = slice(start, start + width)
            if not moved[block].any() and finite[block].all() and _isolated(y, start, width, size[start - 1]):
                marked[block] = True
    return marked


def _off_chord(y: np.ndarray, width: int) -> np.ndarray:
    """Row k: samples k + 1 .. k + width minus the chord from k to k + width + 1, (m, width)."""
    m = len(y) - width - 1
    before, after = y[:m], y[width + 1 :]
    share = np.arange(1, width + 1) / (width + 1)
    chord = before[:, None] * (1 - share) + after[:, None] * share
    return np.lib.stride_tricks.sliding_window_view(y[1 : m + width], width) - chord


def _isolated(y: np.ndarray, start: int, width: int, size: float) -> bool:
    """Whether the signal goes on after the stretch as it came: a step does not, nor does ringing. One sample around, not
    beside it, may be another spike."""
    around = np.r_[max(start - 4, 0) : start, start + width : min(start + width + 4, len(y))]
    apart = around[(around < start - 1) | (around > start + width)]
    return any(_straight(y, around[around != other], start, 0.3 * size) for other in (-1, *apart))


def _straight(y: np.ndarray, at: np.ndarray, start: int, within: float) -> bool:
    """Whether the samples `at` lie on one line."""
    if len(at) < LEAST_AROUND:
        return False
    line = np.polyfit(at - start, y[at], 1)
    return bool(np.abs(y[at] - np.polyval(line, at - start)).max() < within)


def _near_jump(drive: np.ndarray) -> np.ndarray:
    """(n,) bool: one sample before a jump of any drive to ten after it."""
    step = np.abs(np.diff(drive, axis=0, prepend=drive[:1]))
    usual = 6 * 1.4826 * np.median(step, axis=0)
    jump = (step > np.maximum(usual, 0.01 * np.ptp(drive, axis=0)) * (1 + 1e-9)).any(1)
    near = np.convolve(jump, np.ones(AFTER_JUMP + 2), "full")[1 : len(jump) + 1]
    return near > 0


def quantum(y: np.ndarray) -> float:
    """The smallest step between samples that occurs, but rounding; 0 where nothing moves."""
    step = np.abs(np.diff(y))
    step = step[step > 1e-9 * np.ptp(y)] if len(step) else step
    return float(step.min()) if len(step) else 0.0


def stuck_samples(observed: np.ndarray, drive: np.ndarray) -> np.ndarray:
    """Where one channel `observed` (n,) repeats itself to the last bit although it should not: (n,) bool.

    A stretch of eight equal samples or more counts where the channel is seen to be noisy with the drive at rest, or,
    no rest being there to tell, where the drive (n, n_u) moves meanwhile and the channel repeats itself nowhere else.
    At the end of the channel's range five suffice where the channel is noisy otherwise, or ran into the end at speed while
    the drive moved: clipping.
    Coarsely quantised channels at rest, and stages held by friction, repeat themselves rightly and are left alone.
    """
    marked = np.zeros(len(observed), dtype=bool)
    runs = [(a, b) for a, b in _runs(observed) if b - a >= RAIL_RUN]
    if not runs or np.nanmin(observed) == np.nanmax(observed):
        return marked
    noisy = _noisy(observed, drive, runs)
    span, ends = np.ptp(drive, axis=0), (np.nanmin(observed), np.nanmax(observed))
    for a, b in runs:
        moves = bool(
            (np.ptp(drive[a : (a + b) // 2], axis=0) > 0.05 * span)[span > 0].any()
        )  # the end may be dead time
        frozen = b - a >= STUCK and (noisy["rest"] or (noisy["rest"] is None and moves and noisy["elsewhere"]))
        clipped = observed[a] in ends and (
            (moves and _at_speed(observed, a, b)) or (noisy["elsewhere"] and noisy["shakes"])
        )
        if frozen or clipped:
            marked[a:b] = True
    return marked


def _runs(y: np.ndarray) -> list[tuple[int, int]]:
    """Half-open stretches of equal finite samples."""
    ends = np.flatnonzero(~(y[1:] == y[:-1])) + 1  # NaN equals nothing
    edges = np.r_[0, ends, len(y)]
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def _noisy(y: np.ndarray, drive: np.ndarray, runs: list[tuple[int, int]]) -> dict[str, bool | None]:
    """Whether neighbouring samples differ, `rest` with the drive at rest (None: no rest seen), `elsewhere` out of the runs;
    `shakes` whether they differ as noise does."""
    equal = y[1:] == y[:-1]
    inside = np.zeros(len(y) - 1, dtype=bool)
    for a, b in runs:
        inside[a : b - 1] = True
    resting = (np.diff(drive, axis=0) == 0).all(1)
    rest = None
    if resting.sum() >= 50:
        rest = bool(equal[resting].mean() < 0.5 and equal[resting & ~inside].mean() < 0.2 and _shakes(y, resting))
    elsewhere = bool((~inside).sum() >= 50 and equal[~inside].mean() < 0.2)
    return {"rest": rest, "elsewhere": elsewhere, "shakes": _shakes(y, ~inside)}


def _shakes(y: np.ndarray, where: np.ndarray) -> bool:
    """Whether steps change sign as often as noise does: white two of three times, settling and ringing seldom."""
    step = np.where(where & np.isfinite(y[1:]) & np.isfinite(y[:-1]), np.diff(y), 0.0)
    both = (step[1:] != 0) & (step[:-1] != 0)
    return bool(both.sum() >= 20 and (step[1:] * step[:-1] < 0)[both].mean() > 0.25)


def _at_speed(y: np.ndarray, a: int, b: int) -> bool:
    """Whether y[a:b] was reached or left at speed, not by slowing down."""
    speed = max(10 * quantum(y[np.isfinite(y)]), 1e-3 * (np.nanmax(y) - np.nanmin(y)))
    sides = [(a - 2, a - 1)] * (a >= 2) + [(b, b + 1)] * (b + 1 < len(y))
    return any(abs(y[j] - y[i]) >= speed for i, j in sides)

"""Drives as a piecewise cubic curve: uniform cubic B-splines, joined where a limit switches or the drive has a kink.

In a piece of n samples and M segments, sample k lies at k M/n: segment j, remainder t in [0, 1). With the blending
functions of the uniform cubic B-spline (C. de Boor, A Practical Guide to Splines, ch. IX), times six,

    u_i(t) = (1-t)^3 c_{j,i} + (4 + 3 t^2 (t-2)) c_{j+1,i} + ... + t^3 c_{j+3,i},    the four functions adding up to 6

a piece has continuous curvature and costs M + 3 rows; a closed path without a join is periodic. The C counts k M in 32 bits: a piece of
more ends where that does.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, sqrt

import numpy as np
import scipy

from ctrlgen.devices.limit import ranges
from ctrlgen.firmware.c.real import Real

DENSE = 400  # samples of a piece up to which the dense solver is as fast; it also takes rank-deficient fits
AT_LIMIT = 1e-6  # of a drive's range: nearer to a bound the drive counts as at the bound (IPOPT stays 1e-8 away)
KINK = 2.5  # times the median of the neighbouring fourth differences: a possible kink of the curvature
NOISE = 1e-3  # of the tolerance: floor of that median
JOIN = 4  # rows that one more piece costs, its entry in the table of pieces included
MOST_KINKS = 64
PLACES = 2**32  # values of k M in the C, which looks for the segment of a sample in words of 32 bits


@dataclass(frozen=True)
class Piece:
    """Samples `start` to `stop`: `segments` of equal length, `control` (rows, axes) the control points divided by six."""

    start: int
    stop: int
    segments: int
    control: np.ndarray


@dataclass(frozen=True)
class Spline:
    """Pieces that cover all samples; `periodic` when the single piece continues into itself."""

    pieces: tuple[Piece, ...]
    periodic: bool

    kind = "cubic"

    @property
    def samples(self) -> int:
        """Number of samples of the path."""
        return self.pieces[-1].stop

    @property
    def axes(self) -> int:
        """Number of drives of each sample."""
        return self.pieces[0].control.shape[1]

    @property
    def block_bits(self) -> int:
        """Bits of an index inside a block: the largest blocks in which not more than one piece begins."""
        starts = np.array([p.start for p in self.pieces[1:]], dtype=int)
        bits = (self.samples - 1).bit_length()
        while bits and any(np.bincount(starts[starts % 2**bits > 0] >> bits, minlength=1) > 1):
            bits -= 1
        return bits

    @property
    def blocks(self) -> list[int]:
        """The piece that the first sample of each block is in."""
        at = np.arange(0, self.samples, 2**self.block_bits)
        return (np.searchsorted([p.start for p in self.pieces], at, side="right") - 1).tolist()

    @property
    def control(self) -> np.ndarray:
        """(rows, axes): the control points of all pieces, one after the other."""
        return np.vstack([p.control for p in self.pieces])

    @property
    def first_rows(self) -> list[int]:
        """The row of each piece's first control point."""
        return [0, *np.cumsum([len(p.control) for p in self.pieces])[:-1].tolist()]

    @property
    def word(self) -> int:
        """Bytes of a sample or row number."""
        return 2 if max(self.samples, len(self.control)) < 2**16 else 4

    @property
    def block_word(self) -> int:
        """Bytes of the number of a piece."""
        return 1 if len(self.pieces) <= 2**8 else self.word

    def bytes(self, real: Real) -> int:
        """Constants of the C, padding not counted."""
        search = len(self.blocks) * self.block_word + len(self.pieces) * (4 * self.word + real.bytes)
        return self.control.size * real.bytes + (search if len(self.pieces) > 1 else 0)

    @property
    def operations(self) -> int:
        """Arithmetic operations of one sample: place, blending functions, seven a drive; the search of a piece."""
        return 5 + 11 + 7 * self.axes + (5 if len(self.pieces) > 1 else 0)

    def extremes(self) -> tuple[np.ndarray, np.ndarray]:
        """(axes,) bounds of every value: a B-spline lies between its control points."""
        return 6 * self.control.min(axis=0), 6 * self.control.max(axis=0)

    def values(self, real: Real) -> np.ndarray:
        """(samples, axes): the drives, in the operations and the order of the C."""
        return self.interpolated(np.arange(self.samples), np.zeros(self.samples), real)

    def interpolated(self, k: np.ndarray, fraction: np.ndarray, real: Real) -> np.ndarray:
        """(n, axes): the drives at k + fraction, 0 <= fraction < 1: on the curve, or linear where the next sample is in another piece."""
        number = np.float32 if real is Real.FLOAT else np.float64
        starts = [p.start for p in self.pieces]
        piece, after = np.searchsorted(starts, k, side="right") - 1, (k + 1) % self.samples
        same = (np.searchsorted(starts, after, side="right") - 1 == piece) & (after > k)
        joined = self.periodic | same | (fraction == 0)
        if not np.all(joined):
            low, high = self.values(real)[k], self.values(real)[after]
            straight = low + fraction.astype(number)[:, None] * (high - low)
            return np.where(joined[:, None], self.interpolated(k, np.where(joined, fraction, 0.0), real), straight)
        start, count, length, row = (
            np.array(column)[piece]
            for column in zip(
                *(
                    (p.start, p.segments, p.stop - p.start, r)
                    for p, r in zip(self.pieces, self.first_rows, strict=True)
                ),
                strict=True,
            )
        )
        place = (k - start) * count
        segment = place // length
        rest = (place - segment * length).astype(number) + fraction.astype(number) * count.astype(number)
        over = rest >= length.astype(number)
        rest = np.where(over, rest - length.astype(number), rest)
        segment = np.where(over, segment + 1, segment)
        segment = np.where(segment >= count, 0, segment)
        t = (rest * (1.0 / length).astype(number))[:, None]
        v, square = number(1) - t, t * t
        w0, w3 = v * v * v, square * t
        w1 = number(4) + number(3) * square * (t - number(2))
        w2 = number(6) - (w0 + w1 + w3)
        c = self.control.astype(number)
        j = row + segment
        return (w0 * c[j]) + (w1 * c[j + 1]) + (w2 * c[j + 2]) + (w3 * c[j + 3])


def switches(drive: np.ndarray, low: np.ndarray, high: np.ndarray) -> list[int]:
    """Samples k at which a drive reaches or leaves a bound between k - 1 and k."""
    span = ranges((low, high), np.ptp(drive, axis=0))
    held = np.hstack([drive <= low + AT_LIMIT * span, drive >= high - AT_LIMIT * span])
    return (np.flatnonzero(np.any(held[1:] != held[:-1], axis=1)) + 1).tolist()


def kinks(drive: np.ndarray, scale: np.ndarray) -> list[int]:
    """Samples near which the curvature may jump: fourth differences above those around them."""
    if len(drive) < 16:
        return []
    jump = np.max(np.abs(np.diff(drive, 4, axis=0)) / scale, axis=1)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(jump, 8, mode="reflect"), 17)
    ratio = jump / np.maximum(np.median(windows, axis=1), NOISE)
    peaks = np.flatnonzero((ratio > KINK) & (jump >= windows[:, 5:12].max(axis=1)))
    highest = sorted(peaks.tolist(), key=lambda k: -jump[k])[:MOST_KINKS]
    return sorted({k + shift for k in highest for shift in (1, 2, 3)})


def fit(drive: np.ndarray, low: np.ndarray, high: np.ndarray, tolerance: np.ndarray, closed: bool) -> Spline | None:
    """The spline of fewest rows found within `tolerance` (axes,) of `drive` (samples, axes); None where a table is no longer.

    The pieces begin at the limits' switches, and at kinks as long as merging two neighbours does not need fewer rows; and where a longer
    one had more than `PLACES`.
    """
    n = len(drive)
    fixed = set(switches(drive, low, high))
    around = _segments(drive, tolerance, True, n) + 3 if closed and not fixed else n
    if around < n and _parts(n, around - 3) > 1:
        around = n
    edges, count = _counted(drive, tolerance, [0, *sorted({*fixed, *kinks(drive, tolerance)}), n])
    merged: dict[tuple[int, int], int] = {}
    while True:
        best, place = 0, None
        for i, b in enumerate(edges[1:-1]):
            a, c, most = edges[i], edges[i + 2], count[i] + count[i + 1] + JOIN
            if b not in fixed:
                if (a, c) not in merged:
                    together = _segments(drive[a:c], tolerance, False, most)
                    merged[a, c] = together if _parts(c - a, together) == 1 else most + 1
                if place is None or most - merged[a, c] > best:
                    best, place = most - merged[a, c], i
        if place is None or best < 0:
            break
        count[place : place + 2] = [merged[edges[place], edges[place + 2]]]
        del edges[place + 1]
    rows = sum(count) + 3 * len(count)
    if min(rows, around) >= n:
        return None
    if around <= rows:
        return Spline((Piece(0, n, around - 3, _control(drive, around - 3, True) / 6),), True)
    spans = zip(edges, edges[1:], count, strict=False)
    return Spline(tuple(Piece(a, b, m, _control(drive[a:b], m, False) / 6) for a, b, m in spans), False)


def _parts(samples: int, segments: int) -> int:
    """The fewest equal pieces, each with its share of the segments, that a piece must be cut into to have `PLACES` at most."""
    return ceil(sqrt(samples * segments / PLACES))


def _counted(drive: np.ndarray, tolerance: np.ndarray, edges: list[int]) -> tuple[list[int], list[int]]:
    """Edges of pieces, those among `edges` and more where a piece had too many places, and the segments of each piece."""
    kept, counts, waiting = [edges[0]], [], list(pairwise(edges))[::-1]
    while waiting:
        a, b = waiting.pop()
        count = _segments(drive[a:b], tolerance, False, b - a)
        parts = _parts(b - a, count)
        if parts > 1:
            cuts = [a + (b - a) * i // parts for i in range(parts + 1)]
            waiting.extend(list(pairwise(cuts))[::-1])
        else:
            kept.append(b)
            counts.append(count)
    return kept, counts


def _segments(drive: np.ndarray, tolerance: np.ndarray, periodic: bool, most: int) -> int:
    """The fewest equal segments within `tolerance`; one more than `most` where so many are not enough."""
    n = len(drive)

    def within(segments: int) -> bool:
        # More control points than samples: as many rows as the table.
        if n > DENSE and segments + 3 * (not periodic) > n:
            return False
        fitted = _blending(n, segments, periodic) @ _control(drive, segments, periodic)
        return bool(np.all(np.abs(fitted - drive).max(axis=0) <= tolerance))

    low, high = 0, 4 if periodic else 1
    while high < most and not within(high):
        low, high = high, 2 * high
    if high >= most:
        high = most
        if not within(most):
            return most + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if within(middle) else (middle, high)
    return high


def _control(drive: np.ndarray, segments: int, periodic: bool) -> np.ndarray:
    """(segments + 3, axes): the least-squares control points, about the mean."""
    A, mean = _blending(len(drive), segments, periodic), drive.mean(axis=0)
    wrap = None
    if periodic:
        wrap = scipy.sparse.csr_matrix(
            (np.ones(segments + 3), (np.arange(segments + 3), np.arange(segments + 3) % segments))
        )
        A = A @ wrap
    if len(drive) <= DENSE:
        c = np.linalg.lstsq(A.toarray(), drive - mean, rcond=1e-12)[0]
    else:
        c = scipy.sparse.linalg.spsolve((A.T @ A).tocsc(), A.T @ (drive - mean)).reshape(-1, drive.shape[1])
    return (c if wrap is None else wrap @ c) + mean


def _blending(n: int, segments: int, periodic: bool) -> scipy.sparse.csr_matrix:
    """(n, segments + 3): the blending functions at the samples."""
    k = np.arange(n)
    j = k * segments // n
    t = (k * segments - j * n) / n
    weights = np.stack([(1 - t) ** 3, 4 + 3 * t**2 * (t - 2), 1 + 3 * t * (1 + t * (1 - t)), t**3]) / 6
    return scipy.sparse.csr_matrix(
        (weights.ravel(), (np.tile(k, 4), np.concatenate([j, j + 1, j + 2, j + 3]))), (n, segments + 3)
    )

"""Stretches of a held-out record whose noise counts as independent, and what they show of an effect beside other numbers.

Stretches are as long as `LUCK.memories` correlation times of the noise, with a gap of `LUCK.gap` of them before each, and longer where
the effect is small: so that each holds as much of it as any, an event in a few samples as well as a stiffness. A settled pose is a
stretch. Where they begin is told by the records to fit and by the drive, never by the held-out readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from ctrlgen.diagnosis.settings import LUCK
from ctrlgen.diagnosis.shares.blocks import correlation_time
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.quiet_stretches import period_of
from ctrlgen.recordings.recording import Record

GAP = -1
"""Label of a sample between stretches."""


@dataclass(frozen=True)
class Memory:
    """Correlation time [s] of what a model leaves; `repeats`: it is more than noise, so that it comes again where the drive does."""

    time: float
    repeats: bool


def memory_of(fitter: Fitter, fit: Fit) -> Memory:
    """The longest correlation time of any channel and record to fit of the whitened residual of `fit`; zero where that is white to
    `LUCK.white` standard deviations of its correlation from sample to sample, and for settled poses."""
    longest = 0.0
    for record in fitter.fit_records:
        if record.poses:
            continue
        left = np.where(record.valid, record.observed - fitter.predict(fit, record), 0.0)
        white, usable = fitter.error.whiten(left, record.valid), fitter.error.usable(record.valid)
        longest = max(
            longest, *(_samples(e[seen]) * record.sample_time for e, seen in zip(white.T, usable.T, strict=True))
        )
    return Memory(longest, not fitter.error.is_noise)


def _samples(white: np.ndarray) -> int:
    """Correlation time [samples] of a whitened residual (n,): 0 where it is white."""
    e = white - np.mean(white) if len(white) > 1 else np.zeros(2)
    if abs(float(e[1:] @ e[:-1])) <= LUCK.white / np.sqrt(len(e)) * float(e @ e):
        return 0
    return correlation_time(e)


def stretches(record: Record, energy: np.ndarray, memory: Memory) -> np.ndarray:
    """The number (n,) of the stretch of each sample of `record`, `GAP` between them, for the `energy` (n,) of an effect.

    Where what is left comes again with a periodic drive, the same phase of every period is one stretch.
    """
    if record.poses:
        return _labels(energy, 1, 0)
    time = memory.time / record.sample_time
    gap = int(np.ceil(LUCK.gap * time - 1e-9))
    least = max(gap + int(np.ceil(LUCK.memories * time - 1e-9)), 1)
    period = period_of(record) if memory.repeats else None
    samples = 0 if period is None else round(period / record.sample_time)
    if not 0 < samples < len(energy):
        return _labels(energy, least, gap)
    phase = np.arange(len(energy)) % samples
    return _labels(np.bincount(phase, energy, samples), least, gap)[phase]


def _labels(energy: np.ndarray, least: int, gap: int) -> np.ndarray:
    """Labels (n,) of stretches of at least so many samples, its gap included, each with an equal part of the `energy` (n,) if it can."""
    n, cumulative = len(energy), np.concatenate([[0.0], np.cumsum(energy)])
    each = cumulative[-1] / LUCK.most_stretches
    edges = [0]
    while n - edges[-1] >= 2 * least:
        filled = int(np.searchsorted(cumulative, cumulative[edges[-1]] + each * (1 - 1e-9)))
        end = max(edges[-1] + least, filled)
        if n - end < least:
            break
        edges.append(end)
    labels = np.zeros(n, int)
    labels[edges[1:]] = 1
    labels = np.cumsum(labels)
    for begin in edges if gap else ():
        labels[begin : begin + gap] = GAP
    return labels


@dataclass(frozen=True, eq=False)
class Whitened:
    """Of the m whitened readings of a record that are in a stretch: what a model leaves (m,), an `effect` (m,), their slopes by its
    parameters (m, k) and by the record's initial states (m, n_s) in standard deviations of these, and the number (m,) of the stretch."""

    left: np.ndarray
    effect: np.ndarray
    slopes: np.ndarray
    starts: np.ndarray
    labels: np.ndarray


def matched_innovations(records: Sequence[Whitened]) -> np.ndarray:
    """t_b (b,), the innovations of what is left times those of the effect, summed over each stretch of all records.

    The innovation of a stretch is what the ones before do not foretell of it, over its deviation, where parameters and initial states
    are known to `LUCK.doubt` standard deviations at first, and better from stretch to stretch: with A_b = A_0 + the sum of J'J up to
    b, c_b that of J'left and d_b that of J'effect,

        t_b = left_b' effect_b - (c_b' A_b^-1 d_b - c_(b-1)' A_(b-1)^-1 d_(b-1)).

    Of normal noise they are independent whatever those numbers are; of other noise all but the first ones are nearly its own.
    """
    k = records[0].slopes.shape[1]
    A, c, parts = np.eye(k) / LUCK.doubt**2, np.zeros((k, 2)), []
    for record in records:
        # the initial states are those of this record alone
        n_s = record.starts.shape[1]
        A, c = block_diag(A, np.eye(n_s) / LUCK.doubt**2), np.vstack([c, np.zeros((n_s, 2))])
        both, all_slopes = np.column_stack([record.left, record.effect]), np.hstack([record.slopes, record.starts])
        before = _taken(A, c)
        for b in range(int(record.labels.max(initial=GAP)) + 1):
            at = record.labels == b
            J, Y = all_slopes[at], both[at]
            A, c = A + J.T @ J, c + J.T @ Y
            taken = _taken(A, c)
            parts.append(Y[:, 0] @ Y[:, 1] - (taken - before))
            before = taken
        of_starts = np.linalg.solve(A[k:, k:], np.hstack([A[k:, :k], c[k:]])) if n_s else np.zeros((0, k + 2))
        A, c = A[:k, :k] - A[:k, k:] @ of_starts[:, :k], c[:k] - A[:k, k:] @ of_starts[:, k:]
    return np.array(parts)


def _taken(A: np.ndarray, c: np.ndarray) -> float:
    """c' A^-1 d of c and d, the columns of (k, 2)."""
    return float(c[:, 0] @ np.linalg.solve(A, c[:, 1])) if len(A) else 0.0

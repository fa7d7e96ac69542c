"""Samples drawn from long records, blocks longer than the residual's correlation time, and their folds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import fftconvolve

from ctrlgen.diagnosis.settings import SHARES


@dataclass(frozen=True, eq=False)
class Blocks:
    """N drawn samples of all records: their `rows` in each record, and of each sample its `record`, `block` and `fold`.

    `length`: samples of a block at the records' rate.
    """

    rows: tuple[np.ndarray, ...]
    record: np.ndarray
    block: np.ndarray
    fold: np.ndarray
    length: int

    @property
    def count(self) -> int:
        """Number of blocks of all records."""
        return int(self.block.max(initial=-1)) + 1

    def drawn(self, parts: Sequence[np.ndarray]) -> np.ndarray:
        """The drawn samples of one array (n, ...) a record, (N, ...)."""
        return np.concatenate([part[rows] for part, rows in zip(parts, self.rows, strict=True)])

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Sums of `values` (N,) by block."""
        return np.bincount(self.block, values, self.count)


def correlation_time(values: np.ndarray) -> int:
    """First lag [samples] at which the autocorrelation of `values` (n,) falls below `SHARES.correlated`."""
    x = np.nan_to_num(values - np.nanmean(values)) if np.isfinite(values).any() else np.zeros(len(values))
    acf = fftconvolve(x, x[::-1])[len(x) - 1 :]
    low = np.flatnonzero(acf <= SHARES.correlated * acf[0])
    return int(low[0]) if acf[0] > 0 and len(low) else 1


def make_blocks(residuals: Sequence[np.ndarray], settled: bool, seed: int = 0) -> Blocks:
    """Blocks for residuals (n, n_c) a record, NaN where not valid.

    One sample is drawn at random from each of at most `SHARES.most_samples` equal stretches, so that no phase of a periodic
    drive is missed. A block is as long as `SHARES.correlation_times` correlation times of the channel with the longest.
    """
    total = sum(map(len, residuals))
    longest = max(correlation_time(y) for part in residuals for y in part.T)
    least = 2 if settled else 1
    count = int(total // max(SHARES.correlation_times * longest, least))
    count = min(int(np.clip(count, SHARES.fewest_blocks, SHARES.most_blocks)), total)
    length = total / count
    stretch = max(total / SHARES.most_samples, 1.0)
    rng = np.random.default_rng(seed)
    rows, blocks, first = [], [], 0
    for part in residuals:
        n = len(part)
        edges = np.arange(0, n, stretch)
        ends = np.minimum(edges + stretch, n)
        drawn = np.unique(np.minimum((edges + rng.random(len(edges)) * (ends - edges)).astype(int), n - 1))
        drawn = drawn if stretch > 1 else np.arange(n)
        n_blocks = int(np.ceil(n / length - 0.01))
        rows.append(drawn)
        blocks.append(first + np.minimum(drawn * n_blocks // n, n_blocks - 1))
        first += n_blocks
    block = np.concatenate(blocks)
    record = np.repeat(np.arange(len(rows)), list(map(len, rows)))
    return Blocks(tuple(rows), record, block, block % min(SHARES.folds, first), round(length))

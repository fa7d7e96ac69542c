"""What a fit leaves, block by block of the records: the squares by which candidate models are compared.

Blocks are long beside the memory of a residual, so that they count as independent; each settled pose is a block.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from ctrlgen.estimation.error_model import huber
from ctrlgen.estimation.noise import Noise
from ctrlgen.estimation.settings import DISCREPANCY
from ctrlgen.recordings.recording import Record


@dataclass(frozen=True, eq=False)
class Misfit:
    """Squares of the residual over those of the noise, summed over each of b blocks, all (b, n_y).

    `plain`: (e/floor)^2, over `n_plain` valid samples. `white`: Huber's loss of the whitened residual, so scaled that normal
    noise has mean 1, over `n_white` usable samples.
    """

    plain: np.ndarray
    white: np.ndarray
    n_plain: np.ndarray
    n_white: np.ndarray

    @property
    def plain_mean(self) -> np.ndarray:
        """Mean (n_y,) of the plain squares: 1 for noise."""
        return self.plain.sum(axis=0) / np.maximum(self.n_plain.sum(axis=0), 1)

    @property
    def white_mean(self) -> np.ndarray:
        """Mean (n_y,) of the whitened loss: 1 for noise."""
        return self.white.sum(axis=0) / np.maximum(self.n_white.sum(axis=0), 1)

    @property
    def excess(self) -> float:
        """Plain squares beyond those of noise, of all channels."""
        return float(np.sum(np.maximum(self.plain.sum(axis=0) - self.n_plain.sum(axis=0), 0.0)))


def misfit(noise: Noise, records: Sequence[Record], residuals: Sequence[np.ndarray]) -> Misfit:
    """The squares of `residuals` [(n, n_y) SI] of `records`; of one that has diverged, those of `LARGEST`."""
    rows = [_of_record(noise, r, e) for r, e in zip(records, residuals, strict=True)]
    n_y = len(noise.sd)
    parts = zip(*rows, strict=True) if rows else ([np.zeros((0, n_y))],) * 4
    return Misfit(*(np.vstack(part) for part in parts))


# squares that stand for larger or undefined ones
LARGEST = 1e30


def _of_record(noise: Noise, record: Record, residual: np.ndarray) -> tuple[np.ndarray, ...]:
    e = np.where(record.valid, np.nan_to_num(residual, nan=1e150, posinf=1e150, neginf=-1e150), 0.0)
    with np.errstate(over="ignore"):
        plain = np.minimum((e / noise.floor) ** 2, LARGEST)
        white = np.clip(np.nan_to_num(noise.whiten(e, record.valid), nan=1e15, posinf=1e15), -1e15, 1e15)
    corner = np.full(e.shape[1], DISCREPANCY.huber_corner)
    loss = huber(white, corner)[0] ** 2 / _huber_mean(DISCREPANCY.huber_corner)
    # a lead-in is not judged
    seen = np.flatnonzero(record.valid.any(axis=1))
    n = len(seen)
    blocks = n if record.poses else min(DISCREPANCY.blocks, n)
    edges = seen[np.linspace(0, n, blocks + 1).astype(int)[:-1]] if n else np.zeros(1, int)
    values = (plain, loss, record.valid.astype(float), noise.usable(record.valid).astype(float))
    return tuple(np.add.reduceat(v, edges, axis=0) for v in values)


def _huber_mean(c: float) -> float:
    """Mean of Huber's loss of a standard normal variable: E r^2 inside the corner, 2 c |r| - c^2 outside."""
    tail, density = stats.norm.sf(c), stats.norm.pdf(c)
    return float((1 - 2 * tail - 2 * c * density) + 2 * (2 * c * density - c**2 * tail))

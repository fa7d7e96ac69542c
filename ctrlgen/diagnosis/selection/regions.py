"""Regions: where along a quantity of the motion most of what is left over is, by a test whose level holds over all of them.

The samples are sorted by a quantity x into cells of as many samples each. A region is what lies beyond an edge between two cells, or
between two edges. The free numbers of the fitted model follow the samples outside alone (its linearisation r + J dp, with the
stated numbers' prior), so that what happens inside bends nothing; with the mean squares M of that residual inside and outside,

    B = p q (M_in - M_out)^2/M^2 where M_in > M_out,   M = p M_in + q M_out,

p and q the shares of the samples: what two levels explain of the variance of the squares. A ringing device carries what happens in a
region out of it, so that squares and not their logarithms are compared.

Residuals whose stretches in time are in random order belong to no region. B counts in its mean of these, and along each quantity in
the largest that one of them in twenty has there. A region is one where it is larger than theirs is anywhere, in any region of any
quantity (maximum statistic over permuted blocks: A. Davison, D. Hinkley, Bootstrap Methods and Their Application (1997), 4.3;
localisation of a discrepancy before it is named: arXiv 2606.23215). Whether a law acts there, fits decide.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from ctrlgen.diagnosis.settings import REGIONS
from ctrlgen.estimation.error_model import correlation_time
from ctrlgen.estimation.fit import Fit

Quantity = TypeVar("Quantity", bound=Hashable)


@dataclass(frozen=True, eq=False)
class Leftover:
    """What a fitted model leaves on the records to fit, sample by sample: whitened `residual` (n, n_y) and its slopes (n, n_y, k) by
    the free numbers, which the rows `prior` (m,) with their slopes `held` (m, k) hold."""

    residual: np.ndarray
    slopes: np.ndarray
    prior: np.ndarray
    held: np.ndarray

    @classmethod
    def of(cls, fit: Fit) -> Leftover:
        """What `fit` leaves."""
        n_y = fit.shapes[0][1]
        m, k = sum(n * n_y for n, _ in fit.shapes), fit.J.shape[1]
        return cls(fit.residual[:m].reshape(-1, n_y), fit.J[:m].reshape(m // n_y, n_y, k), fit.residual[m:], fit.J[m:])


@dataclass(frozen=True)
class Region:
    """Where most of a residual is: `low` to `high` [SI] of a quantity, infinite at an open end; `contrast` B, over the one that chance
    exceeds in one recording of a hundred, for any region."""

    low: float
    high: float
    contrast: float


def find_regions(
    left: Leftover, along: Mapping[Quantity, np.ndarray], stretches: Collection[Quantity] = (), seed: int = 0
) -> dict[Quantity, tuple[Region, ...]]:
    """By quantity x (n,) of `along` the regions in which clearly more is left than outside, the most conspicuous first; of `stretches`
    among them what lies between two edges, of the others what lies beyond one. None where chance does as much."""
    n, n_y, k = left.slopes.shape
    step = max(n * n_y // REGIONS.most_rows, 1)
    kept = np.arange(0, n - n % (REGIONS.cells * step), step)
    usable = {name: x[kept] for name, x in along.items() if len(kept) and np.ptp(x[kept]) > 0}
    if len(kept) < REGIONS.cells * REGIONS.fewest_in_cell or not usable:
        return {}
    r = left.residual[kept]
    # a few outliers are no region
    most = np.quantile(np.abs(r), REGIONS.outlying)
    r = r.clip(-most, most)
    rows = np.concatenate([r[None], _shuffled(r, seed)])
    found: dict[Quantity, tuple[np.ndarray, _Contrasts]] = {}
    for name, x in usable.items():
        order = np.argsort(x, kind="stable")
        cells = _Cells(rows[:, order], left.slopes[kept][order].reshape(len(kept) * n_y, k), left)
        edges = x[order][(np.arange(1, REGIONS.cells) * len(kept)) // REGIONS.cells]
        found[name] = np.concatenate([[-np.inf], edges, [np.inf]]), cells.contrasts(name in stretches)
    chance = max(float(contrasts.of_chance[:, 1:].max()) for _, contrasts in found.values())
    regions = {name: contrasts.highest(edges, max(chance, 1e-300)) for name, (edges, contrasts) in found.items()}
    return {name: each for name, each in regions.items() if each}


def _shuffled(r: np.ndarray, seed: int) -> np.ndarray:
    """The residual (draws, n, n_y) with its stretches in random order, begun anywhere; each is longer than its memory."""
    rng, n = np.random.default_rng(seed), len(r)
    memory = max(correlation_time([e]) for e in r.T)
    length = int(min(max(n / REGIONS.blocks, REGIONS.memories * memory, 1), max(n / REGIONS.fewest_blocks, 1)))
    blocks = [np.arange(n)[i : i + length] for i in range(0, n, length)]
    orders = [
        np.roll(np.concatenate([blocks[j] for j in rng.permutation(len(blocks))]), rng.integers(n))
        for _ in range(REGIONS.draws)
    ]
    return r[np.array(orders)]


class _Cells:
    """Sums over cells of as many samples each of what the contrasts need, for the residual (first) and its shuffles."""

    def __init__(self, rows: np.ndarray, J: np.ndarray, left: Leftover) -> None:
        r = rows.reshape(len(rows), REGIONS.cells, -1)
        J = J.reshape(REGIONS.cells, r.shape[2], J.shape[1])
        self.held = left.held.T @ left.held
        # nothing has moved the numbers of a shuffle
        self.pull = np.zeros((J.shape[2], len(rows)))
        self.pull[:, 0] = left.held.T @ left.prior
        self.gram = np.einsum("cik,cil->ckl", J, J)
        self.slope = np.einsum("cik,dci->ckd", J, r, optimize=True)
        self.squares = np.einsum("dci,dci->cd", r, r)

    def contrasts(self, stretches: bool) -> _Contrasts:
        """Those of the regions between two edges, or beyond one."""
        m = REGIONS.cells
        i, j = np.triu_indices(m + 1, 1)
        length = j - i
        beyond = ((i == 0) | (j == m)) & (m - length >= REGIONS.least_outside * m)
        between = (i > 0) & (j < m) & (length <= REGIONS.longest * m)
        chosen = (length >= REGIONS.shortest) & (between if stretches else beyond)
        i, j = i[chosen], j[chosen]
        G, g, s = (np.concatenate([0 * a[:1], np.cumsum(a, axis=0)]) for a in (self.gram, self.slope, self.squares))
        inside = [a[j] - a[i] for a in (G, g, s)]
        outside = [a[-1] - b for a, b in zip((G, g, s), inside, strict=True)]
        scale = np.sqrt(np.maximum(np.diagonal(self.held + G[-1]), 1e-300))
        A = (outside[0] + self.held) / np.outer(scale, scale) + REGIONS.ridge * np.eye(len(scale))
        dp = np.linalg.solve(A, (outside[1] + self.pull) / scale[:, None]) / scale[:, None]
        left = [
            np.maximum(s - 2 * np.sum(dp * g, axis=1) + np.einsum("ekd,ekl,eld->ed", dp, G, dp, optimize=True), 1e-300)
            for G, g, s in (inside, outside)
        ]
        p = ((j - i) / m)[:, None]
        M_in, M_out = left[0] / p, left[1] / (1 - p)
        B = np.where(M_in > M_out, p * (1 - p) * ((M_in - M_out) / (left[0] + left[1])) ** 2, 0.0)
        return _Contrasts(i, j, B, M_out[:, 0], M_in[:, 0] > REGIONS.least_ratio * M_out[:, 0])


@dataclass(frozen=True, eq=False)
class _Contrasts:
    """`B` (e, draws) of the regions from edge `i` to edge `j` (e,); of the residual itself the mean square outside, `quiet` (e,), and
    whether that inside is clearly larger."""

    i: np.ndarray
    j: np.ndarray
    B: np.ndarray
    quiet: np.ndarray
    clear: np.ndarray

    @cached_property
    def of_chance(self) -> np.ndarray:
        """B (e, draws) in its mean of the shuffles there, for few samples outside tell the numbers poorly, and that in the largest which
        one shuffle in twenty has anywhere along the quantity."""
        usual = np.mean(self.B[:, 1:], axis=1)
        z = self.B / np.maximum(usual, max(float(np.mean(usual)), 1e-300))[:, None]
        return z / max(float(np.quantile(z[:, 1:].max(axis=0), REGIONS.usual_quantile)), 1e-300)

    def highest(self, edges: np.ndarray, chance: float) -> tuple[Region, ...]:
        """The regions that stand out most, above `chance`: one stretch after the other, or on either side of an edge."""
        seen = self.clear & (self.of_chance[:, 0] > chance)
        ends = np.isinf(edges[self.i]), np.isinf(edges[self.j])
        chosen: list[int] = []
        if not (ends[0] | ends[1]).any():
            while len(chosen) < REGIONS.most and seen.any():
                k = int(np.argmax(np.where(seen, self.B[:, 0], -1.0)))
                chosen.append(k)
                # what overlaps it is the same
                seen = seen & ((self.j <= self.i[k]) | (self.i >= self.j[k]))
        for side in (seen & end for end in ends if end.any()):
            if side.any():
                loudest = int(np.argmax(np.where(side, self.B[:, 0], -1.0)))
                # a law that grows from nothing at its edge is loud farther out
                silent = side & (self.quiet <= REGIONS.silent * self.quiet[side].min())
                shortest = int(np.argmin(np.where(silent, self.j - self.i, REGIONS.cells + 1)))
                chosen += dict.fromkeys((loudest, shortest))
        found = (
            Region(float(edges[self.i[k]]), float(edges[self.j[k]]), float(self.of_chance[k, 0] / chance))
            for k in chosen
        )
        return tuple(found)

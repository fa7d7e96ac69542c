"""Ridge regression on chosen columns, predicted out of block.

For each fold k the coefficients b_k minimise |y - m - X b|^2/n + ridge |b|^2 over the other folds; the samples of the fold
are predicted with their signals clamped to the range seen in the others, so that nothing is extrapolated. The ridge is the
one with the smallest sum of squares out of block. A. E. Hoerl, R. W. Kennard, Technometrics 12 (1970) 55; blocks instead of
single samples: P. Burman, E. Chow, D. Nolan, Biometrika 81 (1994) 351.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.linalg.lapack import dposv

from ctrlgen.diagnosis.settings import SHARES
from ctrlgen.diagnosis.shares.blocks import Blocks
from ctrlgen.diagnosis.shares.design import Design


@dataclass(frozen=True, eq=False)
class OutOfBlock:
    """Out-of-block `prediction` (N,), its sum of squared errors by block, and the model of each fold: the columns that it
    uses, the coefficients (p,) and the constant."""

    prediction: np.ndarray
    squares: np.ndarray
    columns: np.ndarray
    models: tuple[tuple[np.ndarray, float], ...]


class Folds:
    """The columns X (N, P) of a design divided into training and test samples, `usable` (N,) of them. For many channels."""

    def __init__(self, design: Design, blocks: Blocks, usable: np.ndarray) -> None:
        self.X, self.blocks, self.usable = np.ascontiguousarray(design.X.T), blocks, usable
        self.count = int(blocks.fold.max()) + 1
        self.train = np.array([usable & (blocks.fold != k) for k in range(self.count)])
        self.test = np.array([usable & (blocks.fold == k) for k in range(self.count)])
        self.gram = [(seen := self.X[:, train]) @ seen.T for train in self.train]
        self.mean = [self.X[:, train].mean(axis=1) for train in self.train]
        self.tested = [design.clamped(train, test) for train, test in zip(self.train, self.test, strict=True)]

    def with_columns(self, extra: Sequence[np.ndarray]) -> FoldsOfChannel:
        """These folds with further columns `extra` (N, q), one array a fold."""
        return FoldsOfChannel(self, extra)


class FoldsOfChannel:
    """Folds with the columns that one channel alone has, which may differ from fold to fold; counted on from the common ones."""

    def __init__(self, common: Folds, extra: Sequence[np.ndarray]) -> None:
        self.common, self.n_common = common, len(common.X)
        self.extra = [np.ascontiguousarray(E.T) for E in extra]
        self._known: tuple[np.ndarray, list[np.ndarray]] | None = None
        self.gram, self.mean, self.tested = [], [], []
        for k, E in enumerate(self.extra):
            train, test = common.train[k], common.test[k]
            seen = E[:, train]
            cross = common.X @ np.where(train, E, 0.0).T
            self.gram.append(np.block([[common.gram[k], cross], [cross.T, seen @ seen.T]]))
            self.mean.append(np.concatenate([common.mean[k], seen.mean(axis=1)]))
            self.tested.append(np.clip(E[:, test].T, seen.min(axis=1), seen.max(axis=1)).T)

    def constant(self, y: np.ndarray) -> OutOfBlock:
        """The prediction by the mean alone."""
        return self.fit(np.zeros(0, int), np.tile(y, (self.common.count, 1)))

    def fit(self, columns: np.ndarray, targets: np.ndarray, free: np.ndarray | None = None) -> OutOfBlock:
        """`targets` (folds, N), one a fold, predicted from some columns and a mean, and from columns `free`, whose coefficients
        are held by `SHARES.free_ridge` at the most."""
        if free is None or not len(free):
            return self._fit(columns, targets, 0)
        return self._fit(np.concatenate([free, columns]), targets, len(free))

    def left(self, fit: OutOfBlock, targets: np.ndarray) -> np.ndarray:
        """What the model of each fold leaves of its target, (folds, N)."""
        X = self._columns(fit.columns)
        return np.array(
            [y - level - b @ X(k) for k, (y, (b, level)) in enumerate(zip(targets, fit.models, strict=True))]
        )

    def _columns(self, columns: np.ndarray) -> Callable[[int], np.ndarray]:
        """The chosen columns (p, N) of fold k as a function of k."""
        shared, extra = columns < self.n_common, columns[columns >= self.n_common] - self.n_common
        X = np.empty((len(columns), self.common.X.shape[1]))
        X[shared] = self.common.X[columns[shared]]

        def of_fold(k: int) -> np.ndarray:
            X[~shared] = self.extra[k][extra]
            return X

        return of_fold

    def _products(self, targets: np.ndarray) -> list[np.ndarray]:
        """sum over the training samples of x y for every column, one (P,) a fold; those of the last targets are kept."""
        if self._known is None or self._known[0] is not targets:
            known = []
            for k, (train, y) in enumerate(zip(self.common.train, targets, strict=True)):
                seen = np.where(train, y, 0.0)
                known.append(np.concatenate([self.common.X @ seen, self.extra[k] @ seen]))
            self._known = targets, known
        return self._known[1]

    def _tested(self, columns: np.ndarray, k: int) -> np.ndarray:
        """The chosen columns of the test samples of fold k, clamped to what the others have seen."""
        shared = columns < self.n_common
        X = np.empty((len(columns), int(self.common.test[k].sum())))
        X[shared] = self.common.tested[k][columns[shared]]
        X[~shared] = self.tested[k][columns[~shared] - self.n_common]
        return X

    def _fit(self, columns: np.ndarray, targets: np.ndarray, n_free: int) -> OutOfBlock:
        """The fit of which the first `n_free` columns are free."""
        common, is_free = self.common, np.arange(len(columns)) < n_free
        products = self._products(targets) if len(columns) else [np.zeros(0)] * common.count
        predicted = np.zeros((len(SHARES.ridges), targets.shape[1]))
        models = []
        for k in range(common.count):
            train, test, y = common.train[k], common.test[k], targets[k]
            n, level = int(train.sum()), float(y[train].mean())
            mean = self.mean[k][columns]
            G = self.gram[k][np.ix_(columns, columns)] / n - np.outer(mean, mean)
            c = products[k][columns] / n - level * mean
            tested = self._tested(columns, k) - mean[:, None]
            slopes = []
            for i, ridge in enumerate(SHARES.ridges):
                held = G + np.diag(np.where(is_free, min(ridge, SHARES.free_ridge), ridge))
                b = dposv(held, c)[1] if len(c) else c
                predicted[i, test] = level + b @ tested
                slopes.append((b, level - float(b @ mean)))
            models.append(slopes)
        # out of block each sample has the target of its own fold
        target = targets[common.blocks.fold, np.arange(targets.shape[1])]
        errors = np.where(common.usable, (target - predicted) ** 2, 0.0)
        best = int(np.argmin(errors.sum(axis=1)))
        chosen = tuple(slopes[best] for slopes in models)
        return OutOfBlock(predicted[best], common.blocks.sums(errors[best]), columns, chosen)


def standard_error(by_block: np.ndarray) -> float:
    """Standard error of the sum of independent values (B,), one a block."""
    return float(by_block.std(ddof=1) * np.sqrt(len(by_block))) if len(by_block) > 1 else np.inf


def stands_out(gain: np.ndarray) -> bool:
    """Whether decreases of the squares (B,), one a block, are more than chance gives with `SHARES.chance_p`.

    By chance a block's decrease is as likely as an increase of the same size, so that their sum is compared with sums of
    random signs (R. A. Fisher, The Design of Experiments (1935), sec. 21). Blocks with much energy and with little may differ.
    """
    chance = _signs(len(gain)) @ gain
    return bool(np.mean(chance >= gain.sum()) < SHARES.chance_p)


@cache
def _signs(count: int) -> np.ndarray:
    """Random signs (draws, count), the same in each call."""
    return np.random.default_rng(0).choice([-1.0, 1.0], (SHARES.sign_draws, count))


def bootstrap_interval(gain: np.ndarray, energy: np.ndarray, seed: int = 0) -> tuple[float, float]:
    """95 % interval of sum(gain)/sum(energy) from resampled blocks (B,), within 0 ... 1. B. Efron, Ann. Statist. 7 (1979) 1."""
    B = len(gain)
    weights = np.random.default_rng(seed).multinomial(B, np.full(B, 1 / B), SHARES.draws)
    whole = weights @ energy
    drawn = np.divide(weights @ gain, whole, out=np.zeros(len(weights)), where=whole > 0)
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(np.clip(low, 0, 1)), float(np.clip(high, 0, 1))

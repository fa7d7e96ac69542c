"""What a case's answer says of dominant causes: the share of the mismatch of each, and the least error that is left without them.

E(S) is the energy, over the noise's, that a model leaves on the held-out record when it has the dominant causes S exactly, no
others, and its stated numbers x refitted on the record to fit, held by what its file states of them:

    x = argmin |r|^2/s^2 + |(x - off)/sd|^2,   s = max(rms(r), 1), r the residual over the noise,

s estimated in turn with x. A share is of the error before, which is that of the device as its file has it. Free of the file, numbers
would bend to take what is missing: a radius stated to 0.3 % by a fifth, and the error and its shares are those of no such device. The
share of cause k is its Shapley value (L. Shapley, 1953)

    phi_k = mean over orders of [E(before k) - E(after k)]/E(nothing).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from battery.plant_axis import Array

Pair = tuple[Array, Array]  # of the record to fit and of the one held out, (n, channels) over the noise
# Of the Gauss-Newton refit with the sensitivities of the plain plant, for each estimate of what the model leaves
ROUNDS = 8
ESTIMATES = 30  # of what the model leaves, at the most
SAME = 0.01  # relative change of it at which it stays
NEGLIGIBLE = 1e-6  # decrease of the sum of squares that ends a refit
HALVINGS = 5  # of a step that leaves more than before


@dataclass(frozen=True)
class Stated:
    """What a file states of the numbers (k,): `off`, its values less the true ones, and its deviations `sd`, over the true values."""

    off: Array
    sd: Array


@dataclass(frozen=True)
class Attribution:
    """`shares` by cause, their sum with the rest is 1, and their `parts` in each channel; `error`: rms over the noise's, left with all
    dominant causes exact; `before`: without any, and of that the `before_parts` of each channel, in squares, whose sum is 1."""

    shares: list[float]
    parts: list[list[float]]
    error: float
    before: float
    before_parts: list[float]


def refit(observed: Array, model: Callable[[Array], Array], columns: Array, stated: Stated) -> Array:
    """Numbers x (k,), relative to the true ones, that bring model(x) nearest to `observed` (n, channels), held by what is `stated`;
    `columns` (n channels, k): sensitivities at 0."""
    x, before = stated.off.copy(), 0.0
    for _ in range(ESTIMATES if len(x) else 0):
        left = max(float(np.sqrt(np.mean((observed - model(x)) ** 2))), 1.0)
        if abs(left - before) < SAME * left:
            break
        x, before = _held(lambda x, s=left: (observed - model(x)).ravel() / s, columns / left, stated, x), left
    return x


def _held(residual: Callable[[Array], Array], columns: Array, stated: Stated, x: Array) -> Array:
    """The refit from x, of a weighted `residual`."""
    held = np.vstack([columns, np.diag(1 / stated.sd)])

    def rows(x: Array) -> Array:
        return np.concatenate([residual(x), (stated.off - x) / stated.sd])

    rest = rows(x)
    for _ in range(ROUNDS):
        step = np.linalg.lstsq(held, rest, rcond=None)[0]
        tried = (x + step / 2**k for k in range(HALVINGS + 1))
        left = ((y, rows(y)) for y in tried)
        better = next(((y, r) for y, r in left if r @ r < rest @ rest), None)
        if better is None:
            break
        done = better[1] @ better[1] > (1 - NEGLIGIBLE) * (rest @ rest)
        x, rest = better
        if done:
            break
    return x


def attribute(
    observed: Pair,
    model: Callable[[frozenset[int], Array, int], Array],
    columns: Array,
    stated: Stated,
    causes: int,
    zeros: bool,
) -> Attribution:
    """The attribution of `causes` dominant causes.

    model(S, x, record): readings (n, channels) of record 0 (to fit) or 1 (held out) with the causes S and the numbers x, over the
    noise. `zeros`: whether each record's zero points are free, so that constants count for nothing.
    """

    def centred(y: Array) -> Array:
        return y - y.mean(axis=0) if zeros else y

    shape = observed[0].shape
    flat = np.empty_like(columns)
    for k, column in enumerate(columns.T):
        flat[:, k] = centred(column.reshape(shape)).ravel()

    def left(present: frozenset[int]) -> Array:
        """The mean square of each channel over their number: the sum is that of all readings."""
        x = refit(centred(observed[0]), lambda x: centred(model(present, x, 0)), flat, stated)
        return np.mean(centred(observed[1] - model(present, x, 1)) ** 2, axis=0) / shape[1]

    everyone = frozenset(range(causes))
    energy = {S: left(S) for S in subsets(causes)}
    nothing = energy[frozenset()]
    parts = np.array([shapley(energy, k, causes) for k in range(causes)]) / nothing.sum()
    return Attribution(
        parts.sum(axis=1).tolist(),
        parts.tolist(),
        float(np.sqrt(energy[everyone].sum())),
        float(np.sqrt(nothing.sum())),
        (nothing / nothing.sum()).tolist(),
    )


def subsets(n: int) -> list[frozenset[int]]:
    """All sets of `n` causes."""
    return [frozenset(S) for size in range(n + 1) for S in combinations(range(n), size)]


def shapley(energy: dict[frozenset[int], Array], k: int, n: int) -> Array:
    """What cause `k` of `n` takes away of the energy of each channel, the mean over orders."""
    without: Sequence[frozenset[int]] = [S for S in energy if k not in S]
    return sum((energy[S] - energy[S | {k}]) / (n * comb(n - 1, len(S))) for S in without)

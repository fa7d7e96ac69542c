"""What a case's answer says of dominant causes: the share of the mismatch of each, and the least error that is left without them.

E(S) is the energy, over the noise's, that a model leaves on the held-out record when it has the dominant causes S exactly, no
others, and its stated numbers refitted on the record to fit. The share of cause k is its Shapley value (L. Shapley, 1953)

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
ROUNDS = 8  # of the Gauss-Newton refit with the sensitivities of the plain plant
HALVINGS = 5  # of a step that leaves more than before
# Singular values, over the largest, that are errors of difference quotients: stiffness, mass, damping and force alike change nothing
INDEPENDENT = 1e-5


@dataclass(frozen=True)
class Attribution:
    """`shares` by cause, their sum with the rest is 1; `error`: rms over the noise's, left with all dominant causes exact."""

    shares: list[float]
    error: float
    before: float


def refit(observed: Array, model: Callable[[Array], Array], columns: Array) -> Array:
    """Numbers x (k,), relative, that bring model(x) nearest to `observed`; `columns` (n, k): its sensitivities at 0."""
    x = np.zeros(columns.shape[1])
    rest = (observed - model(x)).ravel()
    for _ in range(ROUNDS if len(x) else 0):
        step = np.linalg.lstsq(columns, rest, rcond=INDEPENDENT)[0]
        tried = (np.clip(x + step / 2**k, -0.5, 0.5) for k in range(HALVINGS + 1))
        left = ((y, (observed - model(y)).ravel()) for y in tried)
        better = next(((y, r) for y, r in left if r @ r < rest @ rest), None)
        if better is None:
            break
        x, rest = better
    return x


def attribute(
    observed: Pair, model: Callable[[frozenset[int], Array, int], Array], columns: Array, causes: int, zeros: bool
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

    def left(present: frozenset[int]) -> float:
        x = refit(centred(observed[0]), lambda x: centred(model(present, x, 0)), flat)
        return float(np.mean(centred(observed[1] - model(present, x, 1)) ** 2))

    everyone = frozenset(range(causes))
    energy = {S: left(S) for S in subsets(causes)}
    nothing = energy[frozenset()]
    return Attribution(
        [shapley(energy, k, causes) / nothing for k in range(causes)],
        float(np.sqrt(energy[everyone])),
        float(np.sqrt(nothing)),
    )


def subsets(n: int) -> list[frozenset[int]]:
    """All sets of `n` causes."""
    return [frozenset(S) for size in range(n + 1) for S in combinations(range(n), size)]


def shapley(energy: dict[frozenset[int], float], k: int, n: int) -> float:
    """What cause `k` of `n` takes away, the mean over orders."""
    without: Sequence[frozenset[int]] = [S for S in energy if k not in S]
    return sum((energy[S] - energy[S | {k}]) / (n * comb(n - 1, len(S))) for S in without)

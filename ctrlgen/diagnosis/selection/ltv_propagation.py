"""How the terms of all columns spread through a linearised device: D+ = F_S D + F_p f, y = H_S D + H_p f.

A disturbance moves only the states that are coupled with the place where it enters, and only some channels read those:
states that act on one another are a group, each group carries the columns that enter it, each channel those it can see.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse.csgraph import connected_components

from ctrlgen.diagnosis.selection.candidate_terms import CandidateTerm

Run = tuple[slice, slice]


class _Group:
    """States that act on one another, with the columns that move them: `D` (states, columns) before the next sample."""

    def __init__(self, states: np.ndarray, F_p: np.ndarray, columns: Sequence[CandidateTerm]) -> None:
        self.states = states
        moved = [any(F_p[states, probe].any() for probe in c.probes) for c in columns]
        self.columns = np.flatnonzero(moved)
        self.entries = [
            (k, probe, _runs(*pairs))
            for probe, pairs in _entries(columns, self.columns).items()
            for k, state in enumerate(states)
            if F_p[state, probe]
        ]
        self.D = np.zeros((len(states), len(self.columns)))

    def advance(self, F_S: np.ndarray, F_p: np.ndarray, f: np.ndarray) -> np.ndarray:
        """D before each of the n samples of a block, (n, states, columns)."""
        X = np.zeros((len(f) + 1, *self.D.shape))
        X[0] = self.D
        for k, probe, runs in self.entries:
            for into, term in runs:
                X[1:, k, into] += F_p[:, self.states[k], probe, None] * f[:, term]
        block = np.ascontiguousarray(F_S[:, self.states[:, None], self.states])
        for k in range(len(f)):
            X[k + 1] += block[k] @ X[k]
        self.D = X[-1]
        return X[:-1]


class LtvPropagation:
    """The columns' slopes of the readings, block by block of samples.

    `patterns`: which entries of F_S, F_p, H_S and H_p can differ from zero. `seen[i]`: the columns that channel i reads.
    """

    def __init__(self, patterns: Sequence[np.ndarray], columns: Sequence[CandidateTerm]) -> None:
        F_S, F_p, H_S, H_p = patterns
        count, label = connected_components(F_S, directed=False)
        self.groups = [_Group(np.flatnonzero(label == g), F_p, columns) for g in range(count)]
        self.groups = [g for g in self.groups if len(g.columns)]
        self.seen, self.through, self.direct = [], [], []
        for row, direct in zip(H_S, H_p, strict=True):
            sees = np.array([any(direct[probe] for probe in c.probes) for c in columns], bool)
            for group in self.groups:
                sees[group.columns] |= row[group.states].any()
            seen = np.flatnonzero(sees)
            self.seen.append(seen)
            self.through.append(
                [
                    (g, k, _runs(np.searchsorted(seen, group.columns), np.arange(len(group.columns))))
                    for g, group in enumerate(self.groups)
                    for k, state in enumerate(group.states)
                    if row[state]
                ]
            )
            self.direct.append(
                [(probe, _runs(*pairs)) for probe, pairs in _entries(columns, seen).items() if direct[probe]]
            )

    def readings(self, linear: Sequence[np.ndarray], f: np.ndarray, following: np.ndarray) -> Iterator[np.ndarray]:
        """What each channel reads of the columns it sees, (n, columns), for the terms `f` (n, terms) of a block.

        `linear`: F_S, F_p, H_S, H_p (n, ., .); what drives the states is the mean of f and of f at the `following` sample.
        """
        F_S, F_p, H_S, H_p = linear
        mean = (f + following) / 2
        states = [group.advance(F_S, F_p, mean) for group in self.groups]
        for i, seen in enumerate(self.seen):
            Y, part = np.zeros((len(f), len(seen))), np.empty((len(f), len(seen)))
            for g, k, runs in self.through[i]:
                h = H_S[:, i, self.groups[g].states[k], None]
                for into, column in runs:
                    Y[:, into] += np.multiply(h, states[g][:, k, column], out=part[:, into])
            for probe, runs in self.direct[i]:
                for into, term in runs:
                    Y[:, into] += np.multiply(H_p[:, i, probe, None], f[:, term], out=part[:, into])
            yield Y


def _entries(columns: Sequence[CandidateTerm], chosen: np.ndarray) -> dict[int, tuple[list[int], list[int]]]:
    """The entries by probe: the places among the `chosen` columns of those that enter there, and the terms that do."""
    entries: dict[int, tuple[list[int], list[int]]] = {}
    for place, j in enumerate(chosen):
        for probe, term in zip(columns[j].probes, columns[j].terms, strict=True):
            places, terms = entries.setdefault(probe, ([], []))
            places.append(place)
            terms.append(term)
    return entries


def _runs(first: Sequence[int] | np.ndarray, second: Sequence[int] | np.ndarray) -> list[Run]:
    """Pairs of slices for two lists of places, each as long as both go on by one."""
    a, b = np.asarray(first, int), np.asarray(second, int)
    ends = np.flatnonzero((np.diff(a) != 1) | (np.diff(b) != 1)) + 1
    firsts, lasts = [0, *ends], [*ends, len(a)]
    return [
        (slice(int(a[i]), int(a[i]) + j - i), slice(int(b[i]), int(b[i]) + j - i))
        for i, j in zip(firsts, lasts, strict=True)
        if j > i
    ]

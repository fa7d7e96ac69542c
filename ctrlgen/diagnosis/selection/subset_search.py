"""Sets of hypotheses that explain jointly what none explains alone: causes can hide each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ctrlgen.diagnosis.selection.candidate_terms import CandidateTerm
from ctrlgen.diagnosis.settings import SUBSETS
from ctrlgen.estimation.hypothesis import Hypothesis


@dataclass(frozen=True)
class Suspect:
    """One hypothesis with the shape that fits best: its `z`, the amplitude that would explain it, its share of slope
    left after projection, and its column in the correlation matrix. `others`: the same for the next best shapes."""

    hypothesis: Hypothesis
    start: dict[str, float]
    z: float
    distinct_share: float
    index: int
    other_starts: tuple[dict[str, float], ...] = ()


class SubsetSearch:
    """Sets of hypotheses by the chi^2 that they explain jointly, from scores and cosines alone.

    Adding hypothesis j to a set K raises it by (z_j - c_jK C_KK^-1 z_K)^2/(1 - c_jK C_KK^-1 c_Kj).
    """

    def __init__(
        self,
        columns: Sequence[CandidateTerm],
        seen: np.ndarray,
        score: np.ndarray,
        distinct: np.ndarray,
        distinct_share: np.ndarray,
        cosine: np.ndarray,
        suspect: Callable[[CandidateTerm, float, float, float, int], Suspect],
    ) -> None:
        self.columns = [columns[j] for j in seen]
        self.index = seen
        self.root = np.sqrt(distinct[seen])
        self.z = score[seen] / self.root
        self.distinct_share, self.C, self.suspect = distinct_share[seen], cosine[np.ix_(seen, seen)], suspect
        self.group = (
            np.unique([hash(c.hypothesis) for c in self.columns], return_inverse=True)[1]
            if len(seen)
            else np.zeros(0, int)
        )

    def search(self) -> tuple[tuple[float, tuple[Suspect, ...]], ...]:
        """Sets of every size from two, those whose amplitudes make sense, the best first."""
        beam: list[tuple[float, tuple[int, ...]]] = [(0.0, ())]
        subsets = []
        for size in range(1, SUBSETS.largest + 1):
            beam = self._grown(beam)
            if size > 1:
                sets = [(gain, self._amplitudes(members), members) for gain, members in beam]
                subsets += [
                    (gain, self._suspects(members, b)) for gain, b, members in sets if self._sensible(members, b)
                ]
        return tuple(sorted(subsets, key=lambda f: -f[0]))

    def _grown(self, beam: list[tuple[float, tuple[int, ...]]]) -> list[tuple[float, tuple[int, ...]]]:
        gains, places = [], []
        for member, (gain, members) in enumerate(beam):
            K = list(members)
            if K:
                W = np.linalg.solve(self.C[np.ix_(K, K)] + SUBSETS.ridge * np.eye(len(K)), self.C[K])
                rest = 1 - np.einsum("kj,kj->j", self.C[K], W)
                score = self.z - W.T @ self.z[K]
            else:
                rest, score = np.ones(len(self.z)), self.z
            more = np.where(rest > SUBSETS.own_share, score**2 / np.maximum(rest, SUBSETS.own_share), 0.0)
            more[np.isin(self.group, self.group[K])] = 0.0
            best = np.argsort(-more)[: SUBSETS.beam]
            best = best[more[best] > 0]
            gains.append(gain + more[best])
            places += [(member, int(j)) for j in best]
        grown: dict[frozenset[Any], tuple[float, tuple[int, ...]]] = {}
        joined = np.concatenate([np.zeros(0), *gains])
        # the best with each group first
        for i in np.argsort(-joined, kind="stable"):
            member, j = places[i]
            members = (*beam[member][1], j)
            grown.setdefault(frozenset(self.group[list(members)]), (float(joined[i]), members))
            if len(grown) == SUBSETS.beam:
                break
        return list(grown.values())

    def _amplitudes(self, members: tuple[int, ...]) -> np.ndarray:
        K = list(members)
        return np.linalg.solve(self.C[np.ix_(K, K)] + SUBSETS.ridge * np.eye(len(K)), self.z[K]) / self.root[K]

    def _sensible(self, members: tuple[int, ...], b: np.ndarray) -> bool:
        """Whether amplitudes are about inside their bounds, and in the range that the effect expects."""
        for k, value in zip(members, b, strict=True):
            low, high = self.columns[k].range
            if (
                not low - SUBSETS.bound_margin * (high - low) * (low < 0)
                <= value
                <= high + SUBSETS.bound_margin * (high - low)
            ):
                return False
        return True

    def _suspects(self, members: tuple[int, ...], b: np.ndarray) -> tuple[Suspect, ...]:
        return tuple(
            self.suspect(self.columns[k], self.z[k], value, self.distinct_share[k], int(self.index[k]))
            for k, value in zip(members, b, strict=True)
        )

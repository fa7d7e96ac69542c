"""Rows of the table: shares with their intervals, and quantiles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


def wilson(hits: int, n: int, z: float = 1.959964) -> tuple[float, float]:
    """95 % interval of a proportion. E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209."""
    if n == 0:
        return 0.0, 1.0
    p, w = hits / n, z * z / n
    half = z * np.sqrt(p * (1 - p) / n + w / n / 4)
    return max(0.0, float((p + w / 2 - half) / (1 + w))), min(1.0, float((p + w / 2 + half) / (1 + w)))


@dataclass(frozen=True)
class Row:
    """One goal: what, its share `hits`/`n` or its `value`, the goal in words, whether it is met (None: nothing to judge)."""

    what: str
    hits: int | None
    n: int
    value: float | None
    goal: str
    met: bool | None

    @property
    def shown(self) -> str:
        """The measured value as text, with its interval where it is a share."""
        if self.n == 0:
            return "no case"
        if self.hits is None:
            return f"{self.value:.3g} (n = {self.n})"
        low, high = wilson(self.hits, self.n)
        return f"{100 * self.hits / self.n:.1f} % [{100 * low:.1f}, {100 * high:.1f}] ({self.hits}/{self.n})"


def share(what: str, flags: Sequence[bool], goal: str, least: float | None = None, most: float | None = None) -> Row:
    """A row of a share of `flags`, between `least` and `most`."""
    n, hits = len(flags), int(sum(flags))
    met = None if n == 0 else (least is None or hits / n >= least) and (most is None or hits / n <= most)
    return Row(what, hits, n, None, goal, met)


def number(what: str, values: Sequence[float], at: float, goal: str, most: float | None = None) -> Row:
    """A row of the quantile `at` of `values`, at most `most`."""
    value = float(np.quantile(values, at)) if len(values) else None
    return Row(what, None, len(values), value, goal, None if value is None or most is None else value <= most)


def mean(what: str, values: Sequence[float], goal: str, least: float) -> Row:
    """A row of the mean of `values`, at least `least`."""
    value = float(np.mean(values)) if len(values) else None
    return Row(what, None, len(values), value, goal, None if value is None else value >= least)

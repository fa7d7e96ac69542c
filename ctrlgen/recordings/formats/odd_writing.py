"""Numbers that are written otherwise than all others of their column: a 0 or a -1 among 12.3456 is rather a mark than a reading."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

DECIMALS = re.compile(r"[+-]?\d+[.,](\d{2,})", re.ASCII)
FEWEST = 20  # numbers written alike, from which another way to write is odd
LONGEST = 3  # rows in which a mark stands at once: what stands longer is a rest
SHARE = 0.2  # of the rows that marks may be
ROUND = 1e-20  # a mark of 1e-30 is no whole number, and no reading
APART = (
    0.1  # of the range of all others: a reading does not jump so far and back, and a motion through zero goes by steps
)


def odd_number(values: np.ndarray, sample: Sequence[str], written: Callable[[int], str]) -> float | None:
    """The whole number that stands several times among `values` (n,), written without the digits behind the point that all others have and
    apart from its neighbours; None where there is none. `sample`: some cells; `written`: the cell of a row."""
    if values.dtype.kind != "f" or len(values) < FEWEST:
        return None
    tails = [len(match[1]) for cell in sample if (match := DECIMALS.fullmatch(cell))]
    if len(tails) < max(FEWEST, (1 - SHARE) * len(sample)) or len(set(tails)) > 1:
        return None
    whole = np.isfinite(values) & (np.abs(values - np.round(values)) < ROUND)
    numbers, firsts, counts = np.unique(values[whole], return_index=True, return_counts=True)
    for k in np.flatnonzero((counts > 1) & (counts <= SHARE * len(values))):
        number = numbers[k]
        if DECIMALS.fullmatch(written(int(np.flatnonzero(whole)[firsts[k]]))):
            continue
        rows = np.flatnonzero(values == number)
        if any(DECIMALS.fullmatch(written(int(row))) for row in rows):
            continue
        edges = np.flatnonzero(np.diff(np.concatenate([[False], values == number, [False]]).astype(int))).reshape(-1, 2)
        others = values[np.isfinite(values) & (values != number)]
        beside = [values[k] for a, b in edges for k in (a - 1, b) if 0 <= k < len(values) and np.isfinite(values[k])]
        far = beside and np.median(np.abs(np.array(beside) - number)) > APART * np.ptp(others)
        if len(edges) > 1 and np.diff(edges).max() <= LONGEST and far:
            return float(number)
    return None

"""The state that a period leaves as it found it, where single periods come near to it slowly."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

WINDOW = 16  # periods that are remembered: more than the decades of slow memories an effect can have
ROUNDING = 1e-12  # of the largest change, below which a combination of changes is rounding


def repeating_state(
    period: Callable[[np.ndarray], np.ndarray],
    begun: Sequence[np.ndarray],
    scale: np.ndarray,
    most: int,
    tolerance: float,
) -> np.ndarray | None:
    """y (n,) that differs from period(y) by at most `tolerance` of its `scale`; None where `most` further periods do not find one.

    `begun` are states of which each follows from that before it in a period. With g_i = period(y_i) and changes r_i = g_i - y_i the next
    start is sum_i w_i g_i, sum_i w_i = 1, whose sum_i w_i r_i is the smallest: of a linear map, such as that of memories which forget at
    several speeds, the state that repeats after as many periods as there are speeds, by the reduced rank extrapolation of all periods so
    far. A start that changes more than the best one so far begins anew from what that one leads to.
    Sources: R. P. Eddy, in Information Linkage between Applied Mathematics and Industry (1979) 387; H. F. Walker, P. Ni, SIAM J.
    Numer. Anal. 49 (2011) 1715, for the form in which every extrapolated state is followed by a period.
    """
    starts, ends = list(begun[:-1]), list(begun[1:])
    best = np.inf
    for _ in range(most):
        start = _extrapolated(starts, ends, scale)
        end = period(start)
        if not np.all(np.isfinite(end)):
            return None
        change = float(np.max(np.abs(end - start) / scale))
        if change <= tolerance:
            return start
        if change > best:  # of a map with kinks the changes before do not tell those there
            starts, ends = [], []
        best = min(best, change)
        starts, ends = [*starts, start][-WINDOW:], [*ends, end][-WINDOW:]
    return None


def _extrapolated(starts: Sequence[np.ndarray], ends: Sequence[np.ndarray], scale: np.ndarray) -> np.ndarray:
    """The combination of `ends` whose change is the smallest."""
    changes = (np.array(ends) - np.array(starts)) / scale
    if len(ends) == 1:
        return ends[-1]
    steps = np.diff(changes, axis=0).T  # the last change is to be made of steps between changes
    share, *_ = np.linalg.lstsq(steps, changes[-1], rcond=ROUNDING)
    return np.asarray(ends[-1] - np.diff(np.array(ends), axis=0).T @ share)

"""Which limit binds where along a path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.path_timing.drive_law import Side
from ctrlgen.path_timing.optimum import Optimum

AT_BOUND = 5e-3  # of a limit's range, within which it binds where IPOPT found the law
EXACTLY = 1e-5  # where each place alone bounds the speed


@dataclass(frozen=True)
class Binding:
    """A limit that binds: along the `runs` of shares of the path, for `time` [s] altogether, a `share_of_time` of the whole."""

    side: Side
    time: float
    share_of_time: float
    runs: tuple[tuple[float, float], ...]


def bindings(optimum: Optimum) -> tuple[Binding, ...]:
    """All limits that bind somewhere, that for the longest time first."""
    binding = []
    for k, side in enumerate(optimum.sides):
        time, runs = 0.0, []
        for piece in optimum.pieces:
            near = piece.distances[:, k] < (EXACTLY if piece.law is None else AT_BOUND)
            both = near[1:] & near[:-1]
            time += float(np.sum(np.diff(piece.time)[both]))
            edges = np.flatnonzero(np.diff(np.concatenate([[0], both.astype(int), [0]])))
            runs += [
                (float(piece.share[a]), float(piece.share[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)
            ]
        if time > 0:
            binding.append(Binding(side, time, time / optimum.duration, tuple(runs)))
    return tuple(sorted(binding, key=lambda b: -b.time))

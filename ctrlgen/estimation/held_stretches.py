"""Stretches in which a sensor holds one value although the model moves, of readings too coarse to show it by themselves.

A stage that dry friction holds repeats its coarse readings, too, and only a model that lacks the friction moves there. So nothing is
marked before everything else is explained: the residual outside of the stretches must be noise, and they must be few.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ctrlgen.estimation.noise import Noise
from ctrlgen.estimation.settings import HELD, STATISTICS
from ctrlgen.recordings.recording import Record


def held_stretches(
    record: Record, predicted: np.ndarray, spikes: np.ndarray, noise: Noise
) -> tuple[tuple[int, int, int], ...]:
    """First row, row behind the last and channel of each stretch whose readings are equal to the last bit, while `predicted` (n, n_y)
    moves on by more than `HELD.moves` standard deviations of the `noise`. `spikes` (n, n_y) do not count as what is left elsewhere."""
    stretches: list[tuple[int, int, int]] = []
    for i, floor in enumerate(noise.floor):
        y, valid = np.where(record.valid[:, i], record.observed[:, i], np.nan), record.valid[:, i]
        edges = np.concatenate([[0], np.flatnonzero(~(y[1:] == y[:-1])) + 1, [len(y)]])
        e = np.where(valid, y - predicted[:, i], 0.0)
        found = [
            (int(a), int(b), i)
            for a, b in pairwise(edges)
            if b - a >= HELD.shortest
            and np.ptp(predicted[a:b, i]) > HELD.moves * floor
            and np.abs(e[a:b]).max() > HELD.moves * floor
        ]
        outside = valid & ~spikes[:, i]
        for a, b, _ in found:
            outside[a:b] = False
        left, held = np.abs(e[outside]), sum(b - a for a, b, _ in found)
        is_noise = len(left) > 0 and STATISTICS.mad_to_sd * np.median(left) <= HELD.noise_ratio * floor
        few = len(found) <= HELD.most and held <= HELD.largest_share * valid.sum()
        # friction holds a stage at every reversal, and what it leaves beside is no noise
        if is_noise and few and np.mean(left > HELD.moves * floor) <= HELD.beyond:
            stretches += found
    return tuple(stretches)

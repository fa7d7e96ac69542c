"""Readings that the findings predict worse than the device as described does: an answer is judged over all of them together."""

from __future__ import annotations

import math

import numpy as np

from ctrlgen.core.units import difference
from ctrlgen.diagnosis.report.narrative import short
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.reporting.numbers import number

# standard deviations by which noise lets the squares of a reading differ at most
_SURE = 3.0
TOLD = "with the findings the held-out error is larger than as described, by more than noise would do: {}"


def worse_channels(search: SearchResult) -> list[str]:
    """'... larger than as described, by more than noise would do: theta_x 5.2 urad -> 6.1 urad', the worst first; nothing where all
    readings are predicted as well.

    With the residual e of the device as described and e - d of the answer, both whitened, noise alone lets the sum of (e - d)^2 - e^2 be
    off by 2 sqrt(sum d^2), and the uncertainty of k fitted numbers by 2 k.
    """
    fitter, fits = search.fitter, (search.nominal.fit, search.chosen.fit)
    numbers = sum(u.cause is not None for u in fits[1].structure.free_parameters)
    channels = fitter.recording.channels
    # of the device as described, and of the answer
    squares, white = np.zeros((2, len(channels))), np.zeros((2, len(channels)))
    moved, samples = np.zeros(len(channels)), np.zeros(len(channels))
    for r in fitter.held_out_records:
        left = [np.where(r.valid, r.observed - fitter.predict(fit, r), 0.0) for fit in fits]
        whitened = [fitter.noise.whiten(e, r.valid) for e in left]
        squares += [np.sum(e**2, axis=0) for e in left]
        white += [np.sum(e**2, axis=0) for e in whitened]
        moved += np.sum((whitened[1] - whitened[0]) ** 2, axis=0)
        samples += r.valid.sum(axis=0)
    rms = np.sqrt(squares / np.maximum(samples, 1))
    worse = (white[1] - white[0] > 2 * _SURE * np.sqrt(moved) + 2 * numbers) & (rms[1] > rms[0])
    told = {}
    for i in np.flatnonzero(worse).tolist():
        unit = fitter.recording.units[i]
        before, after = (f"{number(float(difference(v, unit)), 3)} {unit}" for v in rms[:, i])
        if before != after:
            ratio = rms[1, i] / rms[0, i] if rms[0, i] else math.inf
            told[f"{short(channels[i])} {before} -> {after}"] = ratio
    return [TOLD.format(", ".join(sorted(told, key=lambda text: -told[text])))] if told else []

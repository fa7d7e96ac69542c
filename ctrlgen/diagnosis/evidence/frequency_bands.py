"""The residual by frequency band, and its coherence with the drives.

With w the residual whitened by the noise model, a band's excess is the mean of its periodogram, less 1; the interval is that of the
chi-square distribution with two degrees of freedom a frequency.
"""

from __future__ import annotations

import numpy as np
from scipy import signal, stats

from ctrlgen.diagnosis.evidence.ltv_linearisation import LtvModel
from ctrlgen.diagnosis.evidence.residual_location import FrequencyBandEntry
from ctrlgen.diagnosis.settings import LOCALISATION


def frequency_bands(models: list[LtvModel]) -> list[FrequencyBandEntry]:
    """Logarithmic bands from one over the longest record's duration to half the sampling rate; none for settled poses."""
    if models[0].poses:
        return []
    longest, fastest = (
        max(a.record.sample_time * len(a.white) for a in models),
        min(a.record.sample_time for a in models),
    )
    edges = np.geomspace(1 / longest, 0.5 / fastest, LOCALISATION.bands + 1)
    power, count = np.zeros(LOCALISATION.bands), np.zeros(LOCALISATION.bands)
    coherences = [_coherence(a, edges) for a in models]
    for a in models:
        f = np.fft.rfftfreq(len(a.white), a.record.sample_time)[1:]
        spectrum = np.abs(np.fft.rfft(a.white, axis=0)[1:]) ** 2 / np.maximum(a.usable.sum(axis=0), 1)
        which = np.clip(np.searchsorted(edges, f * (1 + 1e-12), side="right") - 1, 0, LOCALISATION.bands - 1)
        for i in np.flatnonzero(a.usable.any(axis=0)):
            power += np.bincount(which, spectrum[:, i], LOCALISATION.bands)
            count += np.bincount(which, minlength=LOCALISATION.bands)
    bands = []
    for k in range(LOCALISATION.bands):
        if count[k] == 0:
            continue
        level, m = power[k] / count[k], 2 * count[k]
        low, high = (float(level * m / stats.chi2.ppf(q, m) - 1) for q in (0.975, 0.025))
        measured = [value for c, _ in coherences if (value := c[k]) is not None]
        floor = max((f for c, f in coherences if c[k] is not None), default=None)
        bands.append(
            FrequencyBandEntry(
                low=edges[k],
                high=edges[k + 1],
                excess=level - 1,
                ci95=(low, high),
                coherence=max(measured, default=None),
                coherence_floor=floor,
            )
        )
    return bands


def _coherence(a: LtvModel, edges: np.ndarray) -> tuple[list[float | None], float]:
    """The largest coherence of a reading's residual with a drive, a value a band; and the coherence that chance exceeds with 5 %."""
    segment = max(len(a.white) // LOCALISATION.coherence_segments * 2, 8)
    averages = max(2 * len(a.white) // segment - 1, 2)
    best: list[float | None] = [None] * (len(edges) - 1)
    for i in range(a.white.shape[1]):
        for u in a.record.drive.T:
            if np.std(u) == 0 or np.std(a.residual[:, i]) == 0:
                continue
            f, c = signal.coherence(u, a.residual[:, i], 1 / a.record.sample_time, nperseg=segment)
            for k in range(len(best)):
                inside = (f >= edges[k]) & (f < edges[k + 1]) & (f > 0)
                if inside.any():
                    best[k] = max(best[k] or 0.0, float(np.mean(c[inside])))
    return best, float(1 - 0.05 ** (1 / (averages - 1)))

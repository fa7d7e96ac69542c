"""Spikes: rare isolated samples far beyond the noise, how often they come and how large they are.

They are faults of sensors, converters and cables, and no physics of the device: they are told, and decide nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from ctrlgen.core.counts import number_of
from ctrlgen.core.units import difference
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.settings import OUTLIERS, RESIDUAL_TESTS, STATISTICS
from ctrlgen.recordings.recording import Recording


@dataclass(frozen=True)
class Spikes:
    """The spikes of one channel: `count` among `samples`, `size` their median magnitude [unit], `in_noise` the same in standard
    deviations of the noise, None where that is not known."""

    channel: str
    count: int
    samples: int
    size: float
    unit: str
    in_noise: float | None

    @property
    def per_thousand(self) -> float:
        """Spikes in a thousand samples."""
        return 1000 * self.count / self.samples

    @property
    def sentence(self) -> str:
        """'reading.axis: 1.2 of 1000 samples are spikes of typically 24 nm (4.9 standard deviations of the noise); ...'."""
        beside = "" if self.in_noise is None else f" ({self.in_noise:.2g} standard deviations of the noise)"
        return (
            f"{self.channel}: {self.per_thousand:.2g} of 1000 samples are spikes of typically {self.size:.3g} {self.unit}{beside}; "
            "taken for faults of the sensor, which change nothing else here"
        )


def find_spikes(fitter: Fitter, fit: Fit, known: np.ndarray) -> tuple[Spikes, ...]:
    """The spikes of each channel that has some: outliers that were marked, and smaller ones in what `fit` leaves where that is
    noise. `known` (n_y,) says whose noise is known."""
    recording, rows = fitter.recording, []
    for i, (channel, unit) in enumerate(zip(recording.channels, recording.units, strict=True)):
        sizes = [abs(size) for r in recording.records for _, k, size in r.spikes if k == i]
        samples = sum(int(r.valid[:, i].sum()) for r in recording.records) + len(sizes)
        if recording.kind == "series":
            sizes += _beyond_noise(fitter, fit, i, len(sizes)) if known[i] else []
        if sizes:
            size, floor = float(np.median(sizes)), float(fitter.noise.floor[i])
            in_noise = size / floor if known[i] and floor > 0 else None
            rows.append(Spikes(channel, len(sizes), samples, float(difference(size, unit)), unit, in_noise))
    return tuple(rows)


def marking_notes(before: Recording, after: Recording) -> tuple[str, ...]:
    """What marking again changed, as sentences: outliers of `before` that are none of the accepted model, and held stretches."""
    notes = []
    for old, new in zip(before.records, after.records, strict=True):
        for i, channel in enumerate(after.channels):
            back = int((new.valid & ~old.valid)[:, i].sum())
            if back:
                again = number_of(
                    back,
                    "sample that was marked as an outlier is used again; the accepted model explains it",
                    "samples that were marked as outliers are used again; the accepted model explains them",
                )
                notes.append(f"{new.name}, {channel}: {again}.")
            held = [(a, b) for a, b, k in new.held if k == i]
            if held:
                at = ", ".join(f"{new.time[a]:.6g} s" for a, _ in held)
                count = number_of(sum(b - a for a, b in held), "sample repeats", "samples repeat")
                notes.append(f"{new.name}, {channel}: {count} one value while the device moves (from {at}); not used.")
    return tuple(notes)


def _beyond_noise(fitter: Fitter, fit: Fit, i: int, marked: int) -> list[float]:
    """Magnitudes [SI] of the residual where its whitened value alone exceeds `OUTLIERS.beyond_noise`, if they and those that
    were `marked` before are more than normal noise has, and the rest is noise."""
    white, plain = [], []
    for record in (*fitter.fit_records, *fitter.held_out_records):
        usable = fitter.noise.usable(record.valid)[:, i]
        white.append(fitter.whitened_residual(fit, record)[usable, i])
        plain.append(np.abs(record.observed - fitter.predict(fit, record))[usable, i])
    w, e = np.abs(np.concatenate(white)), np.concatenate(plain)
    far = w > OUTLIERS.beyond_noise
    runs = [
        run for run in np.split(np.flatnonzero(far), np.flatnonzero(np.diff(np.flatnonzero(far)) > 1) + 1) if len(run)
    ]
    alone = [run for run in runs if len(run) <= OUTLIERS.widest]
    p = 2 * stats.norm.sf(OUTLIERS.beyond_noise)
    is_noise = len(w) > 0 and STATISTICS.mad_to_sd * np.median(w) <= RESIDUAL_TESTS.error_ratio
    if not is_noise or len(alone) > OUTLIERS.largest_share * len(w):
        return []
    if stats.binom.sf(len(alone) + marked - 1, len(w) + marked, p) > OUTLIERS.beyond_noise_p:
        return []
    return [float(e[run].max()) for run in alone]

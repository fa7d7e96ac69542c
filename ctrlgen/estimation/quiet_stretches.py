"""Stretches of a reading in which nothing moves that a model would have to explain: at rest, between repeats, while the drive dwells."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ctrlgen.estimation.settings import NOISE
from ctrlgen.numerics.spectral_peaks import local_floor, periodogram
from ctrlgen.recordings.recording import Record
from ctrlgen.recordings.settled_readings import settled


def at_rest(record: Record, i: int) -> np.ndarray:
    """The valid readings of channel i without their regression on the recorded ambient, which is a cause and no noise."""
    good = record.valid[:, i]
    y = record.observed[good, i]
    if record.ambient is None or not len(y):
        return y
    T = record.ambient[good] - np.mean(record.ambient[good])
    return y - T * (T @ y) / (T @ T) if T @ T > 0 else y


def dwells(record: Record, i: int, settling: float) -> list[np.ndarray]:
    """The valid readings of channel i while the drive is constant, from `settling` [s] after its last change; at the beginning of the
    record, before which nobody knows a change, from where the reading itself has settled, if it tells that."""
    moved = np.any(np.diff(record.drive, axis=0) != 0, axis=1)
    edges = np.flatnonzero(np.concatenate([[True], moved, [True]]))
    wait = int(np.ceil(settling / record.sample_time))
    begun = [(a + wait, b) for a, b in pairwise(edges.tolist())]
    if (first := int(edges[1])) >= NOISE.shortest_stretch:
        readings = np.where(record.valid[:first, [i]], record.observed[:first, [i]], np.nan)
        still = settled(readings, 0, first, NOISE.shortest_stretch)
        begun[0] = begun[0] if still is None else (still, first)
    long = ((a, b) for a, b in begun if b - a >= NOISE.shortest_stretch)
    return [record.observed[a:b, i][record.valid[a:b, i]] for a, b in long]


def period_differences(record: Record, i: int) -> list[np.ndarray]:
    """Differences of neighbouring periods over sqrt(2), so that they have the noise's own size; the first period, which
    holds a transient, is left out, and no period is used twice."""
    period = period_of(record)
    P = round(period / record.sample_time) if period else 0
    if not P or len(record.time) < 3 * P:
        return []
    y = np.where(record.valid[:, i], record.observed[:, i], np.nan)
    periods = y[P : len(y) // P * P].reshape(-1, P)
    differences = np.diff(periods[: len(periods) // 2 * 2], axis=0)[::2] / np.sqrt(2.0)
    return [d[np.isfinite(d)] for d in differences]


def period_of(record: Record) -> float | None:
    """Period [s] with which the drive of a record repeats, as stated or exactly; None where it does not."""
    if record.period is not None:
        return record.period
    samples = drive_period(record.drive)
    return None if samples is None else samples * record.sample_time


def drive_period(drive: np.ndarray) -> int | None:
    """Samples after which the drive (n, n_u) repeats exactly, at least twice; None where it does not."""
    n, span = len(drive), np.ptp(drive, axis=0).max(initial=0.0)
    if span == 0 or n < 100:
        return None
    near, first = NOISE.same_drive * span, drive[:32]
    lags = np.flatnonzero(np.all(np.abs(drive[: n - 32] - first[0]) <= near, axis=1))
    for lag in lags[lags >= 50]:
        if 2 * lag > n:
            return None
        # cheap: tried before the whole record
        begins = np.all(np.abs(drive[lag : lag + 32] - first) <= near)
        if begins and np.all(np.abs(drive[lag:] - drive[:-lag]) <= near):
            return int(lag)
    return None


def detrended(stretch: np.ndarray, degree: int) -> np.ndarray:
    """A stretch without its polynomial of `degree` by least squares: what still settles is no noise."""
    t = np.linspace(-1, 1, len(stretch))
    return stretch - np.polynomial.legendre.legval(t, np.polynomial.legendre.legfit(t, stretch, degree))


def without_lines(stretch: np.ndarray) -> np.ndarray:
    """A stretch (n,) without the sinusoids that stand out of its spectrum: a vibration is a disturbance, not noise."""
    n, padding = len(stretch), 8
    for _ in range(NOISE.most_lines):
        power = periodogram(stretch, np.hanning(n), padding)
        level = local_floor(power, padding * NOISE.level_bins)
        peak = int(np.argmax(power / np.maximum(level, 1e-300)))
        if power[peak] < NOISE.line_ratio * level[peak]:
            break
        phase = 2 * np.pi * peak / (padding * n) * np.arange(n)
        basis = np.column_stack([np.sin(phase), np.cos(phase)])
        stretch = stretch - basis @ np.linalg.lstsq(basis, stretch, rcond=None)[0]
    return stretch


def without_events(stretches: list[np.ndarray]) -> list[np.ndarray]:
    """The stretches whose variance is not far above the median, or above that of the quietest tenth where the median is far above that
    too: in the others something happened, such as a slew that outlasts the time in which the device settles."""
    power = np.array([np.var(s) for s in stretches])
    usual, quiet = (float(np.quantile(power, share)) if len(power) else 0.0 for share in (0.5, 0.1))
    most = NOISE.loudest_stretch * (quiet if usual > NOISE.far_louder * quiet else usual)
    return [s for s, p in zip(stretches, power, strict=True) if p <= most]

"""Step 1: the noise, never from the misfit.

In order of trust: a record at rest, repeated periods of the drive, dwells, the stated deviation, and last, saying so,
the part of the readings above the drive's band. Its colour is an autoregressive model, order by BIC.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.signal import detrend, lfilter

from ctrlgen.recording import Record, Recording

LONGEST_ORDER = 8
SHORTEST_REST = 200  # samples; an AR model of order 8 needs some 25 a coefficient
SETTLING_SHARE = 0.5  # of a dwell, left out


@dataclass(frozen=True)
class Noise:
    """Per channel: innovation `sd` [SI], AR coefficients, and a sentence on where they come from; `known` False where
    nothing but the misfit can tell."""

    sd: np.ndarray
    ar: tuple[np.ndarray, ...]
    known: np.ndarray
    said: tuple[str, ...]

    def whiten(self, values: np.ndarray, valid: np.ndarray) -> np.ndarray:
        """`values` (n, n_y, ...) filtered to unit white noise; zero where a sample or one that it leans on is not `valid`."""
        white = np.zeros_like(values)
        for i, (sd, a) in enumerate(zip(self.sd, self.ar, strict=True)):
            clean = np.where(valid[:, i].reshape(-1, *(1,) * (values.ndim - 2)), values[:, i], 0.0)
            white[:, i] = clean / sd
            for lag, coefficient in enumerate(a, 1):
                white[lag:, i] -= coefficient / sd * clean[:-lag]
            white[~self.usable(valid)[:, i], i] = 0.0
        return white

    def usable(self, valid: np.ndarray) -> np.ndarray:
        """Which samples can be whitened, (n, n_y)."""
        good = valid.copy()
        for i, a in enumerate(self.ar):
            for lag in range(1, len(a) + 1):
                good[lag:, i] &= valid[:-lag, i]
            good[: len(a), i] = False
        return good

    @property
    def floor(self) -> np.ndarray:
        """Standard deviation of the noise itself, colour included."""
        impulse = np.zeros(4096)
        impulse[0] = 1.0
        shapes = [lfilter([1.0], np.concatenate([[1.0], -a]), impulse) for a in self.ar]
        return np.array([sd * np.sqrt(np.sum(s**2)) for sd, s in zip(self.sd, shapes, strict=True)])

    def scaled(self, factor: np.ndarray) -> Noise:
        """The same colour with other deviations."""
        return Noise(self.sd * factor, self.ar, self.known, self.said)


def estimate(recording: Recording) -> Noise:
    """The noise of each observed channel."""
    rows = [_channel(recording, i) for i in range(len(recording.channels))]
    return Noise(
        np.array([r[0] for r in rows]), tuple(r[1] for r in rows), np.array([r[2] for r in rows]), tuple(r[3] for r in rows)
    )  # fmt: skip


def _channel(recording: Recording, i: int) -> tuple[float, np.ndarray, bool, str]:
    name, stated = recording.channels[i], recording.noise[i]
    if recording.kind == "poses":
        if stated:
            return stated, np.zeros(0), True, f"{name}: as stated"
        return 1.0, np.zeros(0), False, f"{name}: not stated and no pose repeats; taken from what the best model leaves"
    samples = {
        "a record at rest": [_valid(r.observed[:, i], r.valid[:, i]) for r in recording.records if r.role == "rest"],
        "repeated periods": [e for r in recording.records if r.role != "rest" for e in _repeats(r, i)],
        "dwells of the drive": [e for r in recording.records if r.role != "rest" for e in _dwells(r, i)],
    }
    for source, parts in samples.items():
        parts = [detrend(part) for part in parts if len(part) >= SHORTEST_REST]
        if parts:
            sd, a = _autoregression(parts)
            return sd, a, True, f"{name}: from {source}, autoregressive of order {len(a)}"
    if stated:
        return stated, np.zeros(0), True, f"{name}: as stated, taken as white"
    parts = [np.diff(_valid(r.observed[:, i], r.valid[:, i]), 3) for r in recording.records]
    sd = max(_robust(np.concatenate(parts)) / np.sqrt(20.0), 1e-300)  # 1 + 9 + 9 + 1: variance of third differences
    return (
        sd,
        np.zeros(0),
        True,
        f"{name}: from the fastest part of the readings, taken as white; record some rest to know it",
    )


def _valid(values: np.ndarray, valid: np.ndarray) -> np.ndarray:
    return values[valid]


def _robust(values: np.ndarray) -> float:
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def period(drive: np.ndarray) -> int | None:
    """The number of samples after which the drive (n, n_u) repeats exactly, at least twice; None where it does not."""
    n, span = len(drive), np.ptp(drive, axis=0).max(initial=0.0)
    if span == 0 or n < 100:
        return None
    first = drive[:32]
    matches = np.flatnonzero(np.all(np.abs(drive[: n - 32] - first[0]) <= 1e-9 * span, axis=1))
    for lag in matches[matches >= 50]:
        if 2 * lag > n:
            return None
        if np.all(np.abs(drive[lag : lag + 32] - first) <= 1e-9 * span) and np.all(
            np.abs(drive[lag:] - drive[:-lag]) <= 1e-9 * span
        ):
            return int(lag)
    return None


def _repeats(record: Record, i: int) -> list[np.ndarray]:
    """Differences of neighbouring periods, the first left out for its transient, with the noise's own size."""
    P = period(record.drive) if record.period is None else round(record.period / record.sample_time)
    if P is None or len(record.time) < 3 * P:
        return []
    y = np.where(record.valid[:, i], record.observed[:, i], np.nan)
    whole = y[P : len(y) // P * P].reshape(-1, P)
    differences = np.diff(whole[: len(whole) // 2 * 2], axis=0)[::2] / np.sqrt(2.0)
    return [d[np.isfinite(d)] for d in differences]


def _dwells(record: Record, i: int) -> list[np.ndarray]:
    """Readings while the drive stood still, without the time it took to settle."""
    moved = np.any(np.diff(record.drive, axis=0) != 0, axis=1)
    edges = np.flatnonzero(np.concatenate([[True], moved, [True]]))
    found = []
    for a, b in pairwise(edges):
        start = a + int(SETTLING_SHARE * (b - a))
        part = _valid(record.observed[start:b, i], record.valid[start:b, i])
        if len(part) >= SHORTEST_REST:
            found.append(part)
    return found


def _autoregression(parts: list[np.ndarray]) -> tuple[float, np.ndarray]:
    """Innovation deviation and coefficients by Yule-Walker over all parts; the order by BIC."""
    n = sum(map(len, parts))
    lags = np.array([sum(float(p[: len(p) - k] @ p[k:]) for p in parts) / n for k in range(LONGEST_ORDER + 1)])
    best = (n * np.log(lags[0]), lags[0], np.zeros(0))
    for order in range(1, LONGEST_ORDER + 1):
        toeplitz = lags[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
        a = np.linalg.solve(toeplitz, lags[1 : order + 1])
        variance = lags[0] - a @ lags[1 : order + 1]
        if variance <= 0:
            break
        bic = n * np.log(variance) + order * np.log(n)
        if bic < best[0]:
            best = (bic, variance, a)
    return float(np.sqrt(best[1])), best[2]

"""Step 1: the noise, never from the misfit.

In order of trust: a record at rest, repeated periods of the drive, dwells, the stated deviation, and last, saying so,
the fastest part of the readings, which `quiet` then refines. Its colour is an autoregressive model, order by BIC.
Of settled poses: the stated deviation, then what repeated poses differ by, which a lost motion or creep widens.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy import stats
from scipy.signal import lfilter

from ctrlgen.diagnosis.settings import NOISE, STATISTICS
from ctrlgen.numerics.quantisation_step import quantisation_step
from ctrlgen.numerics.spectral_peaks import local_floor, periodogram
from ctrlgen.recordings.recording import Record, Recording


@dataclass(frozen=True)
class Noise:
    """Per channel: innovation `sd` [SI], AR coefficients, and a sentence on where they come from; `known` False where
    nothing but the misfit can tell; `count` independent samples that the estimate rests on (inf where it was stated);
    `guessed` True where only the readings' fastest part told it."""

    sd: np.ndarray
    ar: tuple[np.ndarray, ...]
    known: np.ndarray
    notes: tuple[str, ...]
    count: np.ndarray
    guessed: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))

    def whiten(self, values: np.ndarray, valid: np.ndarray) -> np.ndarray:
        """`values` (n, n_y, ...) filtered to unit white noise; zero where a sample or one that it leans on is not `valid`."""
        white, usable = np.zeros_like(values), self.usable(valid)
        for i, a in enumerate(self.ar):
            clean = np.where(valid[:, i].reshape(-1, *(1,) * (values.ndim - 2)), values[:, i], 0.0)
            white[len(a) :, i] = self.whiten_channel(clean, i)
            white[~usable[:, i], i] = 0.0
        return white

    def whiten_channel(self, values: np.ndarray, i: int) -> np.ndarray:
        """`values` (n, ...) of channel i as unit white noise, from the first sample on whose memory is there, (n - order, ...)."""
        sd, a = self.sd[i], self.ar[i]
        n, order = len(values), len(a)
        white = values[order:] / sd
        for lag, coefficient in enumerate(a, 1):
            white -= coefficient / sd * values[order - lag : n - lag]
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
        return np.array([stationary_deviation(sd, a) for sd, a in zip(self.sd, self.ar, strict=True)])


def stationary_deviation(sd: float, a: np.ndarray) -> float:
    """Standard deviation of autoregressive noise with innovations `sd` and coefficients `a`."""
    impulse = np.zeros(4096)
    impulse[0] = 1.0
    return float(sd * np.sqrt(np.sum(lfilter([1.0], np.concatenate([[1.0], -a]), impulse) ** 2)))


def estimate_noise(recording: Recording, settling: float) -> Noise:
    """The noise of each observed channel. `settling` [s]: how long the device itself goes on after a change of drive."""
    rows = [_channel(recording, i, settling) for i in range(len(recording.channels))]
    sd, ar, known, said, count, guessed = zip(*rows, strict=True)
    return Noise(np.array(sd), ar, np.array(known), said, np.array(count), np.array(guessed))


def _channel(recording: Recording, i: int, settling: float) -> tuple[float, np.ndarray, bool, str, float, bool]:
    name, stated = recording.channels[i], recording.noise[i]
    none = np.zeros(0)
    if recording.kind == "poses":
        if stated:
            return stated, none, True, f"{name}: as stated", np.inf, False
        sd, count = _scatter(recording.records, i)
        if count >= NOISE.fewest_repeats and sd > 0:
            return sd, none, True, f"{name}: from repeated poses, {count} beyond the first of each", float(count), False
        few = f"only {count} repeat others" if count else "no pose repeats"
        said = f"{name}: not stated and {few}; taken from what the best model leaves"
        return 1.0, none, False, said, np.inf, False
    moving = [r for r in recording.records if r.role != "rest"]
    rounding = quantisation_step(np.concatenate([r.observed[r.valid[:, i], i] for r in recording.records])) / np.sqrt(
        12.0
    )
    samples = {
        "a record at rest": (1, [_at_rest(r, i) for r in recording.records if r.role == "rest"]),
        "repeated periods": (1, [e for r in moving for e in _repeats(r, i)]),
        "dwells of the drive": (NOISE.dwell_degree, [e for r in moving for e in _dwells(r, i, settling)]),
    }
    for source, (degree, parts) in samples.items():
        parts = [
            part for part in parts if len(part) >= NOISE.shortest_stretch and np.ptp(part) > 0
        ]  # one number alone tells none
        parts = _quiet([without_lines(_flat(part, degree)) for part in parts])
        if parts:
            sd, a = _with_rounding(*autoregression(parts), rounding)
            n, times = sum(map(len, parts)), stationary_deviation(sd, a) / sd
            said = f"{name}: from {source}, {n} samples, autoregressive of order {len(a)}"
            if times > NOISE.slow_ratio:
                said += f"; it is {times:.0f} times what one sample adds: what moves so slowly may be the device, not its sensor"
            return sd, a, True, said, float(n), False
    if stated:
        sd, _ = _with_rounding(stated, none, rounding)
        return sd, none, True, f"{name}: as stated, taken as white", NOISE.stated_samples, False
    parts = [np.diff(r.observed[r.valid[:, i], i], 3) for r in recording.records]
    sd = max(_robust(np.concatenate(parts)) / np.sqrt(20.0), rounding, 1e-300)  # 1 + 9 + 9 + 1: third differences
    said = f"{name}: from the fastest part of the readings, taken as white; record some rest to know it"
    return sd, none, True, said, sum(map(len, parts)) / NOISE.robust_cost, True


def _scatter(records: tuple[Record, ...], i: int) -> tuple[float, int]:
    """Standard deviation of channel i among poses of one drive, and how many there are beyond the first of each."""
    drive = np.concatenate([r.drive[r.valid[:, i]] for r in records])
    y = np.concatenate([r.observed[r.valid[:, i], i] for r in records])
    span = np.ptp(drive, axis=0)
    _, group = np.unique(
        np.round(drive / np.where(span > 0, NOISE.same_drive * span, 1.0)), axis=0, return_inverse=True
    )
    group = group.ravel()
    mean = np.bincount(group, y) / np.bincount(group)
    count = len(y) - len(mean)
    return float(np.sqrt(np.sum((y - mean[group]) ** 2) / max(count, 1))), count


def _at_rest(record: Record, i: int) -> np.ndarray:
    """The valid readings of a channel without what goes with the recorded surroundings: that has a cause, and is no noise."""
    good = record.valid[:, i]
    y = record.observed[good, i]
    if record.ambient is None or not len(y):
        return y
    T = record.ambient[good] - np.mean(record.ambient[good])
    return y - T * (T @ y) / (T @ T) if T @ T > 0 else y


def _flat(part: np.ndarray, degree: int) -> np.ndarray:
    """Without its slow part, a polynomial: what still settles is no noise."""
    t = np.linspace(-1, 1, len(part))
    return part - np.polynomial.legendre.legval(t, np.polynomial.legendre.legfit(t, part, degree))


def without_lines(part: np.ndarray) -> np.ndarray:
    """Without sinusoids that stand out of the spectrum: a vibration is a disturbance with a cause, no noise."""
    n = len(part)
    for _ in range(NOISE.most_lines):
        power = periodogram(part, np.hanning(n), padding=8)
        level = local_floor(power, 8 * NOISE.level_bins)
        peak = int(np.argmax(power / np.maximum(level, 1e-300)))
        if power[peak] < NOISE.line_ratio * level[peak]:
            break
        phase = 2 * np.pi * peak / (8 * n) * np.arange(n)
        basis = np.column_stack([np.sin(phase), np.cos(phase)])
        part = part - basis @ np.linalg.lstsq(basis, part, rcond=None)[0]
    return part


def _quiet(parts: list[np.ndarray]) -> list[np.ndarray]:
    """Without the parts in which something happened."""
    power = [float(np.var(part)) for part in parts]
    return [part for part, p in zip(parts, power, strict=True) if p <= NOISE.loudest_stretch * np.median(power)]


def _with_rounding(sd: float, a: np.ndarray, rounding: float) -> tuple[float, np.ndarray]:
    """Noise seen at rest and readings in steps: at rest a coarse step hides the noise, on the move it is noise itself."""
    floor = stationary_deviation(sd, a)
    return (float(np.hypot(rounding, floor)), np.zeros(0)) if rounding > floor else (sd, a)


def _robust(values: np.ndarray) -> float:
    return float(STATISTICS.mad_to_sd * np.median(np.abs(values - np.median(values))))


def drive_period(drive: np.ndarray) -> int | None:
    """The number of samples after which the drive (n, n_u) repeats exactly, at least twice; None where it does not."""
    n, span = len(drive), np.ptp(drive, axis=0).max(initial=0.0)
    if span == 0 or n < 100:
        return None
    first = drive[:32]
    matches = np.flatnonzero(np.all(np.abs(drive[: n - 32] - first[0]) <= NOISE.same_drive * span, axis=1))
    for lag in matches[matches >= 50]:
        if 2 * lag > n:
            return None
        if np.all(np.abs(drive[lag : lag + 32] - first) <= NOISE.same_drive * span) and np.all(
            np.abs(drive[lag:] - drive[:-lag]) <= NOISE.same_drive * span
        ):
            return int(lag)
    return None


def _repeats(record: Record, i: int) -> list[np.ndarray]:
    """Differences of neighbouring periods, the first left out for its transient, with the noise's own size."""
    P = drive_period(record.drive) if record.period is None else round(record.period / record.sample_time)
    if P is None or len(record.time) < 3 * P:
        return []
    y = np.where(record.valid[:, i], record.observed[:, i], np.nan)
    whole = y[P : len(y) // P * P].reshape(-1, P)
    differences = np.diff(whole[: len(whole) // 2 * 2], axis=0)[::2] / np.sqrt(2.0)
    return [d[np.isfinite(d)] for d in differences]


def _dwells(record: Record, i: int, settling: float) -> list[np.ndarray]:
    """Readings while the drive stood still, after the device has settled."""
    moved = np.any(np.diff(record.drive, axis=0) != 0, axis=1)
    edges = np.flatnonzero(np.concatenate([[True], moved, [True]]))
    wait = int(np.ceil(settling / record.sample_time))
    dwells = ((a + wait, b) for a, b in pairwise(edges) if b - a - wait >= NOISE.shortest_stretch)
    return [record.observed[a:b, i][record.valid[a:b, i]] for a, b in dwells]


def autoregression(parts: list[np.ndarray]) -> tuple[float, np.ndarray]:
    """Innovation deviation and coefficients by Yule-Walker over all parts; the order by BIC."""
    n = sum(map(len, parts))
    lags = np.array([sum(float(p[: len(p) - k] @ p[k:]) for p in parts) / n for k in range(NOISE.longest_order + 1)])
    if lags[0] <= 0:  # a reading that does not move
        return 0.0, np.zeros(0)
    best = (n * np.log(lags[0]), lags[0], np.zeros(0))
    for order in range(1, NOISE.longest_order + 1):
        toeplitz = lags[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
        a = np.linalg.solve(toeplitz, lags[1 : order + 1])
        variance = lags[0] - a @ lags[1 : order + 1]
        if variance <= 0:
            break
        bic = n * np.log(variance) + order * np.log(n)
        if bic < best[0]:
            best = (bic, variance, a)
    return float(np.sqrt(best[1])), best[2]


def ljung_box(e: np.ndarray, lags: int = STATISTICS.whiteness_lags) -> float:
    """p of the hypothesis that `e` has no autocorrelation up to `lags`. G. M. Ljung, G. E. P. Box, Biometrika 65 (1978) 297."""
    n, e = len(e), e - np.mean(e)
    total = float(e @ e)
    if total == 0:
        return 1.0
    r = np.array([float(e[k:] @ e[:-k]) / total for k in range(1, lags + 1)])
    return float(stats.chi2.sf(n * (n + 2) * np.sum(r**2 / (n - np.arange(1, lags + 1))), lags))

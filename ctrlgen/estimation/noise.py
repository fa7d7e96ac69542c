"""Step 1: the noise of every channel, estimated before any model is fitted.

The misfit of a model is never taken as noise while another source exists. Of a time series, in order of trust: a record at
rest; differences of repeated periods; dwells of the drive, unless they are several times as loud as stated; the stated standard
deviation; last, with a note, the fastest part of the readings, which `residual_noise` then refines. The noise is
autoregressive, its order chosen by BIC. Of settled poses: the stated standard deviation; then the scatter of repeated
poses, which lost motion and creep widen.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from scipy import stats
from scipy.signal import lfilter

from ctrlgen.core.counts import number_of
from ctrlgen.estimation.quiet_stretches import (
    at_rest,
    detrended,
    dwells,
    period_differences,
    without_events,
    without_lines,
)
from ctrlgen.estimation.settings import NOISE, STATISTICS
from ctrlgen.numerics.quantisation_step import quantisation_step
from ctrlgen.recordings.recording import Record, Recording


class NoiseSource(Enum):
    """What tells the noise of a channel, with the words that say so."""

    REST = "from a record at rest"
    PERIODS = "from repeated periods"
    DWELLS = "from dwells of the drive"
    POSES = "from repeated poses"
    STATED = "as stated"
    STATED_WHITE = "as stated, taken as white"
    """Of a time series: its size is corrected where the residual shows another one."""
    RESIDUAL = "what is left is taken as the noise"
    """It was stated, and wrongly."""
    FASTEST_PART = "from the fastest part of the readings, taken as white"
    MISFIT = "not stated"
    """Only the misfit of the best model tells it."""

    @property
    def stated(self) -> bool:
        """Whether the noise is as the recording's author stated it."""
        return self in (NoiseSource.STATED, NoiseSource.STATED_WHITE)


@dataclass(frozen=True)
class Noise:
    """Autoregressive noise e of each channel: e[k] = a[0] e[k-1] + a[1] e[k-2] + ... + sd w[k], w white with unit variance.

    `sd` (n_y,) [SI] of the innovations, `ar` the coefficients a of each channel, `sources` what tells them, `notes` a sentence a
    channel on that. `count` (n_y,) is the number of independent samples that the estimate rests on or, of a stated one, counts for;
    infinite where it is not doubted.
    """

    sd: np.ndarray
    ar: tuple[np.ndarray, ...]
    sources: tuple[NoiseSource, ...]
    notes: tuple[str, ...]
    count: np.ndarray

    def from_source(self, source: NoiseSource) -> np.ndarray:
        """Which channels (n_y,) have their noise from one source."""
        return np.array([s is source for s in self.sources], bool)

    @property
    def known(self) -> np.ndarray:
        """(n_y,), False where only the misfit tells the noise."""
        return ~self.from_source(NoiseSource.MISFIT)

    @property
    def stated(self) -> np.ndarray:
        """(n_y,), True where the noise is as the recording's author stated it."""
        return np.array([s.stated for s in self.sources], bool)

    @property
    def guessed(self) -> np.ndarray:
        """(n_y,), True where only the fastest part of the readings tells the noise, until a residual does."""
        return self.from_source(NoiseSource.FASTEST_PART)

    @property
    def measured(self) -> np.ndarray:
        """(n_y,), True where rest, repetition or the author tells the noise, not the motion that is to be explained."""
        return self.known & ~self.guessed & ~self.from_source(NoiseSource.RESIDUAL)

    def whiten(self, values: np.ndarray, valid: np.ndarray) -> np.ndarray:
        """`values` (n, n_y, ...) [SI] filtered so that the noise in them becomes white with unit variance.

        Zero where a sample, or one of the earlier samples that its filter needs, is not `valid` (n, n_y).
        """
        white, usable = np.zeros_like(values), self.usable(valid)
        for i, a in enumerate(self.ar):
            clean = np.where(valid[:, i].reshape(-1, *(1,) * (values.ndim - 2)), values[:, i], 0.0)
            white[len(a) :, i] = self.whiten_channel(clean, i)
            white[~usable[:, i], i] = 0.0
        return white

    def whiten_channel(self, values: np.ndarray, i: int) -> np.ndarray:
        """`values` (n, ...) [SI] of channel i whitened, (n - order, ...): without the first samples, as many as the order."""
        sd, a = self.sd[i], self.ar[i]
        n, order = len(values), len(a)
        with np.errstate(over="ignore", invalid="ignore"):  # of a simulation that runs away
            white = values[order:] / sd
            for lag, coefficient in enumerate(a, 1):
                white -= coefficient / sd * values[order - lag : n - lag]
        return white

    def usable(self, valid: np.ndarray) -> np.ndarray:
        """Which samples (n, n_y) can be whitened: they and the earlier samples that the filter needs are `valid` (n, n_y)."""
        good = valid.copy()
        for i, a in enumerate(self.ar):
            for lag in range(1, len(a) + 1):
                good[lag:, i] &= valid[:-lag, i]
            good[: len(a), i] = False
        return good

    @property
    def floor(self) -> np.ndarray:
        """Standard deviation (n_y,) [SI] of the noise itself, not of its innovations."""
        return np.array([stationary_deviation(sd, a) for sd, a in zip(self.sd, self.ar, strict=True)])


def stationary_deviation(sd: float, a: np.ndarray) -> float:
    """Standard deviation of autoregressive noise with innovations `sd` and coefficients `a`.

    sd times the root of the summed squares of the impulse response, over 4096 samples.
    """
    impulse = np.zeros(4096)
    impulse[0] = 1.0
    return float(sd * np.sqrt(np.sum(lfilter([1.0], np.concatenate([[1.0], -a]), impulse) ** 2)))


@dataclass(frozen=True)
class _ChannelNoise:
    """The fields of `Noise` for one channel; `details` follow what the source says."""

    sd: float
    source: NoiseSource
    count: float
    details: str = ""
    ar: np.ndarray = field(default_factory=lambda: np.zeros(0))


def estimate_noise(recording: Recording, settling: float) -> Noise:
    """The noise of each observed channel.

    `settling` [s] is the time that the device itself needs after a change of its drive; dwells are read after it.
    """
    estimate = _of_poses if recording.kind == "poses" else _of_series
    rows = [estimate(recording, i, settling) for i in range(len(recording.channels))]
    return Noise(
        sd=np.array([r.sd for r in rows]),
        ar=tuple(r.ar for r in rows),
        sources=tuple(r.source for r in rows),
        notes=tuple(f"{c}: {r.source.value}{r.details}" for c, r in zip(recording.channels, rows, strict=True)),
        count=np.array([r.count for r in rows]),
    )


def _of_poses(recording: Recording, i: int, settling: float) -> _ChannelNoise:
    """The noise of channel `i` of a recording of settled poses."""
    if stated := recording.noise[i]:
        return _ChannelNoise(stated, NoiseSource.STATED, np.inf)
    sd, count = repeatability(recording.records, i)
    if count >= NOISE.fewest_repeats and sd > 0:
        return _ChannelNoise(sd, NoiseSource.POSES, float(count), f", {count} beyond the first of each")
    few = f"only {number_of(count, 'pose repeats', 'poses repeat')} an earlier one" if count else "no pose repeats"
    return _ChannelNoise(1.0, NoiseSource.MISFIT, np.inf, f", and {few}; estimated from the residual of the best model")


def _of_series(recording: Recording, i: int, settling: float) -> _ChannelNoise:
    """The noise of channel `i` of a recording in time."""
    values = np.concatenate([r.observed[r.valid[:, i], i] for r in recording.records])
    # standard deviation of a uniform rounding error
    rounding = quantisation_step(values) / np.sqrt(12.0)
    moving = [r for r in recording.records if r.role != "rest"]
    stated, stated_details = recording.noise[i], ""
    # degree of the polynomial to subtract, stretches of noise
    sources = {
        NoiseSource.REST: (1, [at_rest(r, i) for r in recording.records if r.role == "rest"]),
        NoiseSource.PERIODS: (1, [e for r in moving for e in period_differences(r, i)]),
        NoiseSource.DWELLS: (NOISE.dwell_degree, [e for r in moving for e in dwells(r, i, settling)]),
    }
    for source, (degree, stretches) in sources.items():
        # a constant stretch is a dead or coarse channel: it tells no noise
        long = [s for s in stretches if len(s) >= NOISE.shortest_stretch and np.ptp(s) > 0]
        quiet = without_events([without_lines(detrended(s, degree)) for s in long])
        if quiet:
            beneath = None if source is NoiseSource.PERIODS else _beneath_steps(long, rounding * np.sqrt(12.0))
            found = _from_stretches(quiet, source, rounding, degree + 1, beneath)
            ratio = (
                stationary_deviation(found.sd, found.ar) / stated if stated and source is NoiseSource.DWELLS else 0.0
            )
            if ratio <= NOISE.moves_in_dwells:
                return found
            stated_details = (
                f"; in dwells of the drive it scatters by {ratio:.2g} times that, which is taken for motion"
            )
    if stated:
        sd, _ = _with_rounding(stated, np.zeros(0), rounding, None)
        return _ChannelNoise(sd, NoiseSource.STATED_WHITE, NOISE.stated_samples, stated_details)
    deviation, n = fastest_part(recording, i)
    # third differences of white noise have 1 + 9 + 9 + 1 = 20 times its variance
    sd, count = deviation / np.sqrt(20.0), n / NOISE.robust_cost
    return _ChannelNoise(sd, NoiseSource.FASTEST_PART, count, "; a record at rest would tell it better")


def fastest_part(recording: Recording, i: int) -> tuple[float, int]:
    """Standard deviation of most third differences of channel i, no less than that of its rounding, and their number."""
    thirds = [d for r in recording.records for d in _third_differences(r, i)]
    values = np.concatenate([r.observed[r.valid[:, i], i] for r in recording.records])
    deviation = _quiet_deviation if any(r.band for r in recording.records) else _robust_deviation
    # a uniform rounding error, taken as white
    least = quantisation_step(values) * np.sqrt(20.0 / 12.0)
    return max(deviation(np.concatenate(thirds)), least, 1e-300), sum(map(len, thirds))


def _from_stretches(
    stretches: list[np.ndarray], source: NoiseSource, rounding: float, removed: int, beneath: float | None
) -> _ChannelNoise:
    """The autoregressive noise of stretches of pure noise.

    A polynomial with as many coefficients as were `removed` takes the power of so many of the L/tau independent samples of a
    stretch with it, tau the correlation time; the variance is raised by what it took.
    """
    innovation, a = autoregression(stretches)
    tau = (innovation / max(1 - float(np.sum(a)), 1e-3) / max(stationary_deviation(innovation, a), 1e-300)) ** 2
    kept = sum(max(len(s) - removed * max(tau, 1.0), len(s) / 2) for s in stretches) / sum(map(len, stretches))
    sd, a = _with_rounding(innovation / np.sqrt(kept), a, rounding, beneath)
    n, ratio = sum(map(len, stretches)), stationary_deviation(sd, a) / sd
    details = f", {number_of(n, 'sample')}, autoregressive of order {len(a)}"
    if ratio > NOISE.slow_ratio:
        details += f"; it is slow, {ratio:.0f} times its innovations: part of it may be motion of the device, not of its sensor"
    return _ChannelNoise(sd, source, float(n), details, a)


def repeatability(records: tuple[Record, ...], i: int) -> tuple[float, int]:
    """Standard deviation [SI] of channel i within groups of poses with one drive, and its degrees of freedom."""
    drive = np.concatenate([r.drive[r.valid[:, i]] for r in records])
    y = np.concatenate([r.observed[r.valid[:, i], i] for r in records])
    span = np.ptp(drive, axis=0)
    levels = np.round(drive / np.where(span > 0, NOISE.same_drive * span, 1.0))
    _, group = np.unique(levels, axis=0, return_inverse=True)
    group = group.ravel()
    mean = np.bincount(group, y) / np.bincount(group)
    count = len(y) - len(mean)
    return float(np.sqrt(np.sum((y - mean[group]) ** 2) / max(count, 1))), count


def _with_rounding(sd: float, a: np.ndarray, rounding: float, beneath: float | None) -> tuple[float, np.ndarray]:
    """Noise of a device that moves, from noise at rest and the standard deviation of the rounding error [SI]; `beneath`, that of what was
    rounded, where the steps of the readings tell it.

    A quantisation step above the noise hides it at rest, and on the move its rounding error is white noise itself. What is seen of the
    colour of the noise is kept where it is more than the rounding.
    """
    floor = stationary_deviation(sd, a)
    if beneath is None and floor >= rounding:
        return sd, a
    moving = float(np.hypot(rounding, floor if beneath is None else beneath))
    return (sd * moving / floor, a) if floor > rounding else (moving, np.zeros(0))


def _beneath_steps(stretches: list[np.ndarray], step: float) -> float | None:
    """Standard deviation [SI] of normal noise that leaves one step q of the readings now and then: where it is m above the middle of the
    step, it leaves the step upward and downward with the probabilities p and p',

        z(p) = (q/2 - m)/sigma,   z(p') = (q/2 + m)/sigma,   sigma = q/(z(p) + z(p')),   p = Q(z)

    (B. Widrow, I. Kollar, Quantization Noise, 2008); of an end that was not left p is half a reading. None where a third of the readings
    or more are elsewhere: what they scatter by tells it then.
    """
    left, n = np.zeros(2), 0
    for y in stretches if step > 0 else ():
        code = np.round((y - np.median(y)) / step)
        left += [np.sum(code > 0), np.sum(code < 0)]
        n += len(y)
    if n == 0 or left.sum() > n / 3:
        return None
    return step / float(np.sum(stats.norm.isf(np.maximum(left, 0.5) / n)))


def _third_differences(record: Record, i: int) -> list[np.ndarray]:
    """Third differences of channel i over so many rows as make twice the cut-off of the low-pass that the columns passed:
    within its band, for beyond it there is no noise left to see. Over neighbouring rows where they passed none."""
    y = record.observed[record.valid[:, i], i]
    every = max(round(1 / (2 * record.band * record.sample_time)), 1) if record.band else 1
    return [np.diff(y[first::every], 3) for first in range(every)]


def _quiet_deviation(values: np.ndarray) -> float:
    """Standard deviation of the quietest values (n,), as if they were normal: within the band of a low-pass the device moves
    too, and less than the noise only now and then."""
    share = NOISE.quiet_share
    return float(np.quantile(np.abs(values), share) / stats.norm.ppf((1 + share) / 2)) if len(values) else 0.0


def _robust_deviation(values: np.ndarray) -> float:
    """Standard deviation of normal values (n,) by their median absolute deviation."""
    return float(STATISTICS.mad_to_sd * np.median(np.abs(values - np.median(values))))


def autoregression(stretches: list[np.ndarray]) -> tuple[float, np.ndarray]:
    """Standard deviation of the innovations and coefficients of autoregressive noise, (0, none) of a constant.

    Yule-Walker equations with the autocovariances of all stretches; of the orders up to `NOISE.longest_order` the one with
    the least BIC, n ln(variance) + order ln(n).
    """
    n, orders = sum(map(len, stretches)), range(1, NOISE.longest_order + 1)
    r = np.array([sum(float(s[: len(s) - k] @ s[k:]) for s in stretches) / n for k in (0, *orders)])
    if r[0] <= 0:
        return 0.0, np.zeros(0)
    best = (n * np.log(r[0]), r[0], np.zeros(0))
    for order in orders:
        toeplitz = r[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
        a = np.linalg.solve(toeplitz, r[1 : order + 1])
        variance = r[0] - a @ r[1 : order + 1]
        if variance <= 0:
            break
        bic = n * np.log(variance) + order * np.log(n)
        if bic < best[0]:
            best = (bic, variance, a)
    return float(np.sqrt(best[1])), best[2]


def ljung_box(e: np.ndarray, lags: int = STATISTICS.whiteness_lags) -> float:
    """p of the hypothesis that `e` (n,) has no autocorrelation at lags 1 ... `lags`.

    n (n + 2) sum r_k^2/(n - k) against chi-square (G. M. Ljung, G. E. P. Box, Biometrika 65 (1978) 297).
    """
    n, e = len(e), e - np.mean(e)
    total = float(e @ e)
    if total == 0:
        return 1.0
    r = np.array([float(e[k:] @ e[:-k]) / total for k in range(1, lags + 1)])
    return float(stats.chi2.sf(n * (n + 2) * np.sum(r**2 / (n - np.arange(1, lags + 1))), lags))


def cross_correlation(e: np.ndarray, drive: np.ndarray, lags: int = STATISTICS.whiteness_lags) -> float:
    """p of the hypothesis that white `e` (n,) is uncorrelated with each drive (n, n_u) at lags 0 ... `lags` (Bonferroni)."""
    n, worst = len(e), 0.0
    for u in drive.T:
        u = u - np.mean(u)
        if np.std(u) == 0:
            continue
        for k in range(lags + 1):
            a, b = e[k:], u[: n - k]
            worst = max(worst, abs(float(a @ b)) / (np.std(e) * np.linalg.norm(b)))
    return float(min(1.0, 2 * stats.norm.sf(worst) * (lags + 1) * drive.shape[1]))

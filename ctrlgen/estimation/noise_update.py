"""Noise updated from the residual of a fit: guessed noise, the colour of noise known from few samples, and the size of noise
that only the misfit tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.noise import (
    Noise,
    NoiseSource,
    autoregression,
    cross_correlation,
    ljung_box,
    stationary_deviation,
)
from ctrlgen.estimation.pose_noise import stated_pose_noise
from ctrlgen.estimation.quiet_stretches import without_lines
from ctrlgen.estimation.residual_noise import louder_than_readings, noise_from_residual
from ctrlgen.estimation.settings import DISCREPANCY, NOISE, NOISE_UPDATE, STATISTICS
from ctrlgen.recordings.recording import Record


def update_noise(fitter: Fitter, fit: Fit) -> Noise:
    """The noise after a fit with causes; the same object where the fit tells nothing new.

    Guessed noise is estimated again and replaced where it became smaller, for physics that was left out only adds to it.
    Of other noise the colour may change, see `update_noise_colour`, and of stated noise the size, see `correct_stated_noise`.
    """
    noise = fitter.noise
    if fitter.recording.kind == "poses":
        return stated_pose_noise(fitter, fit)
    if not noise.guessed.any():
        return correct_stated_noise(fitter.with_noise(update_noise_colour(fitter, fit)), fit)
    update = update_guessed_noise(fitter, fit)
    smaller = update.floor < noise.floor
    if not smaller.any():
        return noise
    source = [update if s else noise for s in smaller]
    return replace(
        noise,
        sd=np.where(smaller, update.sd, noise.sd),
        count=np.where(smaller, update.count, noise.count),
        ar=tuple(source[i].ar[i] for i in range(len(smaller))),
        notes=tuple(source[i].notes[i] for i in range(len(smaller))),
    )


def update_guessed_noise(fitter: Fitter, fit: Fit) -> Noise:
    """Guessed noise estimated from the residual of `fit` at the frequencies at which the readings move least.

    Variances and coefficients of the records to fit are averaged by their numbers of independent samples. Where the readings would have
    to be louder than most of them are, the residual is physics that was left out and acts at all frequencies, as a lag after steps of
    the drive does, and the guess stays.
    """
    noise, channels = fitter.noise, fitter.recording.channels
    sd, ar, count, notes = noise.sd.copy(), list(noise.ar), noise.count.copy(), list(noise.notes)
    for i in np.flatnonzero(noise.guessed).tolist():
        estimates = [e for r in fitter.fit_records if (e := _of_longest_stretch(fitter, fit, r, i)) is not None]
        if not estimates:
            continue
        weights = [n for *_, n in estimates]
        order = max(len(a) for _, a, _ in estimates)
        size = float(np.sqrt(np.average([s**2 for s, *_ in estimates], weights=weights)))
        colour = np.average([np.pad(a, (0, order - len(a))) for _, a, _ in estimates], axis=0, weights=weights)
        if louder_than_readings(fitter.recording, i, size, colour):
            continue
        sd[i], ar[i] = size, colour
        count[i] = sum(weights)
        notes[i] = (
            f"{channels[i]}: from the residual of the fit at the frequencies at which the readings move least, "
            f"autoregressive of order {order}; a record at rest would tell it better"
        )
    return replace(noise, sd=sd, ar=tuple(ar), count=count, notes=tuple(notes))


def _of_longest_stretch(fitter: Fitter, fit: Fit, record: Record, i: int) -> tuple[float, np.ndarray, float] | None:
    """`noise_from_residual` on the longest stretch of channel i whose gaps are short, with straight lines across them. A channel that is
    read in one row of several tells the size of its noise by these rows, and no colour from row to row."""
    y = fitter.predict(fit, record)[:, i]
    good = record.valid[:, i] & np.isfinite(y)
    every = usual_spacing(good)
    stretch = longest_stretch(good, every)
    if stretch is None:
        return None
    a, b = stretch
    at, rows = a + np.flatnonzero(good[a:b]), np.arange(a, b, every)
    residual = np.interp(rows, at, record.observed[at, i] - y[at])
    highest = min(2 * record.band * record.sample_time * every, 1.0) if record.band else 1.0
    found = noise_from_residual(residual, np.interp(rows, at, y[at]), highest)
    if found is None or every == 1:
        return found
    sd, colour, count = found
    return stationary_deviation(sd, colour), np.zeros(0), count


def usual_spacing(good: np.ndarray) -> int:
    """Rows from one `good` sample (n,) to the next, in most cases; 1 where there are none."""
    apart = np.diff(np.flatnonzero(good))
    return int(np.bincount(apart).argmax()) if len(apart) else 1


def longest_stretch(good: np.ndarray, every: int = 1) -> tuple[int, int] | None:
    """The longest half-open range of `good` samples (n,), of which one row in `every` is one, with no more than `NOISE_UPDATE.bridged`
    missing in a row between; None where none is good."""
    at = np.flatnonzero(good)
    if not len(at):
        return None
    parts = np.split(at, np.flatnonzero(np.diff(at) > every * (NOISE_UPDATE.bridged + 1)) + 1)
    longest = max(parts, key=lambda part: part[-1] - part[0])
    return int(longest[0]), int(longest[-1]) + 1


def correct_stated_noise(fitter: Fitter, fit: Fit) -> Noise:
    """The noise with the size of the residual of `fit` for channels whose stated noise is wrong; the same object where none is.

    What is left is noise of another size, and no physics, where it is white on every record, its variance does not change, and
    it has nothing to do with drive, prediction, their squares and how fast they change. Physics of a stage that moves smoothly is
    never white. Of settled poses see `stated_pose_noise`.
    """
    noise = fitter.noise
    if fitter.recording.kind == "poses":
        return stated_pose_noise(fitter, fit)
    sd, notes, count, sources = noise.sd.copy(), list(noise.notes), noise.count.copy(), list(noise.sources)
    for i in np.flatnonzero(noise.from_source(NoiseSource.STATED_WHITE)).tolist():
        records = [r for r in fitter.recording.records if r.role != "rest"]
        residuals = [_residual(fitter, fit, r, i) for r in records]
        size = float(np.sqrt(np.mean(np.concatenate(residuals) ** 2)))
        ratio = size / noise.floor[i]
        if not (1 / NOISE_UPDATE.stated_factor < ratio < NOISE_UPDATE.stated_factor) or len(noise.ar[i]):
            continue
        if abs(ratio - 1) < NOISE_UPDATE.stated_margin or not all(
            _is_noise_alone(e, _motion(fitter, fit, r, i)) for e, r in zip(residuals, records, strict=True)
        ):
            continue
        sd[i], count[i], sources[i] = size, sum(map(len, residuals)), NoiseSource.RESIDUAL
        notes[i] = (
            f"{fitter.recording.channels[i]}: the stated noise is {1 / ratio:.2f} of what is left, which is white and has nothing to do "
            f"with the drive; {NoiseSource.RESIDUAL.value}"
        )
    if np.array_equal(sd, noise.sd):
        return noise
    return replace(noise, sd=sd, sources=tuple(sources), notes=tuple(notes), count=count)


def _motion(fitter: Fitter, fit: Fit, record: Record, i: int) -> np.ndarray:
    """Drives and prediction of channel i, their squares and the size of their changes (n, m) at its valid samples: what a law that is
    missing goes with."""
    good = record.valid[:, i]
    signals = np.column_stack([record.drive, fitter.predict(fit, record)[:, i]])
    signals = signals - signals.mean(axis=0)
    changes = np.abs(np.gradient(signals, axis=0))
    return np.hstack([signals, signals**2, changes])[good]


def _is_noise_alone(e: np.ndarray, motion: np.ndarray) -> bool:
    """Whether `e` (n,) is white, of steady variance, and uncorrelated with the `motion` (n, m)."""
    if len(e) < STATISTICS.fewest_per_lag * STATISTICS.whiteness_lags or np.ptp(e) == 0:
        return False
    e = np.clip(e, *(DISCREPANCY.huber_corner * np.std(e) * np.array([-1, 1])))
    p = (ljung_box(e), ljung_box(e**2 - np.mean(e**2)), cross_correlation(e, motion))
    return min(p) > NOISE_UPDATE.noise_alone_p


def update_noise_colour(fitter: Fitter, fit: Fit) -> Noise:
    """The noise with the colour of the residual of `fit`, per channel; the same object where no channel changes.

    A channel changes where its noise was estimated from fewer samples than there are to fit, or stated without a colour, the residual
    is not much larger than the noise, and rest, whitened by the residual's coefficients, is white. The standard deviation follows the
    residual too, but not beyond the uncertainty of its first estimate.
    """
    noise = fitter.noise
    sd, ar, floor = noise.sd.copy(), list(noise.ar), noise.floor
    changed = False
    rests = [r for r in fitter.recording.records if r.role == "rest"]
    there = sum(len(r.time) for r in fitter.fit_records)
    no_colour = noise.from_source(NoiseSource.STATED_WHITE) & (there >= NOISE.shortest_stretch)
    for i in np.flatnonzero((noise.count < there) | no_colour).tolist():
        residuals = [_residual(fitter, fit, r, i) for r in fitter.fit_records]
        rms = np.sqrt(np.mean(np.concatenate(residuals) ** 2))
        if rms >= NOISE_UPDATE.largest_residual * floor[i]:
            continue
        innovation, a = autoregression(residuals)
        if all(_has_colour(_residual(fitter, fit, r, i), a) for r in rests):
            changed = True
            largest = floor[i] * (1 + STATISTICS.noise_size_margin / np.sqrt(2 * noise.count[i]))
            sd[i], ar[i] = innovation * min(1.0, largest / rms), a
    return replace(noise, sd=sd, ar=tuple(ar)) if changed else noise


def _residual(fitter: Fitter, fit: Fit, record: Record, i: int) -> np.ndarray:
    """Observed minus predicted [SI] at the valid samples of channel i."""
    return (record.observed - fitter.predict(fit, record))[record.valid[:, i], i]


def _has_colour(rest: np.ndarray, a: np.ndarray) -> bool:
    """Whether `rest` (n,) is white after whitening by the coefficients `a`; True where it is too short to tell."""
    if len(rest) < STATISTICS.fewest_per_lag * STATISTICS.whiteness_lags or np.ptp(rest) == 0:
        return True
    white = np.convolve(rest, np.concatenate([[1.0], -a]), "valid")
    return ljung_box(without_lines(white)) > NOISE_UPDATE.other_colour_p


def update_noise_size(fitter: Fitter, fit: Fit) -> Noise:
    """Noise that only the misfit tells: the root mean square of the residual of `fit`, over all channels of one unit.

    The variance is divided by the share of samples that the fitted parameters leave free.
    """
    recording, noise = fitter.recording, fitter.noise
    squares, count = np.zeros(len(recording.channels)), np.zeros(len(recording.channels))
    for record in fitter.fit_records:
        y = fitter.predict(fit, record)
        squares += np.sum(np.where(record.valid, record.observed - y, 0.0) ** 2, axis=0)
        count += record.valid.sum(axis=0)
    sd = noise.sd.copy()
    used = len(fit.theta) / max(count.sum(), 1.0)
    for i in np.flatnonzero(~noise.known):
        same_unit = [k for k, unit in enumerate(recording.units) if unit == recording.units[i]]
        sd[i] = np.sqrt(squares[same_unit].sum() / (count[same_unit].sum() * (1 - used)))
    return replace(noise, sd=sd)

"""Noise learnt from a fit: where it was only guessed, its colour where that was known from few samples, and its size where
nothing but the misfit tells it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.estimation.noise import Noise, autoregression, ljung_box, without_lines
from ctrlgen.diagnosis.estimation.residual_noise import noise_from_residual
from ctrlgen.diagnosis.settings import NOISE_UPDATE, STATISTICS
from ctrlgen.recordings.recording import Record


def update_guessed_noise(fitter: Fitter, fit: Fit) -> Noise:
    """Where the noise was guessed: from what `fit` leaves at the frequencies at which the readings move least."""
    noise, channels = fitter.noise, fitter.recording.channels
    sd, ar, count, said = noise.sd.copy(), list(noise.ar), noise.count.copy(), list(noise.notes)
    for i in np.flatnonzero(noise.guessed).tolist():
        parts = [p for r in fitter.fit_records if (p := _quiet(fitter, fit, r, i)) is not None]
        if not parts:
            continue
        weights = [c for *_, c in parts]
        order = max(len(a) for _, a, _ in parts)
        sd[i] = np.sqrt(np.average([s**2 for s, *_ in parts], weights=weights))
        ar[i] = np.average([np.pad(a, (0, order - len(a))) for _, a, _ in parts], axis=0, weights=weights)
        count[i] = sum(weights)
        said[i] = (
            f"{channels[i]}: from what the fit leaves at the frequencies at which the "
            f"readings move least, autoregressive of order {order}; record some rest to know it"
        )
    return replace(noise, sd=sd, ar=tuple(ar), count=count, notes=tuple(said))


def _quiet(fitter: Fitter, fit: Fit, record: Record, i: int) -> tuple[float, np.ndarray, float] | None:
    """On the longest stretch of valid samples of channel i."""
    y = fitter.predict(fit, record)[:, i]
    good = np.flatnonzero(np.diff(np.concatenate([[False], record.valid[:, i] & np.isfinite(y), [False]])))
    if not len(good):
        return None
    a, b = max(good.reshape(-1, 2), key=lambda run: run[1] - run[0])
    return noise_from_residual((record.observed[:, i] - y)[a:b], y[a:b])


def update_noise(fitter: Fitter, fit: Fit) -> Noise:
    """What a fit with causes tells of the noise: of one that was guessed, where it is smaller now, as physics left out only
    adds to it; else its colour. The same noise where nothing is learnt."""
    noise = fitter.noise
    if not noise.guessed.any():
        return update_noise_colour(fitter, fit)
    found = update_guessed_noise(fitter, fit)
    smaller = found.floor < noise.floor
    if not smaller.any():
        return noise
    better = [found if s else noise for s in smaller]
    return replace(
        noise,
        sd=np.where(smaller, found.sd, noise.sd),
        count=np.where(smaller, found.count, noise.count),
        ar=tuple(each.ar[i] for i, each in enumerate(better)),
        notes=tuple(each.notes[i] for i, each in enumerate(better)),
    )


def update_noise_colour(fitter: Fitter, fit: Fit) -> Noise:
    """Where the noise was known from fewer samples than there are to fit: the colour of what `fit` leaves, if it leaves
    little, and no colour that the rest has not; the same noise where none is learnt. Its size is not let grow beyond what
    the first estimate allows.
    """
    noise = fitter.noise
    sd, ar, floor = noise.sd.copy(), list(noise.ar), noise.floor
    learnt = False
    rests = [r for r in fitter.recording.records if r.role == "rest"]
    for i in np.flatnonzero(noise.count < sum(len(r.time) for r in fitter.fit_records)).tolist():
        parts = [_left(fitter, fit, r, i) for r in fitter.fit_records]
        left = np.sqrt(np.mean(np.concatenate(parts) ** 2))
        if left >= NOISE_UPDATE.largest_residual * floor[i]:
            continue
        found = autoregression(parts)
        if all(_of_that_colour(_left(fitter, fit, r, i), found[1]) for r in rests):
            learnt, (sd[i], ar[i]) = True, found
            sd[i] *= min(1.0, floor[i] * (1 + STATISTICS.noise_size_margin / np.sqrt(2 * noise.count[i])) / left)
    return replace(noise, sd=sd, ar=tuple(ar)) if learnt else noise


def _left(fitter: Fitter, fit: Fit, record: Record, i: int) -> np.ndarray:
    return (record.observed - fitter.predict(fit, record))[record.valid[:, i], i]


def _of_that_colour(rest: np.ndarray, a: np.ndarray) -> bool:
    """Whether `rest` (n,) is white once what the coefficients `a` foresee is taken out."""
    if len(rest) < STATISTICS.fewest_per_lag * STATISTICS.whiteness_lags or np.ptp(rest) == 0:
        return True
    white = np.convolve(rest, np.concatenate([[1.0], -a]), "valid")
    return ljung_box(without_lines(white)) > NOISE_UPDATE.other_colour_p


def update_noise_size(fitter: Fitter, fit: Fit) -> Noise:
    """Where nothing but the misfit tells the noise: what `fit` leaves over, alike for all channels of one unit."""
    recording, noise = fitter.recording, fitter.noise
    squares, count = np.zeros(len(recording.channels)), np.zeros(len(recording.channels))
    for record in fitter.fit_records:
        y = fitter.predict(fit, record)
        squares += np.sum(np.where(record.valid, record.observed - y, 0.0) ** 2, axis=0)
        count += record.valid.sum(axis=0)
    sd = noise.sd.copy()
    used = len(fit.theta) / max(count.sum(), 1.0)
    for i in np.flatnonzero(~noise.known):
        alike = [k for k, unit in enumerate(recording.units) if unit == recording.units[i]]
        sd[i] = np.sqrt(squares[alike].sum() / (count[alike].sum() * (1 - used)))
    return replace(noise, sd=sd)

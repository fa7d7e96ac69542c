"""What separates readings from a model of them: measurement noise n, and the discrepancy d of the model itself.

    e = y - y(p) = d + n

Noise says whether anything is left. The discrepancy says how much anything counts: every model of a real machine is wrong by
a per cent or two somewhere, and a fit that weighs its residual by the noise alone is sure of wrong numbers (M. Kennedy,
A. O'Hagan, J. R. Stat. Soc. B 63 (2001) 425; J. Schoukens, L. Ljung, IEEE Control Systems 39(6) (2019) 28). It is estimated
from what the present best model leaves. A channel without discrepancy is whitened by its noise; one with discrepancy is divided by

    s = sqrt(tau) rms(e),   tau = 1 + 2 sum_k rho_k

tau the correlation time of e in samples, so that n samples count as n/tau independent ones. No filter whitens a discrepancy:
its spectrum is known too poorly, and differencing would give all weight to the fastest part of the readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ctrlgen.estimation.noise import Noise
from ctrlgen.estimation.settings import DISCREPANCY, STATISTICS
from ctrlgen.recordings.recording import Record


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """`noise`; `rms` (n_y,) [SI] of the residual of channels with discrepancy, 0 for those without; `tau` (n_y,) [samples]."""

    noise: Noise
    rms: np.ndarray
    tau: np.ndarray

    @classmethod
    def of_noise(cls, noise: Noise) -> ErrorModel:
        """The error model of `noise` alone, without discrepancy."""
        return cls(noise, np.zeros(len(noise.sd)), np.ones(len(noise.sd)))

    @property
    def is_noise(self) -> bool:
        """Whether no channel has discrepancy."""
        return not self.rms.any()

    @property
    def ar(self) -> tuple[np.ndarray, ...]:
        """Coefficients of the whitening filter of each channel."""
        return tuple(np.zeros(0) if d else a for d, a in zip(self.rms, self.noise.ar, strict=True))

    @cached_property
    def weighted(self) -> Noise:
        """White noise with the deviation s in place of the noise of every channel with discrepancy."""
        sd = np.where(self.rms > 0, self.rms * np.sqrt(self.tau), self.noise.sd)
        return replace(self.noise, sd=sd, ar=self.ar)

    def whiten(self, values: np.ndarray, valid: np.ndarray) -> np.ndarray:
        """Whitens noise and discrepancy; arguments as of `Noise.whiten`."""
        return self.weighted.whiten(values, valid)

    def whiten_channel(self, values: np.ndarray, i: int) -> np.ndarray:
        """Whitens one channel; arguments as of `Noise.whiten_channel`."""
        return self.weighted.whiten_channel(values, i)

    def usable(self, valid: np.ndarray) -> np.ndarray:
        """Says which samples can be whitened; arguments as of `Noise.usable`."""
        return self.weighted.usable(valid)

    @property
    def corner(self) -> np.ndarray:
        """Whitened residual (n_y,) from which on Huber's loss grows linearly."""
        return DISCREPANCY.huber_corner / np.sqrt(self.tau)

    def effective(self, valid: np.ndarray) -> np.ndarray:
        """Independent samples (n_y,) among those `valid` (n, n_y)."""
        return self.usable(valid).sum(axis=0) / self.tau


def error_model(noise: Noise, records: Sequence[Record], residuals: Sequence[np.ndarray]) -> ErrorModel:
    """The errors of a model that leaves `residuals` [(n, n_y) SI] on `records`.

    A channel has discrepancy where the mean of its whitened squares exceeds what the uncertainty of the noise allows. Where
    only the misfit tells the noise, there is nothing to tell discrepancy from.
    """
    rms, tau = np.zeros(len(noise.sd)), np.ones(len(noise.sd))
    for i in np.flatnonzero(noise.known).tolist():
        squares, count = 0.0, 0
        for record, e in zip(records, residuals, strict=True):
            white = noise.whiten(np.where(record.valid, e, 0.0), record.valid)[:, i]
            squares, count = squares + float(white @ white), count + int(noise.usable(record.valid)[:, i].sum())
        most = (DISCREPANCY.ratio * (1 + STATISTICS.noise_size_margin / np.sqrt(2 * max(noise.count[i], 1.0)))) ** 2
        stretches = [e[r.valid[:, i], i] for r, e in zip(records, residuals, strict=True)]
        if count == 0 or (squares / count <= most and not _slow_excess(noise, i, stretches, most)):
            continue
        rms[i] = max(np.sqrt(np.mean(np.concatenate(stretches) ** 2)), noise.floor[i])
        if np.isfinite(records[0].sample_time):
            tau[i] = correlation_time(stretches)
    return ErrorModel(noise, rms, tau)


def _slow_excess(noise: Noise, i: int, stretches: Sequence[np.ndarray], most: float) -> bool:
    """Whether the mean square of residuals (n,), over that of autoregressive noise, exceeds `most` beyond chance: whitening such
    noise takes away slow physics with it, and what is left of them looks like noise."""
    a = noise.ar[i]
    if not len(a):
        return False
    values = np.clip(np.concatenate(stretches) / noise.floor[i], -DISCREPANCY.huber_corner, DISCREPANCY.huber_corner)
    # spectrum at zero over variance
    correlated = (noise.sd[i] / noise.floor[i] / max(1 - float(np.sum(a)), 1e-3)) ** 2
    chance = STATISTICS.chance_excess * np.sqrt(2 * max(correlated, 1.0) / max(len(values), 1))
    return bool(np.mean(values**2) > most * (1 + chance))


def correlation_time(stretches: Sequence[np.ndarray]) -> float:
    """tau = 1 + 2 sum rho_k [samples] of `stretches` (n,), summed to the first rho_k below `DISCREPANCY.uncorrelated`.

    At least 1, at most `1/DISCREPANCY.fewest_independent` of all samples: fewer spans could not tell it.
    """
    n = sum(map(len, stretches))
    most = max(n / DISCREPANCY.fewest_independent, 1.0)
    length = max(map(len, stretches), default=0)
    if length < 2:
        return 1.0
    r = np.zeros(length)
    # an offset has no correlation time
    for e in (e - np.mean(e) for e in stretches if len(e)):
        spectrum = np.abs(np.fft.rfft(e, 2 * len(e))) ** 2
        r[: len(e)] += np.fft.irfft(spectrum)[: len(e)]
    if r[0] <= 0:
        return 1.0
    rho = r / r[0]
    last = int(np.argmax(rho < DISCREPANCY.uncorrelated)) or length
    return float(np.clip(1 + 2 * np.sum(rho[1:last]), 1.0, most))


def huber(white: np.ndarray, corner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values whose squares are Huber's loss of `white` (n, n_y), and their derivatives by `white`, both (n, n_y).

    r^2 up to the `corner` c (n_y,), 2 c |r| - c^2 beyond (P. J. Huber, Ann. Math. Statist. 35 (1964) 73): a spike pulls with
    a force that does not grow with its size.
    """
    size = np.abs(white)
    bent = np.sqrt(np.maximum(2 * corner * size - corner**2, 0.0))
    far = size > corner
    return np.where(far, np.sign(white) * bent, white), np.where(far, corner / np.maximum(bent, 1e-300), 1.0)


def huber_curvature(white: np.ndarray, corner: np.ndarray) -> np.ndarray:
    """The factor (n, n_y) on the squared derivatives of `huber` by which a step neither overshoots nor stops short.

    2 - c/|r| beyond the corner, 1 within: the parabola that touches the loss at r and lies above it elsewhere, whose minimum is
    at r = 0 (iteratively reweighted least squares; P. W. Holland, R. E. Welsch, Commun. Statist. A6 (1977) 813). The plain
    derivatives would take a sample at r to -(r - c), and the next step back.
    """
    size = np.abs(white)
    return 2.0 - np.where(size > corner, corner / np.maximum(size, 1e-300), 1.0)

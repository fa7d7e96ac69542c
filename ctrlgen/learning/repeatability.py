"""Which part of an error repeats: its coefficients over frequency, their standard error, and a shrinkage by frequency.

The samples of a run are transformed to orthonormal real coefficients: of a closed path its Fourier series, otherwise the cosine
transform (DCT-II). Repetitions of the run give each coefficient's mean and, pooled over neighbouring frequencies, its standard error s.
What does not stand out of s is taken for noise, block by block (block James-Stein, T. T. Cai, Ann. Statist. 27 (1999) 898):

    c -> max(0, 1 - lambda L s^2 / sum_block c^2) c,   L coefficients in a block, lambda = 4.505.

Where s itself is estimated from few repetitions, lambda is as much larger as keeps the probability with which noise alone passes: the
quantile of F in place of that of chi-squared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import dct, idct, irfft, rfft
from scipy.stats import chi2
from scipy.stats import f as f_ratio

LAMBDA = 4.50524  # the root of lambda - log(lambda) = 3: Cai 1999
NORMAL_MAD = 0.6745  # median of |c| of a standard normal c


@dataclass(frozen=True)
class Repeated:
    """A signal that was repeated: `mean` coefficients (n, n_y) and their standard error `se` (n, n_y), of `repeats` repetitions."""

    mean: np.ndarray
    se: np.ndarray
    repeats: int

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the standard error of each coefficient in a block; infinite where it was stated."""
        return self.repeats - 1 if self.repeats > 1 else np.inf

    def energy(self, weights: np.ndarray) -> tuple[float, float]:
        """The sum over all coefficients of `weights` (n_y,) times mean^2 - se^2, what of their squares is not noise, and its variance:
        2 s^4 + 4 c^2 s^2 of the square of a normal mean, 2 s^4/freedom of an s^2 that is pooled over a block of as many as are summed.

        c^2 is estimated by mean^2 - se^2 in the sum, where it is unbiased, not coefficient by coefficient above zero."""
        square, s2 = self.mean**2 - self.se**2, self.se**2
        noise = 2 * (1 + 1 / self.freedom) * np.sum((weights * s2) ** 2)
        return float(np.sum(weights * square)), float(noise + max(4 * np.sum(weights**2 * square * s2), 0.0))


class Spectrum:
    """Orthonormal real coefficients of n samples in blocks of neighbouring frequencies, about log(n) coefficients in each."""

    def __init__(self, n: int, periodic: bool) -> None:
        self.n, self.periodic = n, periodic
        k = np.arange(n)
        # Of the Fourier series: constant, cos, sin, cos, sin; a cosine transform has half the step
        harmonic = (k + 1) // 2
        self.block = harmonic // max(1, round(np.log(n) / 2))
        self.share = harmonic / max(1, harmonic[-1])  # of the highest frequency

    def coefficients(self, samples: np.ndarray, axis: int = 0) -> np.ndarray:
        """The coefficients along `axis`, sum of squares unchanged."""
        x = np.moveaxis(np.asarray(samples, float), axis, 0)
        if not self.periodic:
            return np.moveaxis(dct(x, axis=0, norm="ortho"), 0, axis)
        z = rfft(x, axis=0, norm="ortho")
        c = np.empty(x.shape)
        c[0], pairs = z[0].real, (self.n - 1) // 2
        c[1 : 2 * pairs : 2], c[2 : 2 * pairs + 1 : 2] = (np.sqrt(2) * part[1 : pairs + 1] for part in (z.real, z.imag))
        if self.n % 2 == 0:
            c[-1] = z[-1].real
        return np.moveaxis(c, 0, axis)

    def samples(self, coefficients: np.ndarray) -> np.ndarray:
        """The samples (n, m) that the `coefficients` (n, m) stand for."""
        c = coefficients
        if not self.periodic:
            return idct(c, axis=0, norm="ortho")
        pairs = (self.n - 1) // 2
        z = np.zeros((self.n // 2 + 1, *c.shape[1:]), complex)
        z[0] = c[0]
        z[1 : pairs + 1] = (c[1 : 2 * pairs : 2] + 1j * c[2 : 2 * pairs + 1 : 2]) / np.sqrt(2)
        if self.n % 2 == 0:
            z[-1] = c[-1]
        return irfft(z, n=self.n, axis=0, norm="ortho")

    def pooled(self, squares: np.ndarray) -> np.ndarray:
        """(n, n_y) the mean of `squares` (n, n_y) over each block."""
        count = np.bincount(self.block)
        mean = np.stack([np.bincount(self.block, column) / count for column in squares.T], axis=1)
        return mean[self.block]

    def repeated(self, errors: np.ndarray, stated: np.ndarray, measured: np.ndarray) -> Repeated:
        """Of errors (m, n, n_y) of m repetitions, up to the highest frequency that the `measured` share (n_y,) of the samples can hold:
        above it the straight lines between them make images of what is below. With one repetition alone s is the `stated` noise (n_y,),
        where that is NaN the scatter of the upper half of these frequencies, where a repeated motion has next to nothing."""
        held = self.share[:, None] <= measured
        c = self.coefficients(errors, axis=1) * held
        m, mean = len(c), c.mean(axis=0)
        if m > 1:
            return Repeated(mean, np.sqrt(self.pooled(((c - mean) ** 2).sum(axis=0) / (m - 1)) / m), m)
        upper = (self.share[:, None] > 0.5 * measured) & held
        scattered = np.nanmedian(np.where(upper, np.abs(mean), np.nan), axis=0) / NORMAL_MAD
        sd = np.where(np.isfinite(stated), stated / np.sqrt(measured), scattered)
        return Repeated(mean, sd * held, 1)

    def threshold(self, freedom: float) -> np.ndarray:
        """(n,) lambda of each coefficient's block, for a standard error with `freedom` degrees of freedom a coefficient."""
        count = np.bincount(self.block)
        passes = chi2.sf(LAMBDA * count, count)
        return (f_ratio.isf(passes, count, freedom * count) if np.isfinite(freedom) else np.full(len(count), LAMBDA))[
            self.block
        ]

    def shrinkage(self, coefficients: np.ndarray, se: np.ndarray, freedom: float) -> np.ndarray:
        """(n, n_y) the factor of each coefficient, from 0 where a block is noise to 1."""
        energy, noise = self.pooled(coefficients**2), self.pooled(se**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = 1 - self.threshold(freedom)[:, None] * noise / energy
        return np.where(energy > 0, np.clip(factor, 0.0, 1.0), 0.0)

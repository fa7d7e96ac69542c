"""The class of a nonlinearity from a periodic drive, without any model.

A linear system answers at the lines it is excited at; an even nonlinearity at even harmonics of the period, an odd one
at odd ones; the noise is what differs from period to period. R. Pintelon, J. Schoukens, System Identification: A
Frequency Domain Approach, 2nd ed. (2012), chapter 4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from ctrlgen.core.units import difference
from ctrlgen.diagnosis.estimation.noise import drive_period
from ctrlgen.diagnosis.settings import SPECTRAL_LINES
from ctrlgen.recordings.recording import Record


@dataclass(frozen=True)
class SpectralLines:
    """Root mean square per kind of line, in `unit`: at excited lines, at odd and even ones that are not excited, and
    of the noise in as many lines; None where there is no such line."""

    record: str
    channel: str
    unit: str
    periods: int
    excited: float
    odd: float | None
    even: float | None
    noise: float
    p_odd: float | None
    p_even: float | None
    statement: str


def spectral_lines(record: Record, i: int, channel: str, unit: str) -> SpectralLines | None:
    """The lines of reading `i`; None where the drive does not repeat three times or readings are missing."""
    P = drive_period(record.drive)
    if P is None or len(record.time) < 3 * P:
        return None
    whole = len(record.time) // P
    if not record.valid[P : whole * P, i].all():
        return None
    drive = np.abs(np.fft.rfft(record.drive[:P], axis=0))[1:] / P
    spectra = np.fft.rfft(record.observed[P : whole * P, i].reshape(-1, P), axis=1)[:, 1:] / P  # the first settles
    m = len(spectra)
    if m < 2:
        return None
    harmonics = np.arange(1, drive.shape[0] + 1)
    largest = drive.max(axis=0, initial=0.0)
    excited = np.any(drive > SPECTRAL_LINES.excited * np.where(largest > 0, largest, np.inf), axis=1)
    if not excited.any():
        return None
    mean = spectra.mean(axis=0)
    noise = np.sum(np.abs(spectra - mean) ** 2, axis=0) / (m - 1) / m  # variance of the mean, per line
    near = harmonics <= SPECTRAL_LINES.highest * harmonics[excited].max()
    kinds = {"odd": harmonics % 2 == 1, "even": harmonics % 2 == 0}
    levels, p = {}, {}
    for kind, mask in kinds.items():
        chosen = mask & near & ~excited
        levels[kind] = None if not chosen.any() else _rms(np.abs(mean[chosen]) ** 2, unit)
        p[kind] = None if not chosen.any() else _p(mean[chosen], noise[chosen], m)
    both = bool(np.any(excited & kinds["odd"]) and np.any(excited & kinds["even"]))
    return SpectralLines(
        record.name, channel, unit, m, _rms(np.abs(mean[excited]) ** 2, unit), levels["odd"], levels["even"],
        _rms(noise[near], unit), p["odd"], p["even"], _statement(p, both),
    )  # fmt: skip


def _rms(squares: np.ndarray, unit: str) -> float:
    """Of the time signal that these lines make up: sum of 2|Y_k|^2."""
    return float(difference(np.sqrt(2 * np.sum(squares)), unit))


def _p(mean: np.ndarray, noise: np.ndarray, m: int) -> float:
    """Chance that lines of noise alone are this high: F test of squares of the mean over their variance."""
    f = float(np.sum(np.abs(mean) ** 2) / max(np.sum(noise), 1e-300))
    return float(stats.f.sf(f, 2 * len(mean), 2 * len(mean) * (m - 1)))


def _statement(p: dict[str, float | None], both: bool) -> str:
    odd, even = (
        (p[kind] or 0.0) < SPECTRAL_LINES.answer_p if p[kind] is not None else False for kind in ("odd", "even")
    )
    if not odd and not even:
        return "answers only where it is driven: what is missing is linear and fixed in time, or below the noise"
    if both:
        return "a nonlinearity: odd or even cannot be told, for the drive holds lines of both kinds"
    if odd and even:
        return "a nonlinearity with an odd part (cubic, friction, hysteresis) and an even one (bias, square, one-sided)"
    return (
        "an odd nonlinearity (cubic, friction, hysteresis, saturation)"
        if odd
        else "an even nonlinearity (bias, square, one-sided stop)"
    )

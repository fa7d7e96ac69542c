"""Odd and even nonlinearity from the response to a periodic drive, without a model.

A linear system responds at the excited lines only; an even nonlinearity also at even harmonics of the period, an odd one
at odd harmonics. The noise is estimated from the variation between periods.

Source: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed. (2012), chapter 4.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field
from scipy import stats

from ctrlgen.core.units import difference
from ctrlgen.diagnosis.settings import SPECTRAL_LINES
from ctrlgen.estimation.quiet_stretches import drive_period
from ctrlgen.recordings.recording import Record
from ctrlgen.reporting.result_file import FiniteOrNull, Keys, Number


class SpectralLinesEntry(Keys):
    """Response of one reading to a periodic drive, by kind of spectral line, root mean square in unit."""

    record: str = Field(description="Name of the record.")
    channel: str = Field(description="The reading.")
    unit: str = Field(description="Unit of the four levels.")
    periods: int = Field(description="Periods averaged.")
    excited: FiniteOrNull = Field(description="At the lines of the drive.")
    odd: Number = Field(description="At odd harmonics that are not driven; null without any.")
    even: Number = Field(description="At even harmonics that are not driven; null without any.")
    noise: FiniteOrNull = Field(description="Noise in as many lines.")
    p_odd: Number = Field(description="p-value of the odd lines under noise alone.")
    p_even: Number = Field(description="p-value of the even lines under noise alone.")
    statement: str = Field(description="What follows.")


def spectral_lines(record: Record, i: int, channel: str, unit: str) -> SpectralLinesEntry | None:
    """Spectral lines of reading `i`; None where the drive has fewer than three periods or readings are missing."""
    P = drive_period(record.drive)
    if P is None or len(record.time) < 3 * P:
        return None
    whole = len(record.time) // P
    if not record.valid[P : whole * P, i].all():
        return None
    drive = np.abs(np.fft.rfft(record.drive[:P], axis=0))[1:] / P
    # without the first period, in which the device settles
    spectra = np.fft.rfft(record.observed[P : whole * P, i].reshape(-1, P), axis=1)[:, 1:] / P
    m = len(spectra)
    if m < 2:
        return None
    harmonics = np.arange(1, drive.shape[0] + 1)
    largest = drive.max(axis=0, initial=0.0)
    excited = np.any(drive > SPECTRAL_LINES.excited * np.where(largest > 0, largest, np.inf), axis=1)
    if not excited.any():
        return None
    mean = spectra.mean(axis=0)
    # variance of the mean over periods, by line
    noise = np.sum(np.abs(spectra - mean) ** 2, axis=0) / (m - 1) / m
    near = harmonics <= SPECTRAL_LINES.highest * harmonics[excited].max()
    kinds = {"odd": harmonics % 2 == 1, "even": harmonics % 2 == 0}
    levels, p = {}, {}
    for kind, mask in kinds.items():
        chosen = mask & near & ~excited
        levels[kind] = None if not chosen.any() else _rms(np.abs(mean[chosen]) ** 2, unit)
        p[kind] = None if not chosen.any() else _p(mean[chosen], noise[chosen], m)
    both = bool(np.any(excited & kinds["odd"]) and np.any(excited & kinds["even"]))
    return SpectralLinesEntry(
        record=record.name,
        channel=channel,
        unit=unit,
        periods=m,
        excited=_rms(np.abs(mean[excited]) ** 2, unit),
        odd=levels["odd"],
        even=levels["even"],
        noise=_rms(noise[near], unit),
        p_odd=p["odd"],
        p_even=p["even"],
        statement=_statement(p, both),
    )


def _rms(squares: np.ndarray, unit: str) -> float:
    """Root mean square of the signal with these lines, from |Y_k|^2 [unit]."""
    return float(difference(np.sqrt(2 * np.sum(squares)), unit))


def _p(mean: np.ndarray, noise: np.ndarray, m: int) -> float:
    """p-value of lines as large as these under noise alone: F test of the mean's squares against their variance."""
    f = float(np.sum(np.abs(mean) ** 2) / max(np.sum(noise), 1e-300))
    return float(stats.f.sf(f, 2 * len(mean), 2 * len(mean) * (m - 1)))


def _statement(p: dict[str, float | None], both: bool) -> str:
    odd, even = (
        (p[kind] or 0.0) < SPECTRAL_LINES.answer_p if p[kind] is not None else False for kind in ("odd", "even")
    )
    if not odd and not even:
        return (
            "response at the excited lines only: what the model lacks is linear and time-invariant, or below the noise"
        )
    if both:
        return "a nonlinearity; whether odd or even cannot be told, because the drive has lines of both kinds"
    if odd and even:
        return "a nonlinearity with an odd part (cubic, friction, hysteresis) and an even part (bias, square, one-sided stop)"
    return (
        "an odd nonlinearity (cubic, friction, hysteresis, saturation)"
        if odd
        else "an even nonlinearity (bias, square, one-sided stop)"
    )

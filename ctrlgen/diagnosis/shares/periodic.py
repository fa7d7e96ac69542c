"""Columns whose period is found in the residual itself: a pitch along the way, a line in time.

The period of each fold is found without that fold, so that the search for the highest of many peaks gains nothing out of block.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.diagnosis.settings import SHARES
from ctrlgen.diagnosis.shares.regressors import standardised
from ctrlgen.numerics.spectral_peaks import periodogram

# of the range of travel: ten a period of the shortest pitch
BINS = 2048
# of the range: the phase is then off by at most a sixteenth of a period at either end
PADDING = 8


def strongest_pitch(x: np.ndarray, y: np.ndarray) -> float:
    """Period [unit of x] of the strongest sinusoid of x (N,) in y (N,), between the longest and the shortest pitch.

    The periodogram of y summed in bins of x.
    """
    low, width = float(x.min()), float(np.ptp(x))
    place = np.minimum((BINS * (x - low) / width).astype(int), BINS - 1)
    power = periodogram(np.bincount(place, y, BINS), padding=PADDING)
    first, last = PADDING * SHARES.longest_pitch, PADDING * SHARES.shortest_pitch
    return width * PADDING / (first + int(np.argmax(power[first : last + 1])))


def pitch_columns(x: np.ndarray, period: float) -> np.ndarray:
    """The first two harmonics (N, 4) of a period of x."""
    phase = 2 * np.pi * x / period
    return np.column_stack([np.cos(phase), np.sin(phase), np.cos(2 * phase), np.sin(2 * phase)])


def strongest_line(parts: Sequence[np.ndarray]) -> float:
    """Frequency [periods a sample] of the strongest sinusoid common to residuals (n,) a record; phases are free.

    Summed periodograms, padded to at least four times the longest record; the peak between bins by a parabola.
    """
    longest = max(map(len, parts))
    size = 4 * longest
    power = sum(np.abs(np.fft.rfft(part, n=size)) ** 2 for part in parts)
    assert isinstance(power, np.ndarray)
    first = 4 * SHARES.line_periods
    k = first + int(np.argmax(power[first:-1]))
    a, b, c = power[k - 1 : k + 2]
    bend = a - 2 * b + c
    return (k + (0.5 * (a - c) / bend if bend < 0 else 0.0)) / size


def line_columns(rows: Sequence[np.ndarray], frequency: float) -> np.ndarray:
    """cos and sin (N, 2 records) of a frequency [periods a sample] at the drawn rows, with a phase of its own in each record."""
    N = sum(map(len, rows))
    out, first = np.zeros((N, 2 * len(rows))), 0
    for k, drawn in enumerate(rows):
        phase = 2 * np.pi * frequency * drawn
        out[first : first + len(drawn), 2 * k : 2 * k + 2] = np.column_stack([np.cos(phase), np.sin(phase)])
        first += len(drawn)
    return standardised(out)

"""Preprocessing of recorded columns before validation: zero-phase low-pass, derivatives that nobody recorded, delays.

A position and what is derived from it pass the same filter, so that a linear law between them keeps its parameters.
"""

from __future__ import annotations

import numpy as np
import scipy  # its parts take a while to import, and come when they are used

from ctrlgen.recordings.schema import RecordingFile

ORDER = 4  # of the Butterworth filter, run forward and backward
ENOUGH = 4.0  # rate of the kept rows over the cut-off: at twice that the filter has 1/250 of an amplitude
HIGHEST = 0.9  # of half the rate of the kept rows: room for the filter's edge


def low_passed(values: np.ndarray, sample_time: float, cutoff: float) -> np.ndarray:
    """`values` (n,) low-passed at `cutoff` [Hz] without phase shift: 6 dB at the cut-off, 48 dB an octave beyond."""
    return scipy.signal.sosfiltfilt(scipy.signal.butter(ORDER, cutoff, fs=1 / sample_time, output="sos"), values)


def delayed(values: np.ndarray, time: np.ndarray, lag: float) -> np.ndarray:
    """`values` (n,) of `lag` [s] before each `time` (n,): linear between samples, NaN beyond the first and the last."""
    return resampled(values, time, time - lag)


def resampled(values: np.ndarray, clock: np.ndarray, time: np.ndarray) -> np.ndarray:
    """`values` (m,) of the instants `clock` (m,) [s] at each `time` (n,) [s]: linear between them, NaN beyond."""
    return np.interp(time, clock, values, left=np.nan, right=np.nan)


def derivative(values: np.ndarray, sample_time: float, order: int) -> np.ndarray:
    """The derivative of `order` 1 or 2 in time of `values` (n,) by central differences, one-sided at the ends; of order -1 the
    integral from the first one by the trapezoidal rule."""
    if order == -1:
        return scipy.integrate.cumulative_trapezoid(values, dx=sample_time, initial=0.0)
    for _ in range(order):
        values = np.gradient(values, sample_time)
    return values


def enough_rows(sample_time: float, cutoff: float) -> int:
    """Rows `sample_time` [s] apart of which one must be kept so that the rate is at least `ENOUGH` times a low-pass's `cutoff`
    [Hz]: further rows are sums of those."""
    return max(int(1 / (ENOUGH * cutoff * sample_time) * (1 + 1e-9)), 1)


def highest_cutoff(sample_time: float, keep_every: int) -> float:
    """The highest cut-off [Hz] that half the rate of the kept rows can hold."""
    return HIGHEST / (2 * sample_time * keep_every)


def notes(written: RecordingFile) -> list[str]:
    """One note that says what was done to the columns before validation; none where nothing was."""
    columns = {k: c for r in written.record for k, c in written.columns_of(r).items() if c.later}
    steps = [f"{name} taken as {c.later.text} later than its rows" for name, c in columns.items() if c.later]
    used = {k: c for r in written.record for k, c in written.columns_of(r).items() if c.sample_rate}
    steps += [f"{name} of another recorder read linearly between its samples" for name in used]
    steps += [f"derivative {d.order} of {d.of} taken as {name}" for name, d in written.derivatives.items()]
    if written.low_pass is not None:
        steps.insert(0, f"every column low-passed alike at {written.low_pass.text}, forward and backward")
    if (written.keep_every or 1) > 1:
        steps.append(f"one row in {written.keep_every} kept")
    elif written.keep_every is None and written.low_pass is not None:
        steps.append("as many rows kept as make four times that, where there are more")
    return ["Before anything else: " + "; ".join(steps) + "."] if steps else []

"""Preprocessing of recorded columns before validation: zero-phase low-pass, derivatives that nobody recorded, delays.

A position and what is derived from it pass the same filter, so that a linear law between them keeps its parameters.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy  # its parts take a while to import, and come when they are used

from ctrlgen.core.counts import number_of
from ctrlgen.core.units import Quantity
from ctrlgen.recordings import drive_across_gaps
from ctrlgen.recordings.schema import RecordingFile

ORDER = 4  # of the Butterworth filter, run forward and backward
ENOUGH = 4.0  # rate of the kept rows over the cut-off: at twice that the filter has 1/250 of an amplitude
WHOLE_SAMPLES = 0.1  # sample times: how far a gap may be off a whole number of them
QUARTER = 0.25  # of the cut-off's period
FEWEST_FILTERED = 16  # rows, by one more than the filter is led in at either end
HIGHEST = 0.9  # of half the rate of the kept rows: room for the filter's edge


def low_passed(values: np.ndarray, sample_time: float, cutoff: float) -> np.ndarray:
    """`values` (n,) low-passed at `cutoff` [Hz] without phase shift: 6 dB at the cut-off, 48 dB an octave beyond."""
    return scipy.signal.sosfiltfilt(scipy.signal.butter(ORDER, cutoff, fs=1 / sample_time, output="sos"), values)


def cannot_pass(cutoff: Quantity, highest: float, rows: int) -> str:
    """Why so many `rows` cannot pass a low-pass at a `cutoff`, of which `highest` [Hz] is the most; empty where they can."""
    if not 0 < cutoff.si <= highest:
        return f"{cutoff.text} is too high for the rows that are kept; write {highest:.4g} Hz or less"
    if rows < FEWEST_FILTERED:
        return f"takes {FEWEST_FILTERED} rows or more, and {rows} {'is' if rows == 1 else 'are'} used; leave it out, or use more rows"
    return ""


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


def rows_on_grid(time: np.ndarray) -> np.ndarray | None:
    """The row of each of `time` (n,) [s] on an even grid, where rows are missing there and every gap is a whole number of samples; None
    where nothing is missing or the rows have no such grid."""
    steps = np.diff(time)
    if not np.isfinite(steps).all() or not len(steps) or np.median(steps) <= 0:
        return None
    apart = steps / np.median(steps)
    whole = np.round(apart)
    if (
        (whole < 1).any()
        or (np.abs(apart - whole) > WHOLE_SAMPLES).any()
        or whole.max() < 2
        or whole.sum() > 2 * len(time)
    ):
        return None
    return np.concatenate([[0], np.cumsum(whole.astype(int))])


def spread(values: np.ndarray, places: np.ndarray) -> np.ndarray:
    """A column (n,) at the rows `places` (n,) of an even grid, NaN between."""
    whole = np.full(int(places[-1]) + 1, np.nan)
    whole[places] = values
    return whole


def grid_note(name: str, places: np.ndarray) -> str:
    """That rows are missing at the rows between `places` (n,), and what the filter was given there."""
    sizes = np.diff(places) - 1
    count, longest = int((sizes > 0).sum()), number_of(int(sizes.max()), "sample")
    gaps = f"a gap of {longest} is" if count == 1 else f"{count} gaps, the longest of {longest}, are"
    return (
        f"{name}: {gaps} bridged before the low-pass, "
        f"{number_of(int(sizes.sum()), 'sample')} in all: every column as smooth as around; their readings are not used."
    )


def inner_rows(moved: Sequence[np.ndarray], first: int, last: int) -> tuple[int, int]:
    """The rows from `first` to one before `last` without those at either end at which one of the columns that were `moved` in
    time has no number: where each (n,) is False."""
    for known in moved:
        rows = first + np.flatnonzero(known[first:last])
        first, last = (int(rows[0]), int(rows[-1]) + 1) if len(rows) else (first, last)
    return first, last


def bridged(values: np.ndarray, longest: int) -> np.ndarray:
    """A column (n,) with its gaps of at most `longest` rows bridged as smoothly as it is around, for a filter that would smear them."""
    known = np.isfinite(values)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], known, [True]]).astype(int))).reshape(-1, 2)
    filled = values.copy()
    for a, b in edges.tolist():
        if a > 0 and b < len(values) and b - a <= longest:
            filled[a:b] = drive_across_gaps.across(values, a, b, "smooth")
    return filled


def longest_gap(sample_time: float, cutoff: float) -> int:
    """Rows `sample_time` [s] apart that may be missing before a low-pass at `cutoff` [Hz]: a quarter of its period, within which a
    column does what the filter takes away."""
    return int(QUARTER / (cutoff * sample_time))


def enough_rows(sample_time: float, cutoff: float) -> int:
    """Rows `sample_time` [s] apart of which one must be kept so that the rate is at least `ENOUGH` times a low-pass's `cutoff`
    [Hz]: further rows are sums of those."""
    return max(int(1 / (ENOUGH * cutoff * sample_time) * (1 + 1e-9)), 1)


def lowest_cutoff(sample_time: float, keep_every: int) -> float:
    """The lowest cut-off [Hz] after which no fewer than one row in `keep_every` is kept."""
    return 1 / (ENOUGH * sample_time * keep_every)


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

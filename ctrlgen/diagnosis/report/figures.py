"""All plots of a diagnosis as SVG; those of the held-out residual, over time or poses and by frequency, are drawn here."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import freqz, welch

from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.narrative import short
from ctrlgen.diagnosis.report.plot_readings import draw_readings
from ctrlgen.diagnosis.report.plot_shares import draw_shares
from ctrlgen.diagnosis.report.plot_uncertainty import draw_confusability, draw_intervals, draw_profiles, draw_rivals
from ctrlgen.diagnosis.report.residuals import AFTER, BEFORE, NOISE, WIDTH, Residuals
from ctrlgen.reporting.line_patterns import DASHED, DOTTED, SOLID, dashes, mark
from ctrlgen.reporting.plots import STYLE, legend_above, svg

# columns of a long curve; of each the smallest and the largest sample are drawn
POINTS = 700
# samples of a window of the spectrum
SEGMENT = 2048
# bands a decade
BANDS = 20


def draw_all(diagnosis: Diagnosis, residuals: Residuals) -> dict[str, str]:
    """SVG text by name of every plot for which this diagnosis has data."""
    force = diagnosis.unmodelled_force
    with plt.rc_context(STYLE):
        figures: dict[str, Figure | None] = {
            "readings": draw_readings(residuals),
            "residuals": draw_residuals(residuals),
            "spectrum": draw_spectrum(residuals),
            "shares_before": _shares(diagnosis, after=False),
            "shares_after": _shares(diagnosis, after=True),
            **diagnosis.residual_location.figures(),
            **({} if force is None else force.figures()),
            "rivals": draw_rivals(diagnosis),
            "confusability": draw_confusability(diagnosis),
            "intervals": draw_intervals(diagnosis),
            "profiles": draw_profiles(diagnosis),
        }
        return {name: svg(figure) for name, figure in figures.items() if figure is not None}


def _shares(diagnosis: Diagnosis, after: bool) -> Figure | None:
    """The model-free shares of one residual; None where there are none, and after no correction."""
    if diagnosis.shares is None or (after and not diagnosis.search.chosen.causes):
        return None
    units = dict(zip(diagnosis.recording.channels, diagnosis.recording.units, strict=True))
    return draw_shares(diagnosis.shares.after if after else diagnosis.shares.before, units)


def draw_residuals(residuals: Residuals) -> Figure:
    """The figure of the residual, a row a channel: before and after the correction and, on its own scale with the noise, after
    alone; one panel where nothing was corrected."""
    channels, wide = residuals.recording.channels, 1 + residuals.changed
    size = (WIDTH, 0.9 + 1.55 * len(channels))
    figure, axes = plt.subplots(len(channels), wide, figsize=size, sharex=True, squeeze=False)
    for i, (channel, unit) in enumerate(zip(channels, residuals.recording.units, strict=True)):
        if residuals.changed:
            _curve(axes[i, 0], residuals, residuals.before, i, "before")
        for panel in axes[i]:
            _curve(panel, residuals, residuals.after, i, "after")
        axes[i, 0].set_ylabel(f"{short(channel)} [{unit}]")
        floor = residuals.floor(i)
        if floor is not None:
            axes[i, -1].axhspan(-2 * floor, 2 * floor, color=NOISE, zorder=0)
    known = all(residuals.floor(i) is not None for i in range(len(channels)))
    title = "after, on its own scale" if residuals.changed else "residual"
    axes[0, -1].set_title(title + (" (grey: noise, ± 2 sd)" if known else ""), fontsize=9)
    for panel in axes[-1]:
        panel.set_xlabel("held-out pose" if residuals.settled else "time in the held-out records [s]")
    if residuals.changed:
        axes[0, 0].set_title("before and after", fontsize=9)
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2, fontsize=8)
    return figure


def _curve(panel: Axes, residuals: Residuals, parts: list[np.ndarray], i: int, label: str) -> None:
    """One channel over all held-out records, with a line between records."""
    colour, line = LINES[label]
    style: dict[str, Any] = {"lw": 0.9, "ls": dashes(line)}
    if residuals.settled:
        style = {"ls": "", "marker": mark(line), "ms": 3}
    for k, x in residuals.spans():
        panel.plot(*thinned(x, parts[k][:, i]), color=colour, label=label if k == 0 else None, **style)
        if k > 0:
            panel.axvline(x[0], color="#999999", lw=0.7, ls=":")


def thinned(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A long curve reduced to the smallest and largest sample of each of `POINTS` columns."""
    if len(x) <= 2 * POINTS:
        return x, y
    pieces = np.array_split(np.arange(len(x)), POINTS)
    places = []
    for piece in pieces:
        seen = piece[np.isfinite(y[piece])]
        ends = {int(seen[np.argmin(y[seen])]), int(seen[np.argmax(y[seen])])} if len(seen) else {int(piece[0])}
        places += sorted(ends)
    return x[places], y[places]


Densities = tuple[tuple[str, np.ndarray], ...]


def spectra(residuals: Residuals) -> list[tuple[int, np.ndarray, Densities]]:
    """(channel, frequencies [Hz], (label, density)) of the residual before and after and of the noise; nothing of poses and short
    records."""
    records = [k for k, part in enumerate(residuals.before) if min(len(_judged(y)) for y in part.T) >= 64]
    if residuals.settled or not records:
        return []
    sides = ((residuals.before, "before"), (residuals.after, "after" if residuals.changed else "residual"))
    found = []
    for i in range(len(residuals.recording.channels)):
        curves = []
        for parts, label in sides[not residuals.changed :]:
            f, density = residual_density(residuals, parts, records, i)
            curves.append((label, density))
        if (noise := _noise_density(residuals, i, f)) is not None:
            curves.append(("noise", noise))
        found.append((i, f, tuple(curves)))
    return found


LINES = {
    "before": (BEFORE, DASHED),
    "after": (AFTER, SOLID),
    "residual": (AFTER, SOLID),
    "noise": ("#777777", DOTTED),
}


def draw_spectrum(residuals: Residuals) -> Figure | None:
    """Amplitude spectral density of the residual before and after, and of the noise; None for poses and short records."""
    found = spectra(residuals)
    if not found:
        return None
    columns = min(len(found), 2)
    rows = -(-len(found) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(WIDTH, 0.8 + 2.3 * rows), squeeze=False)
    for panel, (i, f, curves) in zip(axes.flat, found, strict=False):
        for label, density in curves:
            colour, line = LINES[label]
            panel.loglog(f, density, color=colour, ls=dashes(line), lw=1.1, label=label)
        panel.set_ylabel(f"{short(residuals.recording.channels[i])} [{residuals.recording.units[i]}/√Hz]")
        panel.set_xlabel("frequency [Hz]")
        lowest = np.concatenate([density for label, density in curves if label != "before"])
        panel.set_ylim(bottom=0.4 * np.min(lowest[lowest > 0], initial=np.inf))
        legend_above(panel)
    for panel in axes.flat[len(found) :]:
        panel.set_visible(False)
    return figure


def _judged(values: np.ndarray) -> np.ndarray:
    """The samples from the first to the last usable one: without the lead-in."""
    seen = np.flatnonzero(np.isfinite(values))
    return values[seen[0] : seen[-1] + 1] if len(seen) else values[:0]


def residual_density(
    residuals: Residuals, parts: list[np.ndarray], records: list[int], i: int
) -> tuple[np.ndarray, np.ndarray]:
    """Welch's amplitude spectral density over the held-out records that have the longest one's sample time; marked samples
    count as zero."""
    longest = max(records, key=lambda k: len(residuals.records[k].time))
    h = residuals.records[longest].sample_time
    alike = [k for k in records if residuals.records[k].sample_time == h]
    stretches = [_judged(parts[k][:, i]) for k in alike]
    size = min(SEGMENT, *map(len, stretches))
    total, weight = np.zeros(size // 2 + 1), 0
    for values in map(np.nan_to_num, stretches):
        f, power = welch(values, 1 / h, nperseg=size, detrend=False)
        total, weight = total + len(values) * power, weight + len(values)
    edges = np.geomspace(f[1], f[-1], max(2, int(BANDS * np.log10(f[-1] / f[1]))))
    band = np.searchsorted(edges, f[1:], side="right")
    count = np.bincount(band)
    middle, mean = (np.bincount(band, v[1:])[count > 0] / count[count > 0] for v in (f, total / weight))
    return middle, np.sqrt(mean)


def _noise_density(residuals: Residuals, i: int, f: np.ndarray) -> np.ndarray | None:
    noise = residuals.diagnosis.fitter.noise
    if not noise.known[i]:
        return None
    h = max(residuals.records, key=lambda r: len(r.time)).sample_time
    _, response = freqz([1.0], np.concatenate([[1.0], -noise.ar[i]]), worN=2 * np.pi * f * h)
    return np.abs(response) * noise.sd[i] * residuals.scales[i] * np.sqrt(2 * h)

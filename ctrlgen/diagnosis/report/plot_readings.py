"""Measured against simulated, on held-out records: the stretches where the device as described and the corrected one are worst."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpecFromSubplotSpec

from ctrlgen.diagnosis.report.narrative import short
from ctrlgen.diagnosis.report.residuals import AFTER, BEFORE, NOISE, WIDTH, Residuals
from ctrlgen.reporting.line_patterns import DASHED, SOLID, dashes, mark

MEASURED = "#222222"
# of a stretch: enough to see a turn with what is before and after it
SAMPLES, POSES = 200, 12
# readings drawn, those whose error is largest beside their noise: more do not fit on a page
READINGS = 3


def draw_readings(residuals: Residuals) -> Figure:
    """Per reading two stretches, each with what was measured, what both devices say, and the error below.

    On the left the device as described errs most, on the right the corrected one does, whose scale the error has there; nothing
    corrected: one stretch.
    """
    sides = ["before", "after"] if residuals.changed else ["before"]
    drawn = worst_readings(residuals)
    figure = plt.figure(figsize=(WIDTH, 0.7 + 2.7 * len(drawn)))
    rows = figure.add_gridspec(len(drawn), len(sides))
    for row, i in enumerate(drawn):
        for column, side in enumerate(sides):
            record, stretch = worst_stretch(residuals, getattr(residuals, side), i)
            part: GridSpecFromSubplotSpec = rows[row, column].subgridspec(2, 1, height_ratios=(2, 1))
            upper = figure.add_subplot(part[0])
            lower = figure.add_subplot(part[1], sharex=upper)
            _stretch(upper, lower, residuals, i, record, stretch)
            shown = np.nan_to_num(getattr(residuals, side)[record][stretch, i])
            most = 1.2 * max(np.max(np.abs(shown)), 3 * (residuals.floor(i) or 0.0))
            if most > 0:
                lower.set_ylim(-most, most)
            if row == 0:
                upper.set_title(_where(residuals, side), fontsize=9)
            if row == len(drawn) - 1:
                lower.set_xlabel("pose" if residuals.settled else "time [s]")
    figure.legend(
        *figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2 + residuals.changed, fontsize=8
    )
    return figure


def worst_readings(residuals: Residuals) -> list[int]:
    """The readings to draw, in their order: those whose error before is largest over their noise, or over their own range."""
    ratio = []
    for i in range(len(residuals.recording.channels)):
        values = np.concatenate([part[:, i] for part in residuals.before])
        seen = np.concatenate([r.observed[:, i] for r in residuals.records])[np.isfinite(values)] * residuals.scales[i]
        unit = residuals.floor(i) or (np.ptp(seen) if len(seen) else 0.0) or 1.0
        ratio.append(np.sqrt(np.nanmean(values**2)) / unit if len(seen) else 0.0)
    return sorted(np.argsort(ratio)[::-1][:READINGS].tolist())


def worst_stretch(residuals: Residuals, parts: list[np.ndarray], i: int) -> tuple[int, slice]:
    """(record, samples) where the mean square of channel i is largest."""
    best, found = -1.0, (0, slice(0, 1))
    for k, part in enumerate(parts):
        n = min(POSES if residuals.settled else SAMPLES, len(part))
        squares = np.concatenate([[0.0], np.cumsum(np.nan_to_num(part[:, i]) ** 2)])
        sums = squares[n:] - squares[:-n]
        first = int(np.argmax(sums))
        if sums[first] / n > best:
            best, found = sums[first] / n, (k, slice(first, first + n))
    return found


def _where(residuals: Residuals, side: str) -> str:
    if not residuals.changed:
        return "where the error is largest"
    return f"where the error {side} the correction is largest"


def _stretch(upper: Axes, lower: Axes, residuals: Residuals, i: int, k: int, stretch: slice) -> None:
    record = residuals.records[k]
    x = np.arange(len(record.time)) if residuals.settled else record.time - record.time[0]
    x, observed = x[stretch], np.where(record.valid[:, i], record.observed[:, i], np.nan)[stretch]
    measured = residuals.in_units(i, observed)
    upper.plot(x, measured, color=MEASURED, ls="", marker=".", ms=3, label="measured")
    curves = [(residuals.before, BEFORE, DASHED, "as described"), (residuals.after, AFTER, SOLID, "corrected")]
    for parts, colour, line, label in curves[: 1 + residuals.changed]:
        error = parts[k][stretch, i]
        style: dict[str, Any] = {"ls": dashes(line), "lw": 1.1}
        if residuals.settled:
            style = {"ls": "", "marker": mark(line), "ms": 4, "mfc": "none"}
        upper.plot(x, measured - error, color=colour, label=label, **style)
        lower.plot(x, error, color=colour, **{**style, "lw": 0.9})
    unit = residuals.recording.units[i]
    upper.set_ylabel(f"{short(residuals.recording.channels[i])} [{unit}]")
    upper.tick_params(labelbottom=False)
    lower.set_ylabel(f"error [{unit}]", fontsize=8)
    floor = residuals.floor(i)
    if floor is not None:
        lower.axhspan(-2 * floor, 2 * floor, color=NOISE, zorder=0)

"""Data of the figures of a diagnosis that zoom and show their values: measured against simulated with the residual, its spectrum."""

from __future__ import annotations

from typing import Any

import numpy as np

from ctrlgen.diagnosis.report.figures import spectra
from ctrlgen.diagnosis.report.narrative import short
from ctrlgen.diagnosis.report.plot_readings import worst_readings
from ctrlgen.diagnosis.report.residuals import Residuals
from ctrlgen.reporting.chart import Chart, Curve, Panel
from ctrlgen.reporting.line_patterns import DASHED, DOTTED, SOLID

# places in the palette of a page: measured, as described, corrected, noise
MEASURED, DESCRIBED, CORRECTED, NOISE = 6, 1, 0, 6
# pixels of the panels of a reading and of its error
READING, ERROR = 190, 130


def diagnosis_charts(residuals: Residuals) -> dict[str, Chart]:
    """The charts by the names of the figures that they bring to life."""
    charts = {"readings": reading_chart(residuals)}
    if (spectrum := _spectrum(residuals)) is not None:
        charts["spectrum"] = spectrum
    return charts


def reading_chart(residuals: Residuals) -> Chart:
    """The held-out records one after another, whole: of each drawn reading what was measured, what both devices say, and the error."""
    x = _joined(residuals, [place for _, place in residuals.spans()])
    panels: list[Panel] = []
    for i in worst_readings(residuals):
        told = [residuals.in_units(i, np.where(r.valid[:, i], r.observed[:, i], np.nan)) for r in residuals.records]
        unit, name = residuals.recording.units[i], short(residuals.recording.channels[i])
        measured = _joined(residuals, told, np.nan)
        sides = [
            ("as described", residuals.before, DESCRIBED, DASHED),
            ("corrected", residuals.after, CORRECTED, SOLID),
        ]
        settled = residuals.settled
        curves, errors = [Curve("measured", measured, MEASURED, DOTTED, 1.6, points=settled)], []
        for label, parts, colour, line in sides[: 1 + residuals.changed]:
            error = _joined(residuals, [part[:, i] for part in parts], np.nan)
            curves.append(Curve(label, measured - error, colour, line, points=settled))
            errors.append(Curve(f"error {label}", error, colour, line, points=settled))
        floor = residuals.floor(i)
        band = None if floor is None else (-2 * floor, 2 * floor)
        panels.append(Panel(f"{name} [{unit}]", x, tuple(curves), height=READING))
        panels.append(Panel(f"error [{unit}]", x, tuple(errors), band=band, height=ERROR))
    label = "held-out pose" if residuals.settled else "time in the held-out records [s]"
    return Chart(label, tuple(panels))


def _joined(residuals: Residuals, parts: list[np.ndarray], between: float | None = None) -> np.ndarray:
    """All records in one row; between two a place of its own, so that no line joins them: there stands `between`, or half a step."""
    row: list[Any] = []
    for k, part in enumerate(parts):
        step = 1.0 if residuals.settled else residuals.records[k].sample_time
        row += [part, [part[-1] + step / 2 if between is None else between]] if k < len(parts) - 1 else [part]
    return np.concatenate(row)


def _spectrum(residuals: Residuals) -> Chart | None:
    found = spectra(residuals)
    panels = []
    for i, f, curves in found:
        unit, name = residuals.recording.units[i], short(residuals.recording.channels[i])
        palette = {
            "before": (DESCRIBED, DASHED),
            "after": (CORRECTED, SOLID),
            "residual": (CORRECTED, SOLID),
            "noise": (NOISE, DOTTED),
        }
        shown = tuple(Curve(label, density, *palette[label]) for label, density in curves)
        panels.append(Panel(f"{name} [{unit}/√Hz]", f, shown, log=True))
    return Chart("frequency [Hz]", tuple(panels), log_x=True) if panels else None

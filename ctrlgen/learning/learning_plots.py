"""Figures of learning from runs: the error of each run, along the path too, and the drives now and next."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ctrlgen.core.units import difference, from_si
from ctrlgen.learning.learn import Learning
from ctrlgen.reporting.chart import Chart, Curve, Panel
from ctrlgen.reporting.line_patterns import dashes
from ctrlgen.reporting.plots import COLOURS, STYLE, legend_over, plt, svg
from ctrlgen.trajectory.solution_charts import abscissa

FAINTEST = 0.35  # of a colour: the oldest run in a figure
SHOWN_RUNS = 5  # along the path, the last ones


def draw_learning(learning: Learning) -> dict[str, str]:
    """Error per run, error along the path per run, drives now and next: name -> SVG text."""
    with plt.rc_context(STYLE):
        return {
            "runs": svg(draw_runs(learning)),
            "along": svg(draw_along(learning)),
            "drives": svg(draw_drives(learning)),
        }


def draw_runs(learning: Learning) -> Figure:
    """A panel a group: the repeating error of each run with its 95 % interval, what was predicted, and the noise."""
    figure, panels = plt.subplots(1, len(learning.groups), figsize=(8.2, 3.2), squeeze=False)
    k = np.arange(1, len(learning.runs) + 1)
    last = len(learning.runs)
    for axes, g in zip(panels[0], learning.groups, strict=True):
        parts = ("repeating", "least", "most", "noise")
        reached, least, most, noise = (
            np.array([g.shown(getattr(run, part)[g.name]) for run in learning.runs]) for part in parts
        )
        told = least > 0
        reach = [(reached - least)[told], (most - reached)[told]]
        axes.errorbar(k[told], reached[told], reach, fmt="o", color=COLOURS[0], capsize=3, label="reached")
        if (~told).any():
            axes.plot(k[~told], most[~told], "v", color=COLOURS[0], mfc="none", label="reached, upper end of 95 %")
        predicted = [(i, run.predicted) for i, run in enumerate(learning.runs, 1) if run.predicted]
        if not learning.stop:
            predicted.append((last + 1, learning.predicted))
        if predicted:
            at, values = zip(*((i, g.shown(p[g.name])) for i, p in predicted), strict=True)
            axes.plot(at, values, "_", ms=16, mew=2, color=COLOURS[2], label="predicted")
        if noise.any():
            axes.plot(k, noise, ":", marker=".", color="#888888", label="standard error of the mean")
        axes.set_yscale("log")
        axes.set_xticks(np.arange(1, last + (1 if learning.stop else 2)))
        axes.set_xlim(0.5, last + (0.5 if learning.stop else 1.5))
        axes.set_xlabel("run")
        axes.set_ylabel(f"error, {g.name}, rms [{g.unit}]")
    legend_over(figure, panels[0, 0])
    return figure


def draw_along(learning: Learning) -> Figure:
    """A panel a group: the length of the mean error of each run along the path, and that predicted for the next one."""
    figure, panels = plt.subplots(
        len(learning.groups), 1, figsize=(8.2, 2.4 * len(learning.groups)), squeeze=False, sharex=True
    )
    solution = learning.solution
    static = solution.scenario.sample_time is None
    at = np.arange(len(solution.command)) if static else solution.trace.time
    first = max(0, len(learning.runs) - SHOWN_RUNS)
    shown = list(enumerate(learning.runs, 1))[first:]
    for axes, g in zip(panels[:, 0], learning.groups, strict=True):
        for (k, run), colour in zip(shown, _shades(len(shown)), strict=True):
            length = np.linalg.norm(run.error[:, g.channels], axis=1)
            style = dashes(shown[-1][0] - k)
            axes.plot(at, difference(length, g.unit), color=colour, ls=style, lw=1, label=f"run {k}")
        if not learning.stop:
            length = np.linalg.norm(learning.predicted_error[:, g.channels], axis=1)
            label = "predicted for the next, without noise"
            axes.plot(at, difference(length, g.unit), color=COLOURS[2], ls=dashes(len(shown)), lw=1.6, label=label)
        axes.set_yscale("log")
        axes.set_ylabel(f"|error|, {g.name} [{g.unit}]")
    panels[-1, 0].set_xlabel("sample" if static else "time [s]")
    legend_over(figure, panels[0, 0])
    return figure


def draw_drives(learning: Learning) -> Figure:
    """Above the drives of the best run and the next ones, below their difference."""
    solution = learning.solution
    drive = solution.model.signals["drive"]
    static = solution.scenario.sample_time is None
    at = np.arange(len(solution.command)) if static else solution.trace.time
    now = learning.runs[learning.base].drive
    figure, (above, below) = plt.subplots(2, 1, figsize=(8.2, 4.6), sharex=True)
    for i, (channel, unit) in enumerate(zip(drive.channels, drive.units, strict=True)):
        colour, style = COLOURS[i % len(COLOURS)], dashes(i)
        above.plot(at, from_si(now[:, i], unit), color=colour, lw=0.8, alpha=0.5)
        above.plot(at, from_si(learning.next.drive[:, i], unit), color=colour, ls=style, lw=1.2, label=channel)
        below.plot(at, difference(learning.next.drive[:, i] - now[:, i], unit), color=colour, ls=style, lw=1)
    above.set_ylabel(f"{drive.label} [{drive.units[0]}]")
    above.set_title("thin: best run so far; full: next", fontsize=8)
    legend_over(figure, above)
    below.set_ylabel(f"next - best [{drive.units[0]}]")
    below.set_xlabel("sample" if static else "time [s]")
    return figure


def _shades(count: int) -> list[tuple[float, float, float, float]]:
    """Shades of one colour, the last one full."""
    red, green, blue = (int(COLOURS[0][i : i + 2], 16) / 255 for i in (1, 3, 5))
    return [(red, green, blue, float(a)) for a in np.linspace(FAINTEST if count > 1 else 1.0, 1.0, count)]


def learning_charts(learning: Learning) -> dict[str, Chart]:
    """What zooms: the error along the path of each run, and the drives of the best run and the next."""
    solution = learning.solution
    label, at = abscissa(solution)
    shown = list(enumerate(learning.runs, 1))[-SHOWN_RUNS:]
    along = []
    for g in learning.groups:
        rows = [(f"run {k}", run.error) for k, run in shown]
        rows += [] if learning.stop else [("predicted for the next, without noise", learning.predicted_error)]
        curves = tuple(
            Curve(name, difference(np.linalg.norm(error[:, g.channels], axis=1), g.unit), k, k)
            for k, (name, error) in enumerate(rows)
        )
        along.append(Panel(f"|error|, {g.name} [{g.unit}]", at, curves, log=True))
    drive, now = solution.model.signals["drive"], learning.runs[learning.base].drive
    named = list(enumerate(zip(drive.channels, drive.units, strict=True)))
    following = tuple(Curve(c, from_si(learning.next.drive[:, i], u), i, i, held=True) for i, (c, u) in named)
    changes = tuple(
        Curve(f"change of {c}", difference(learning.next.drive[:, i] - now[:, i], u), i, i, held=True)
        for i, (c, u) in named
    )
    unit = drive.units[0]
    drives = (Panel(f"next [{unit}]", at, following), Panel(f"next - best [{unit}]", at, changes))
    return {"along": Chart(label, tuple(along)), "drives": Chart(label, drives)}

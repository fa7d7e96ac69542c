"""The report of learning from runs: learning.json, drives.csv, figures, one self-contained learning.html."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ctrlgen.core.files import write_text
from ctrlgen.core.units import difference, from_si
from ctrlgen.learning.learn import Learning
from ctrlgen.reporting.html import render
from ctrlgen.reporting.plots import COLOURS, STYLE, plt, svg
from ctrlgen.reporting.result_file import origin

FAINTEST = 0.35  # of a colour: the oldest run in a figure
SHOWN_RUNS = 5  # along the path, the last ones


def write_learning(out: Path, learning: Learning) -> None:
    """Writes learning.json, drives.csv, figures/*.svg and learning.html into the folder `out`."""
    record = learning_record(learning)
    figures = draw_learning(learning)
    write_text(out / "learning.json", json.dumps(record, indent=1) + "\n")
    write_text(out / "drives.csv", drives_csv(learning))
    for name, text in figures.items():
        write_text(out / "figures" / f"{name}.svg", text)
    page = render(
        Path(__file__).with_name("learning.html.j2"), r=record, figures=figures, device_title=learning.solution.model.device.title,
        verdict=verdict(learning), player=learning.solution.scenario.sample_time is not None,
    )  # fmt: skip
    write_text(out / "learning.html", page)


def verdict(learning: Learning) -> str:
    """One sentence: the error of the best run and what the next one will have, or why there is none."""
    best = learning.runs[learning.base]
    now = ", ".join(f"{shown_error(learning, best, g.name)} {g.unit} {g.name}" for g in learning.groups)
    if learning.stop:
        return f"Nothing more to learn: {learning.stop}. Best run: {best.name}, {now}."
    then = ", ".join(f"{g.shown(learning.predicted[g.name]):.3g} {g.unit}" for g in learning.groups)
    return f"Best run: {best.name}, {now}. Predicted for the next run: {then}."


def shown_error(learning: Learning, run: Any, group: str) -> str:
    """The repeating error of a run in a group's unit; '< 3' where it is not told from zero."""
    g = next(g for g in learning.groups if g.name == group)
    if run.least[group] == 0.0:
        return f"< {g.shown(run.most[group]):.2g}"
    return f"{g.shown(run.repeating[group]):.3g}"


def drives_csv(learning: Learning) -> str:
    """The next drives: time (or the pose's number) and each drive with its unit, row k acting from sample k to sample k + 1."""
    solution = learning.next
    drive, static = solution.model.signals["drive"], solution.scenario.sample_time is None
    at = np.arange(len(solution.drive)) if static else solution.trace.time
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["sample" if static else "time [s]", *drive.columns])
    values = [from_si(solution.drive[:, i], unit) for i, unit in enumerate(drive.units)]
    for row in np.column_stack([at, *values]):
        writer.writerow([f"{value:.12g}" for value in row])
    return text.getvalue()


def learning_record(learning: Learning) -> dict[str, Any]:
    """What learning.json holds; nothing that changes from call to call."""
    scenario, m = learning.solution.scenario, learning.solution.model
    signal, drive = m.signals[scenario.file.follow], m.signals["drive"]
    change = np.abs(learning.next.drive - learning.runs[learning.base].drive).max(axis=0)
    names = [f"{c} [{u}]" for c, u in zip(drive.channels, drive.units, strict=True)]
    answer = learning.response
    return {
        **origin(learning.inputs, None, learning.notes),
        "scenario": scenario.name, "title": scenario.file.title, "device": m.name, "signal": scenario.file.follow,
        "not_read": [c for c, seen in zip(signal.channels, learning.observed, strict=True) if not seen],
        "groups": [{"name": g.name, "unit": g.unit, "channels": [signal.channels[i] for i in g.channels]} for g in learning.groups],
        "runs": [
            {
                "name": run.name, "repetitions": run.repeats, "best": k == learning.base,
                "errors": [
                    {
                        "group": g.name, "measured": g.shown(run.rms[g.name]), "noise": g.shown(run.noise[g.name]),
                        "repeating": g.shown(run.repeating[g.name]), "repeating_least": g.shown(run.least[g.name]),
                        "repeating_most": g.shown(run.most[g.name]),
                        "predicted": None if run.predicted is None else g.shown(run.predicted[g.name]),
                    }
                    for g in learning.groups
                ],
            }
            for k, run in enumerate(learning.runs)
        ],
        "actuators": [] if answer is None else [
            {"drive": c, "gain": _finite(g), "standard_error": _finite(s)}
            for c, g, s in zip(drive.channels, answer.gain, answer.se, strict=True)
        ],
        "unexplained": None if answer is None else answer.unexplained,
        "stop": learning.stop, "step": learning.step,
        "predicted": [{"group": g.name, "repeating": g.shown(learning.predicted[g.name])} for g in learning.groups],
        "largest_change": {
            name: float(difference(value, unit)) for name, value, unit in zip(names, change, drive.units, strict=True)
        },
        "drives": {
            name: from_si(learning.next.drive[:, i], unit).tolist() for i, (name, unit) in enumerate(zip(names, drive.units, strict=True))
        },
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


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
        reached, least, most, noise = (
            np.array([g.shown(getattr(run, part)[g.name]) for run in learning.runs]) for part in ("repeating", "least", "most", "noise")
        )  # fmt: skip
        told = least > 0
        axes.errorbar(
            k[told],
            reached[told],
            [(reached - least)[told], (most - reached)[told]],
            fmt="o",
            color=COLOURS[0],
            capsize=3,
            label="reached",
        )
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
    panels[0, 0].legend(fontsize=8)
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
            axes.plot(
                at,
                difference(np.linalg.norm(run.error[:, g.channels], axis=1), g.unit),
                color=colour,
                lw=1,
                label=f"run {k}",
            )
        if not learning.stop:
            length = np.linalg.norm(learning.predicted_error[:, g.channels], axis=1)
            axes.plot(
                at,
                difference(length, g.unit),
                color=COLOURS[2],
                lw=1.2,
                ls="--",
                label="predicted for the next, without noise",
            )
        axes.set_yscale("log")
        axes.set_ylabel(f"|error|, {g.name} [{g.unit}]")
    panels[-1, 0].set_xlabel("sample" if static else "time [s]")
    _legend_above(figure, panels[0, 0], SHOWN_RUNS + 1)
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
        colour = COLOURS[i % len(COLOURS)]
        above.plot(at, from_si(now[:, i], unit), color=colour, lw=0.8, alpha=0.5)
        above.plot(at, from_si(learning.next.drive[:, i], unit), color=colour, lw=1.2, label=channel)
        below.plot(at, difference(learning.next.drive[:, i] - now[:, i], unit), color=colour, lw=1)
    above.set_ylabel(f"{drive.label} [{drive.units[0]}]")
    above.set_title("thin: best run so far; full: next", fontsize=8)
    _legend_above(figure, above, len(drive.channels))
    below.set_ylabel(f"next - best [{drive.units[0]}]")
    below.set_xlabel("sample" if static else "time [s]")
    return figure


def _legend_above(figure: Figure, axes: Axes, columns: int) -> None:
    """Outside the panels, which curves fill from edge to edge."""
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=columns, fontsize=8)


def _shades(count: int) -> list[tuple[float, float, float, float]]:
    """Shades of one colour, the last one full."""
    red, green, blue = (int(COLOURS[0][i : i + 2], 16) / 255 for i in (1, 3, 5))
    return [(red, green, blue, float(a)) for a in np.linspace(FAINTEST if count > 1 else 1.0, 1.0, count)]

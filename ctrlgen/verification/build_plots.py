"""Figures of a build: tracking errors of its C driving the model, and the instructions per sample on each target."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import same_dimension
from ctrlgen.firmware.c.real import Real
from ctrlgen.reporting.line_patterns import dashes, mark
from ctrlgen.reporting.plots import COLOURS, STYLE, plt, svg
from ctrlgen.trajectory import playback
from ctrlgen.trajectory.inverse.clock import Settled
from ctrlgen.verification.build_record import BUDGET_CORE, BUDGETS, Build
from ctrlgen.verification.emulated_target import Target
from ctrlgen.verification.tolerances import ANGLE_LIMIT, length_limit, rounded
from ctrlgen.verification.tracking import Piece

SHOWN = {"um": "nm", "rad": "nrad"}
SCALES = {"nm": 1e9, "nrad": 1e9}
DECADES = 18  # that the logarithmic axis shows at most: down to the roundings of a double
KINDS = {"scenario": "along the scenario", "worst": "worst case", "player": "player"}


def draw_build(build: Build) -> dict[str, str]:
    """Name -> SVG text; there is no figure of what did not run."""
    with plt.rc_context(STYLE):
        figures = {f"error_{unit}": svg(draw_errors(build, unit)) for unit in SHOWN if _channels(build, unit)}
        if build.in_loop.runs:
            figures["instructions"] = svg(draw_instructions(build))
    return {name.replace("_um", "_length").replace("_rad", "_angle"): text for name, text in figures.items()}


def draw_errors(build: Build, unit: str) -> Figure:
    """|error| of every channel of the dimension of `unit` along the trajectory, one panel per piece of C and arithmetic."""
    channels, signal = _channels(build, unit), build.solution.model.signals[build.solution.scenario.file.follow]
    shown, typical = SHOWN[unit], playback.typical_length(signal)
    lengths = unit == "um"
    player = playback.length_tolerance(signal) if lengths else playback.ANGLE_TOLERANCE
    panels = [(what, real) for what, by_real in build.errors.items() for real in by_real]
    clock = build.solution.scenario.clock
    static = isinstance(clock, Settled)
    figure, axes = plt.subplots(
        1, len(panels), figsize=(2.3 * len(panels) + 0.6, 3.4), sharey=True, squeeze=False, sharex=True
    )
    for panel, (what, real) in zip(axes[0], panels, strict=True):
        largest = build.solution.trace.signals[build.solution.scenario.file.follow][:, channels]
        online = length_limit(real, typical) if lengths else ANGLE_LIMIT[real]
        limit = max(online if what is Piece.ONLINE else player, rounded(real, largest)) * SCALES[shown]
        error = np.abs(build.errors[what][real]) * SCALES[shown]
        time = np.arange(len(error)) if isinstance(clock, Settled) else clock.times(len(error))
        for k, i in enumerate(channels):
            # exactly zero has no place on this axis
            values = np.where(error[:, i] > 0, error[:, i], np.nan)
            style = {"ls": "", "marker": mark(k)} if static else {"ls": dashes(k)}
            panel.plot(time, values, ms=3, lw=0.9, color=COLOURS[2 * k % 6], label=signal.channels[i], **style)
        panel.axhline(limit, color="#222222", lw=1, ls="--")
        told, across = f"tolerance {to_digits(limit, 3)} {shown}", panel.get_yaxis_transform()
        panel.text(0.98, limit, told, ha="right", va="bottom", fontsize=7, transform=across)
        panel.set_title(f"{what}, {real.value}", fontsize=9)
        panel.set_xlabel("sample" if static else "time [s]")
        panel.set_yscale("log")
    axes[0][0].set_ylabel(f"|model - command| [{shown}]")
    _share_decades(axes[0][0], [build.errors[w][r][:, channels] * SCALES[shown] for w, r in panels])
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, ncols=len(labels), fontsize=8, loc="outside upper center")
    return figure


def _share_decades(axes: Axes, errors: list[np.ndarray]) -> None:
    """Sets the limits of the logarithmic axis: from the smallest median to above every tolerance and error."""
    medians = [float(np.median(np.abs(e)[np.abs(e) > 0])) for e in errors if np.any(e)]
    top = max(axes.get_ylim()[1], *(float(np.abs(e).max()) * 3 for e in errors))
    axes.set_ylim(max(min(medians, default=top) / 30, top / 10**DECADES), top * 2)


def draw_instructions(build: Build) -> Figure:
    """Bars of the instructions per sample on each target, beside the budgets where these are stated for such a device."""
    runs = [run for run in build.in_loop.runs if any(run.instructions[kind] for kind in KINDS)]
    kinds = [kind for kind in KINDS if any(run.instructions[kind] for run in runs)]
    figure, axes = plt.subplots(1, len(kinds), figsize=(8.6, 1.1 + 0.34 * len(runs)), sharey=True, squeeze=False)
    for panel, kind in zip(axes[0], kinds, strict=True):
        budget = BUDGETS[kind] if build.budgeted else None
        counts = {k: count for k, run in enumerate(runs) if (count := run.instructions[kind])}
        least, widest = min(counts.values()), max(*counts.values(), budget or 0)
        for k, count in counts.items():
            over = budget is not None and _budgeted(runs[k]) and count > budget
            panel.barh(k, count, color=COLOURS[2] if over else COLOURS[0], height=0.62)
            panel.text(0.93 * count, k, str(count), va="center", ha="right", fontsize=8, color="white")
        if budget is not None:
            for k, run in enumerate(runs):
                if _budgeted(run):
                    panel.plot([budget, budget], [k - 0.5, k + 0.5], color="#222222", lw=1.2, ls="--")
        panel.set_xscale("log")  # arithmetic in software takes tens of times as many
        panel.set_xlim(least / 10, 1.3 * widest)  # the shortest bar has room for its number
        goal = f"\ndashed: goal, {budget}" if budget is not None else ""
        panel.set_title(f"{KINDS[kind]}{goal}", fontsize=9)
        panel.set_xlabel("instructions a sample")
        panel.grid(axis="y", visible=False)
    axes[0][0].set_yticks(range(len(runs)), [run.short_name for run in runs], fontsize=8)
    axes[0][0].invert_yaxis()
    return figure


def _budgeted(run: Target) -> bool:
    return run.core == BUDGET_CORE and run.real is Real.FLOAT


def _channels(build: Build, unit: str) -> list[int]:
    units = build.solution.model.signals[build.solution.scenario.file.follow].units
    return [i for i, u in enumerate(units) if same_dimension(u, unit)]

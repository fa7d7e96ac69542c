"""Figures of a build: tracking errors of its C driving the model, and the instructions per sample on each target."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ctrlgen.core.units import same_dimension
from ctrlgen.reporting.plots import COLOURS, STYLE, plt, svg
from ctrlgen.trajectory import playback
from ctrlgen.trajectory.inverse.clock import Settled
from ctrlgen.verification import comparison
from ctrlgen.verification.build_record import BUDGET_CORE, BUDGETS, Build
from ctrlgen.verification.in_loop import TargetRun

SHOWN = {
    "um": ("nm", comparison.LENGTH_LIMIT, playback.LENGTH_TOLERANCE),
    "rad": ("nrad", comparison.ANGLE_LIMIT, playback.ANGLE_TOLERANCE),
}
SCALES = {"nm": 1e9, "nrad": 1e9}
DECADES = 18  # that the logarithmic axis shows at most: down to the roundings of a double
KINDS = {"scenario": "along the scenario", "worst": "worst case", "player": "player"}


def draw_all(build: Build) -> dict[str, str]:
    """Name -> SVG text; there is no figure of what did not run."""
    with plt.rc_context(STYLE):
        figures = {f"error_{unit}": svg(draw_errors(build, unit)) for unit in SHOWN if _channels(build, unit)}
        if build.in_loop.runs:
            figures["instructions"] = svg(draw_instructions(build))
    return {name.replace("_um", "_length").replace("_rad", "_angle"): text for name, text in figures.items()}


def draw_errors(build: Build, unit: str) -> Figure:
    """|error| of every channel of the dimension of `unit` along the trajectory, one panel per piece of C and arithmetic."""
    shown, online, player = SHOWN[unit]
    channels, signal = _channels(build, unit), build.solution.model.signals[build.solution.scenario.file.follow]
    panels = [(what, real) for what, by_real in build.errors.items() for real in by_real]
    clock = build.solution.scenario.clock
    static = isinstance(clock, Settled)
    figure, axes = plt.subplots(
        1, len(panels), figsize=(2.3 * len(panels) + 0.6, 3.4), sharey=True, squeeze=False, sharex=True
    )
    for panel, (what, real) in zip(axes[0], panels, strict=True):
        limit = (online[real] if what == "online C" else player) * SCALES[shown]
        error = np.abs(build.errors[what][real]) * SCALES[shown]
        time = np.arange(len(error)) if isinstance(clock, Settled) else clock.times(len(error))
        for k, i in enumerate(channels):
            values = np.where(error[:, i] > 0, error[:, i], np.nan)  # exactly zero has no place on this axis
            panel.plot(
                time, values, "o" if static else "-", ms=3, lw=0.9, color=COLOURS[2 * k % 6], label=signal.channels[i]
            )
        panel.axhline(limit, color="#222222", lw=1, ls="--")
        panel.text(0.98, limit, f"tolerance {limit:.3g} {shown}", ha="right", va="bottom", fontsize=7,
                   transform=panel.get_yaxis_transform())  # fmt: skip
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
    rows = [
        (run, kind, count)
        for run in build.in_loop.runs
        for kind, count in run.instructions.items()
        if kind in KINDS and count
    ]
    names = list(dict.fromkeys(target_name(run) for run, _, _ in rows))
    kinds = [kind for kind in KINDS if any(k == kind for _, k, _ in rows)]
    figure, axes = plt.subplots(1, len(kinds), figsize=(8.6, 1.1 + 0.34 * len(names)), sharey=True, squeeze=False)
    for panel, kind in zip(axes[0], kinds, strict=True):
        budget = BUDGETS[kind] if build.budgeted else None
        values = {target_name(run): count for run, k, count in rows if k == kind}
        widest = max(*values.values(), budget or 0)
        for k, name in enumerate(names):
            if name not in values:
                continue
            over = budget is not None and name.startswith(BUDGET_CORE) and values[name] > budget
            panel.barh(k, values[name], color=COLOURS[2] if over else COLOURS[0], height=0.62)
            panel.text(
                values[name] - 0.02 * widest, k, str(values[name]), va="center", ha="right", fontsize=8, color="white"
            )
        if budget is not None:
            meant = [k for k, name in enumerate(names) if name.startswith(f"{BUDGET_CORE} float")]
            for k in meant:
                panel.plot([budget, budget], [k - 0.5, k + 0.5], color="#222222", lw=1.2, ls="--")
        panel.set_xlim(0, 1.12 * widest)
        goal = f"\ndashed: goal, {budget}" if budget is not None else ""
        panel.set_title(f"{KINDS[kind]}{goal}", fontsize=9)
        panel.set_xlabel("instructions a sample")
        panel.grid(axis="y", visible=False)
    axes[0][0].set_yticks(range(len(names)), names, fontsize=8)
    axes[0][0].invert_yaxis()
    return figure


def target_name(run: TargetRun) -> str:
    """'Cortex-M4F float, zig'."""
    return f"{run.core} {run.real.value}, {run.compiler.split()[0]}"


def _channels(build: Build, unit: str) -> list[int]:
    units = build.solution.model.signals[build.solution.scenario.file.follow].units
    return [i for i, u in enumerate(units) if same_dimension(u, unit)]

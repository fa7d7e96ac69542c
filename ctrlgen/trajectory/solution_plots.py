"""Figures of a solution as SVG: path, forces, temperatures, drives, margins, stage force law."""

from __future__ import annotations

from collections.abc import Callable

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import from_si, show_difference
from ctrlgen.reporting.line_patterns import dashes, mark
from ctrlgen.reporting.plots import COLOURS, STYLE, legend_above, svg
from ctrlgen.trajectory.infeasibility import FEASIBILITY_TOLERANCE
from ctrlgen.trajectory.metrics import force_parts
from ctrlgen.trajectory.solution import Solution


def draw_solution(solution: Solution) -> dict[str, str]:
    """Every figure that applies to this solution: name -> SVG text."""
    drawings: dict[str, Callable[[Solution], Figure]] = {"margins": draw_margins}
    state = solution.model.signals.get("state")
    signals = {"forces": "force", f"{state.name if state else 'state'}s": "state", "drives": "drive"}
    with plt.rc_context(STYLE):
        figures = {}
        if solution.scenario.file.follow == "pose" and solution.scenario.sample_time:
            figures["path"] = svg(draw_path(solution))
        if solution.scenario.file.follow == "displacement" and "linear" in solution.model.force_parts:
            figures["stage_force"] = svg(draw_stage_force(solution))
        for name, role in signals.items():
            if role not in solution.model.signals:
                continue
            figures[name] = svg(draw_signal(solution, role))
        for name, draw in drawings.items():
            figures[name] = svg(draw(solution))
    return figures


FINER = {"um": "nm", "mm": "um", "rad": "urad", "mrad": "urad", "urad": "nrad"}


def draw_path(solution: Solution) -> Figure:
    """Commanded path and modelled samples, and the error over time: the two channels of one unit that move most, one against the
    other, or one over time where it is alone."""
    signal = solution.model.signals["pose"]
    reached, command = solution.trace.signals["pose"], solution.command
    time, closed = solution.trace.time, solution.scenario.closed
    most = int(np.argmax(np.ptp(command, axis=0) / signal.scale))
    unit = signal.units[most]
    alike = [i for i, other in enumerate(signal.units) if other == unit]
    shown = sorted(sorted(alike, key=lambda i: -np.ptp(command[:, i]))[:2])
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.2, 3.9), width_ratios=(1, 1.15))

    def drawn(values: np.ndarray, every: int = 1, close: bool = False) -> list[np.ndarray]:
        """What the left axes show of a signal."""
        columns = [from_si(values[::every, i], unit) for i in shown]
        columns = [np.append(c, c[0]) for c in columns] if close else columns
        return columns if len(columns) == 2 else [time[::every], *columns]

    alone = len(shown) == 1
    left.plot(*drawn(command, close=closed and not alone), color="#999999", lw=3, label="commanded")
    left.plot(*drawn(reached, max(1, len(command) // 40)), ".", ms=5, color=COLOURS[2], label="modelled")
    if not alone:
        left.set_aspect("equal", adjustable="datalim")
    left.set_xlabel("time [s]" if alone else f"{signal.channels[shown[0]]} [{unit}]")
    left.set_ylabel(f"{signal.channels[shown[-1]]} [{unit}]")
    legend_above(left)
    fine = FINER.get(unit, unit)
    tolerance = from_si(FEASIBILITY_TOLERANCE * signal.scale[most], fine)
    for k, (i, colour) in enumerate(zip(alike, (COLOURS[0], COLOURS[2], COLOURS[4]), strict=False)):
        off = from_si(reached[:, i] - command[:, i], fine)
        right.plot(time, off, color=colour, ls=dashes(k), lw=1, label=signal.channels[i])
    right.axhspan(
        -tolerance, tolerance, color="#f0f0f0", zorder=0, label=f"tolerance of {to_digits(tolerance, 3)} {fine}"
    )
    span = max(1.3 * tolerance, 1.1 * max(abs(limit) for limit in right.get_ylim()))
    right.set_ylim(-span, span)
    right.set_xlabel("time [s]")
    right.set_ylabel(f"modelled - commanded [{fine}]")
    legend_above(right, columns=4)
    return figure


def draw_signal(solution: Solution, role: str) -> Figure:
    """The six channels of one signal over time, or over the samples of a static scenario (S1 Fig. 14(b) shows such forces)."""
    signal = solution.model.signals[role]
    values = solution.trace.signals[role]
    static = solution.scenario.sample_time is None
    figure, axes = plt.subplots(figsize=(8.2, 3.2))
    horizontal = np.arange(len(values)) if static else solution.trace.time
    for i, channel in enumerate(signal.channels):
        axes.plot(
            horizontal,
            from_si(values[:, i], signal.units[i]),
            marker=mark(i) if static else "",
            ls="" if static else dashes(i),
            ms=4,
            lw=1.3,
            color=COLOURS[i % 6],
            label=channel,
        )
    axes.set_xlabel("sample" if static else "time [s]")
    if static:
        axes.locator_params("x", integer=True)
    axes.set_ylabel(f"{signal.label} [{signal.units[0]}]")
    axes.legend(ncols=6, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, 1.14))
    return figure


def draw_margins(solution: Solution) -> Figure:
    """The share of each limit's range that is left where the solution comes closest to it."""
    shown = [m for m in solution.margins if m.share is not None]
    figure, axes = plt.subplots(figsize=(8.2, 0.5 + 0.42 * len(shown)))
    for row, margin in enumerate(shown):
        share = 100 * max(margin.share or 0.0, 0.0)
        axes.barh(row, share, color=COLOURS[2] if margin is solution.tightest else COLOURS[0], height=0.6)
        unit = margin.limit.unit
        value, bound = from_si(margin.value, unit), from_si(margin.limit.described(margin.bound), unit)
        reserved = f" less {show_difference(margin.reserve, unit, 3)} reserved" if margin.reserve else ""
        axes.text(
            share + 1,
            row,
            f"{to_digits(share, 3)} %: {margin.channel} {to_digits(value)} {unit}, bound {to_digits(bound)} {unit}{reserved}",
            va="center",
            fontsize=8,
        )
    axes.set_yticks(range(len(shown)), [m.limit.label for m in shown])
    axes.invert_yaxis()
    axes.set_xlim(0, 150)
    axes.set_xticks(range(0, 101, 20))
    axes.set_xlabel("range left where the limit is approached most [%]")
    return figure


def draw_stage_force(solution: Solution) -> Figure:
    """Linear and total force against displacement of the axis that moves most (S1 Fig. 13)."""
    values = from_si(solution.trace.signals["displacement"], "um")
    axis = int(np.argmax(np.ptp(values, axis=0)))
    parts = force_parts(solution)
    figure, axes = plt.subplots(figsize=(6.2, 3.6))
    axes.plot(
        values[:, axis], parts["linear"][:, axis], "s--", ms=4, color=COLOURS[0], label="linear force, S1 eq. (9)"
    )
    axes.plot(
        values[:, axis],
        solution.trace.signals["force"][:, axis],
        "o-",
        ms=4,
        color=COLOURS[2],
        label="linear + nonlinear, S1 eq. (12)",
    )
    axes.set_xlabel(f"displacement {solution.model.axes[axis]} [um]")
    axes.set_ylabel("force on the actuator bar [N]")
    legend_above(axes)
    return figure

"""Figures of a solution as SVG: path, forces, temperatures, drives, margins, stage force law."""

from __future__ import annotations

import numpy as np

from ctrlgen.core.units import from_si, show_difference
from ctrlgen.reporting.colours import COLOURS
from ctrlgen.reporting.line_patterns import LINE
from ctrlgen.reporting.plain_drawing import Axes, Bar, Series, bars_svg, panels_svg
from ctrlgen.trajectory.infeasibility import FEASIBILITY_TOLERANCE
from ctrlgen.trajectory.metrics import force_parts
from ctrlgen.trajectory.solution import Solution

WIDTH = 8.2  # inches
DOTS = 40  # of the modelled path, drawn on the commanded one
FINER = {"um": "nm", "mm": "um", "rad": "urad", "mrad": "urad", "urad": "nrad"}


def draw_solution(solution: Solution) -> dict[str, str]:
    """Every figure that applies to this solution: name -> SVG text."""
    state = solution.model.signals.get("state")
    signals = {"forces": "force", f"{state.name if state else 'state'}s": "state", "drives": "drive"}
    figures = {}
    if solution.scenario.file.follow == "pose" and solution.scenario.sample_time:
        figures["path"] = draw_path(solution)
    if solution.scenario.file.follow == "displacement" and "linear" in solution.model.force_parts:
        figures["stage_force"] = draw_stage_force(solution)
    figures |= {name: draw_signal(solution, role) for name, role in signals.items() if role in solution.model.signals}
    return figures | {"margins": draw_margins(solution)}


def draw_path(solution: Solution) -> str:
    """`path_axes`, beside each other."""
    return panels_svg(path_axes(solution), (1, 1.15), WIDTH, 3.9)


def path_axes(solution: Solution) -> tuple[Axes, Axes]:
    """Commanded path and modelled samples, and the error over time: the two channels of one unit that move most, one against the
    other, or one over time where it is alone."""
    signal = solution.model.signals["pose"]
    reached, command = solution.trace.signals["pose"], solution.command
    time, closed = solution.trace.time, solution.scenario.closed
    most = int(np.argmax(np.ptp(command, axis=0) / signal.scale))
    unit = signal.units[most]
    alike = [i for i, other in enumerate(signal.units) if other == unit]
    shown = sorted(sorted(alike, key=lambda i: -np.ptp(command[:, i]))[:2])
    alone = len(shown) == 1

    def drawn(values: np.ndarray, every: int = 1, close: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Abscissa and ordinate of a signal in the left panel."""
        columns = [np.asarray(from_si(values[::every, i], unit)) for i in shown]
        columns = [np.append(c, c[0]) for c in columns] if close else columns
        return (columns[0], columns[1]) if len(columns) == 2 else (time[::every], columns[0])

    left = Axes(
        "time [s]" if alone else f"{signal.channels[shown[0]]} [{unit}]",
        f"{signal.channels[shown[-1]]} [{unit}]",
        (
            Series("commanded", *drawn(command, close=closed and not alone), "#999999", width=3.0),
            Series("modelled", *drawn(reached, max(1, len(command) // DOTS)), COLOURS[2], width=0.0, points=2.5),
        ),
        equal=not alone,
    )
    fine = FINER.get(unit, unit)
    tolerance = float(from_si(FEASIBILITY_TOLERANCE * signal.scale[most], fine))
    off = {i: np.asarray(from_si(reached[:, i] - command[:, i], fine)) for i in alike}
    errors = tuple(
        Series(signal.channels[i], time, off[i], colour, k, 1.0)
        for k, (i, colour) in enumerate(zip(alike, (COLOURS[0], COLOURS[2], COLOURS[4]), strict=False))
    )
    span = max(1.3 * tolerance, 1.15 * max(float(np.abs(s.y).max()) for s in errors))
    band = -tolerance, tolerance, f"tolerance of {tolerance:.3g} {fine}"
    label = f"modelled - commanded [{fine}]"
    return left, Axes("time [s]", label, errors, band=band, y_range=(-span, span), columns=4)


def draw_signal(solution: Solution, role: str) -> str:
    """The six channels of one signal over time, or over the samples of a static scenario (S1 Fig. 14(b) shows such forces)."""
    signal = solution.model.signals[role]
    values = solution.trace.signals[role]
    static = solution.scenario.sample_time is None
    horizontal = np.arange(float(len(values))) if static else solution.trace.time
    width, points = (0.0, 4.0) if static else (LINE, 0.0)
    shown = (np.asarray(from_si(values[:, i], unit)) for i, unit in enumerate(signal.units))
    series = tuple(
        Series(channel, horizontal, y, COLOURS[i % 6], i, width, points)
        for i, (channel, y) in enumerate(zip(signal.channels, shown, strict=True))
    )
    label = f"{signal.label} [{signal.units[0]}]"
    return panels_svg((Axes("sample" if static else "time [s]", label, series, whole=static),), (1,), WIDTH, 3.2)


def draw_margins(solution: Solution) -> str:
    """The share of each limit's range that is left where the solution comes closest to it."""
    rows = []
    for margin in (m for m in solution.margins if m.share is not None):
        share = 100 * max(margin.share or 0.0, 0.0)
        unit = margin.limit.unit
        value, bound = from_si(margin.value, unit), from_si(margin.limit.described(margin.bound), unit)
        reserved = f" less {show_difference(margin.reserve, unit, 3)} reserved" if margin.reserve else ""
        text = f"{share:.3g} %: {margin.channel} {value:.4g} of {bound:.4g} {unit}{reserved}"
        rows.append(Bar(margin.limit.label, share, COLOURS[2 if margin is solution.tightest else 0], text))
    label = "range left where the limit is approached most [%]"
    return bars_svg(rows, label, WIDTH, 0.5 + 0.42 * len(rows))


def draw_stage_force(solution: Solution) -> str:
    """Linear and total force against displacement of the axis that moves most (S1 Fig. 13)."""
    values = np.asarray(from_si(solution.trace.signals["displacement"], "um"))
    axis = int(np.argmax(np.ptp(values, axis=0)))
    x, linear, total = (v[:, axis] for v in (values, force_parts(solution)["linear"], solution.trace.signals["force"]))
    series = (
        Series("linear force, S1 eq. (9)", x, linear, COLOURS[0], 1, points=4.0),
        Series("linear + nonlinear, S1 eq. (12)", x, total, COLOURS[2], 0, points=4.0),
    )
    label = f"displacement {solution.model.axes[axis]} [um]"
    return panels_svg((Axes(label, "force on the actuator bar [N]", series, columns=1),), (1,), 6.2, 3.6)

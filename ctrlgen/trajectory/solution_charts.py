"""Data of the figures of a solution that zoom and show their values: path and error, forces, states, drives over time."""

from __future__ import annotations

import numpy as np

from ctrlgen.core.units import difference, from_si
from ctrlgen.reporting.chart import Chart, Curve, Panel
from ctrlgen.trajectory.infeasibility import FEASIBILITY_TOLERANCE
from ctrlgen.trajectory.solution import Solution
from ctrlgen.trajectory.solution_plots import FINER

# pixels: two panels under the drawing of the path still stand on the first screen
LOW = 150


def chart_solution(solution: Solution) -> dict[str, Chart]:
    """The charts by the names of `draw_solution`; those of one page show the same stretch."""
    state = solution.model.signals.get("state")
    roles = {"forces": "force", f"{state.name if state else 'state'}s": "state", "drives": "drive"}
    charts = {name: _signal(solution, role) for name, role in roles.items() if role in solution.model.signals}
    if solution.scenario.file.follow == "pose" and solution.scenario.sample_time:
        charts["path"] = _path(solution)
    return charts


def abscissa(solution: Solution) -> tuple[str, np.ndarray]:
    """Label and values of what everything is drawn over: time [s], the sample of a static scenario."""
    static = solution.scenario.sample_time is None
    n = len(solution.command)
    return ("sample", np.arange(float(n))) if static else ("time [s]", np.asarray(solution.trace.time[:n]))


def _signal(solution: Solution, role: str) -> Chart:
    signal, (label, x) = solution.model.signals[role], abscissa(solution)
    values = solution.trace.signals[role][: len(x)]
    points = solution.scenario.sample_time is None
    curves = tuple(
        Curve(channel, from_si(values[:, i], unit), i, i, held=role == "drive", points=points)
        for i, (channel, unit) in enumerate(zip(signal.channels, signal.units, strict=True))
    )
    return Chart(label, (Panel(f"{signal.label} [{signal.units[0]}]", x[: len(values)], curves, height=240),))


def _path(solution: Solution) -> Chart:
    """What is commanded, and by how much the modelled samples miss it, in the channels with the unit of the one that moves most."""
    signal, (label, x) = solution.model.signals["pose"], abscissa(solution)
    reached, command = solution.trace.signals["pose"][: len(x)], solution.command
    most = int(np.argmax(np.ptp(command, axis=0) / signal.scale))
    unit = signal.units[most]
    alike = [i for i, other in enumerate(signal.units) if other == unit]
    fine = FINER.get(unit, unit)
    tolerance = float(difference(FEASIBILITY_TOLERANCE * signal.scale[most], fine))
    shown = tuple(Curve(signal.channels[i], from_si(reached[:, i], unit), k, k) for k, i in enumerate(alike))
    error = tuple(
        Curve(f"error of {signal.channels[i]}", difference(reached[:, i] - command[:, i], fine), k, k)
        for k, i in enumerate(alike)
    )
    panels = (
        Panel(f"modelled [{unit}]", x, shown, height=LOW),
        Panel(f"error [{fine}]", x, error, band=(-tolerance, tolerance), height=LOW),
    )
    return Chart(label, panels)

"""The report of a solution and its comparison: summary.json, trajectory.csv, figures, one self-contained report.html."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from ctrlgen.budget.budget_section import BudgetSection
from ctrlgen.core.files import write_text
from ctrlgen.core.units import from_si
from ctrlgen.firmware.folder import CFolder
from ctrlgen.reporting.html import render
from ctrlgen.reporting.result_file import json_text
from ctrlgen.trajectory.metrics import ExpectationResult
from ctrlgen.trajectory.solution import Solution
from ctrlgen.verification.comparison import Comparison
from ctrlgen.verification.summary import summary

CONTRIBUTORS = 8  # of the error budget, in the report
CSV_SIGNALS = ("pose", "displacement", "force", "state", "power")


def write_trajectory(solution: Solution, path: Path) -> None:
    """Writes trajectory.csv: time, pose, displacement, force, temperature, power, each column with its unit.

    Row k holds the state at sample k and the power that acts from there to sample k + 1. The drive's columns come last
    where the drive is not the power.
    """
    signals = solution.model.signals
    roles = [role for role in CSV_SIGNALS if role in signals]
    if signals["drive"].columns not in [signals[role].columns for role in roles]:
        roles.append("drive")
    static = solution.scenario.sample_time is None
    header = ["sample" if static else "time [s]"]
    columns = [(np.arange(len(solution.command)) if static else solution.trace.time)[:, None]]
    for role in roles:
        signal = solution.model.signals[role]
        header += signal.columns
        values = solution.trace.signals[role]
        columns.append(np.column_stack([from_si(values[:, i], unit) for i, unit in enumerate(signal.units)]))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    for row in np.hstack(columns):
        writer.writerow([f"{value:.12g}" for value in row])
    write_text(path, text.getvalue())


def write_report(
    out: Path,
    solution: Solution,
    comparison: Comparison | None,
    expected: tuple[ExpectationResult, ...],
    c: CFolder | None,
    figures: dict[str, str],
    budget: BudgetSection | None = None,
) -> None:
    """Writes what a reader looks at: summary.json, trajectory.csv, figures/*.svg, report.html.

    `figures`: name -> SVG text, as `ctrlgen.reporting.plots.draw_all` gives; `budget` as `budget_section` gives.
    """
    result = summary(solution, comparison, expected, c)
    write_text(out / "summary.json", json_text(result))
    write_trajectory(solution, out / "trajectory.csv")
    for name, text in figures.items():
        write_text(out / "figures" / f"{name}.svg", text)
    page = render(
        Path(__file__).with_name("report.html.j2"),
        s=result,
        figures=figures,
        rows=comparison.worst if comparison else (),
        source=solution.model.device.source,
        device_title=solution.model.device.title,
        budget=budget,
        contributors=CONTRIBUTORS,
        sourced=[(path, q.text, q.source or "") for path, q in solution.model.device.quantities()],
    )
    write_text(out / "report.html", page)

"""The report of a solution and its comparison: summary.json, trajectory.csv, figures, one self-contained report.html."""

from __future__ import annotations

from pathlib import Path

from ctrlgen.budget.budget_section import BudgetSection
from ctrlgen.budget.budget_shares import printed_shares
from ctrlgen.core.files import write_text
from ctrlgen.firmware.folder import CFolder
from ctrlgen.reporting.html import render
from ctrlgen.reporting.page_figure import page_figures
from ctrlgen.reporting.result_file import json_text
from ctrlgen.trajectory.metrics import ExpectationResult
from ctrlgen.trajectory.solution import Solution
from ctrlgen.trajectory.solution_charts import chart_solution
from ctrlgen.trajectory.solution_table import table_of_signals
from ctrlgen.verification.comparison import Comparison
from ctrlgen.verification.report_first_screen import report_first_screen
from ctrlgen.verification.summary import summary

CONTRIBUTORS = 8  # of the error budget, in the report
FIGURES = {
    "path": ("Path and error", "Commanded path and modelled samples; the modelled signal less the commanded one."),
    "forces": ("Forces", "Actuator force on each axis."),
    "temperatures": ("Temperatures", "Average temperature of each actuator."),
    "drives": ("Drives", "Drive of each actuator, held from sample to sample."),
    "margins": ("Margins", "What is left of each limit where it is closest; the tightest in orange."),
    "stage_force": ("Force law", "Force law of one stage axis."),
}
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
    write_text(path, table_of_signals(solution, roles))


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

    `figures`: name -> SVG text, as `ctrlgen.trajectory.solution_plots.draw_solution` gives; `budget` as `budget_section` gives.
    """
    result = summary(solution, comparison, expected, c)
    write_text(out / "summary.json", json_text(result))
    write_trajectory(solution, out / "trajectory.csv")
    for name, text in figures.items():
        write_text(out / "figures" / f"{name}.svg", text)
    drawn, record = (
        page_figures(figures, FIGURES, chart_solution(solution), ("path",)),
        None if budget is None else budget.record,
    )
    page = render(
        Path(__file__).with_name("report.html.j2"),
        s=result,
        first=report_first_screen(result, drawn, budget, record),
        figures=drawn,
        rows=comparison.worst if comparison else (),
        source=solution.model.device.source,
        device_title=solution.model.device.title,
        budget=budget,
        shares={} if record is None else printed_shares(record, CONTRIBUTORS),
        contributors=CONTRIBUTORS,
        sourced=[(path, q.text, q.source or "") for path, q in solution.model.device.quantities()],
    )
    write_text(out / "report.html", page)

"""The figures and the page of every result, for `plot()` and `report`: those that the command line writes."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import singledispatch
from pathlib import Path
from typing import Any

from ctrlgen.app.scenario_pipeline import Outcome
from ctrlgen.budget.budget_page import draw_budget, write_budget
from ctrlgen.budget.budget_section import budget_section
from ctrlgen.budget.error_budget import ErrorBudget
from ctrlgen.calibration.calibrate import Calibration
from ctrlgen.calibration.calibration_page import draw_constants, write_calibration
from ctrlgen.core.tabular import Drawn, Page
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.diagnosis_record import Provenance, diagnosis_record
from ctrlgen.diagnosis.report.figures import draw_all
from ctrlgen.diagnosis.report.html_report import page
from ctrlgen.diagnosis.report.residuals import Residuals
from ctrlgen.learning.learn import Learning
from ctrlgen.learning.learning_page import write_learning
from ctrlgen.learning.learning_plots import draw_learning
from ctrlgen.model.simulation import Trace
from ctrlgen.path_timing.fastest import FastestPath
from ctrlgen.path_timing.fastest_page import write_fastest
from ctrlgen.path_timing.fastest_plots import draw_fastest
from ctrlgen.recordings.recording import Recording
from ctrlgen.reporting.line_patterns import dashes
from ctrlgen.reporting.plots import COLOURS, STYLE, legend_above, plt, svg
from ctrlgen.reporting.result_file import json_text
from ctrlgen.trajectory.metrics import expectations
from ctrlgen.trajectory.solution import Solution
from ctrlgen.trajectory.solution_plots import draw_solution
from ctrlgen.trajectory.workspace import Workspace
from ctrlgen.trajectory.workspace_plots import draw_workspace
from ctrlgen.verification.scenario_report import write_report


@singledispatch
def figures_of(result: Drawn) -> dict[str, str]:
    """Name -> SVG text of every figure of a result."""
    raise TypeError(f"{type(result).__name__} is not drawn")


figures_of.register(Solution, draw_solution)
figures_of.register(ErrorBudget, draw_budget)
figures_of.register(FastestPath, draw_fastest)
figures_of.register(Learning, draw_learning)


@figures_of.register
def _(result: Diagnosis) -> dict[str, str]:
    return draw_all(result, Residuals(result))


@figures_of.register
def _(result: Outcome) -> dict[str, str]:
    return draw_solution(result.solution)


@figures_of.register
def _(result: Calibration) -> dict[str, str]:
    with plt.rc_context(STYLE):
        return {"constants": svg(draw_constants(result))}


@figures_of.register
def _(result: Workspace) -> dict[str, str]:
    bases = result.bases()
    ball = result.ball(bases[len(bases) // 2], result.translations)
    with plt.rc_context(STYLE):
        return {"workspace": svg(draw_workspace(result, bases, ball))}


@figures_of.register
def _(result: Trace) -> dict[str, str]:
    """A figure a signal, an axis a unit."""
    time, *columns = result.columns()
    with plt.rc_context(STYLE):
        return {
            role: _lines(time, [c for c in columns if c.name.partition(".")[0] == role]) for role in result.described
        }


@figures_of.register
def _(result: Recording) -> dict[str, str]:
    """A figure a record: its drives and readings over time."""
    figures = {}
    with plt.rc_context(STYLE):
        for record in result.records:
            time, *columns = result.columns_of(record)
            figures[record.name] = _lines(time, columns)
    return figures


def _lines(index: Any, columns: list[Any]) -> str:
    """Columns over an index, those of one unit in one pair of axes."""
    units = list(dict.fromkeys((c.name.partition(".")[0], c.unit) for c in columns))
    figure, axes = plt.subplots(len(units), 1, figsize=(8.2, 1.2 + 1.9 * len(units)), sharex=True, squeeze=False)
    for (role, unit), ax in zip(units, axes[:, 0], strict=True):
        alike = [c for c in columns if (c.name.partition(".")[0], c.unit) == (role, unit)]
        for k, column in enumerate(alike):
            ax.plot(index.values, column.values, lw=1, ls=dashes(k), color=COLOURS[k % len(COLOURS)], label=column.name)
        ax.set_ylabel(f"{role} [{unit}]")
        legend_above(ax)
    axes[-1, 0].set_xlabel(index.heading)
    return svg(figure)


@singledispatch
def page_of(result: Any) -> Page:
    """The page of a result with all its files."""
    raise TypeError(f"{type(result).__name__} has no page")


@page_of.register
def _(result: Diagnosis) -> Page:
    """Without the digests of its files, which only a diagnosis into a folder knows."""
    provenance = Provenance({}, 0)
    files = {
        "report.html": page(result, provenance).encode(),
        "diagnosis.json": json_text(diagnosis_record(result, provenance)).encode(),
    }
    return Page(result.recording.title, files, "report.html")


@page_of.register
def _(result: Solution) -> Page:
    return page_of(Outcome(result, None, None, expectations(result)))


@page_of.register
def _(result: Outcome) -> Page:
    def write(out: Path) -> None:
        s = result.solution
        write_report(out, s, result.comparison, result.expected, result.c, draw_solution(s), budget_section(s))

    return _written(result.solution.scenario.file.title, "report.html", write)


@page_of.register
def _(result: ErrorBudget) -> Page:
    return _written(result.solution.scenario.file.title, "budget.html", lambda out: write_budget(out, result))


@page_of.register
def _(result: FastestPath) -> Page:
    return _written(result.scenario.file.title, "fastest.html", lambda out: write_fastest(out, result))


@page_of.register
def _(result: Learning) -> Page:
    return _written(result.solution.scenario.file.title, "learning.html", lambda out: write_learning(out, result))


@page_of.register
def _(result: Calibration) -> Page:
    return _written(result.device.title, "calibration.html", lambda out: write_calibration(out, result))


def _written(title: str, name: str, write: Callable[[Path], None]) -> Page:
    """What `write` writes into a folder, of which `name` is the page."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        write(folder)
        files = {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}
    return Page(title, files, name)

"""All comparisons with the papers: the printed numbers of the four sources, as rows, as JSON and as a page with figures."""

from __future__ import annotations

from collections import Counter
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

from ctrlgen.budget.robust import solve
from ctrlgen.core.files import write_text
from ctrlgen.model.assembly import build_model
from ctrlgen.reporting.html import render
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure, page_figures
from ctrlgen.reporting.plots import STYLE, svg
from ctrlgen.reporting.result_file import origin
from ctrlgen.trajectory.scenario import load_scenario
from ctrlgen.trajectory.solution_plots import draw_path, draw_signal, draw_stage_force

from . import s0, s0_figures, s1, s2, s2_figures, s3, s3_hinges
from .row import PrintedNumber, ReproductionStatus
from .s0_data import SCENARIOS


def _s3_rows() -> list[PrintedNumber]:
    return [*s3.rows(), *s3_hinges.rows()]


SOURCES = {"S0": s0.rows, "S1": s1.rows, "S2": s2.rows, "S3": _s3_rows}
TITLES = {
    "S0": "meso-scale hexapod: kinematics and calibration",
    "S1": "MEMS hexapod: stiffness model and control",
    "S2": "hinge equations and the measuring chain",
    "S3": "3-RRR stage: kinetostatic model",
}


MARKS = {
    ReproductionStatus.REPRODUCED.value: "ok",
    ReproductionStatus.CORRECTED.value: "idle",
    ReproductionStatus.DIFFERS.value: "bad",
    ReproductionStatus.NOT_COMPUTABLE.value: "idle",
}


def _s1_figures() -> dict[str, str]:
    """Fig. 13 from the stage sweep, Fig. 14(a) and (b) from the circle: our own solutions."""
    drawn = {}
    sweep, circle = (load_scenario(SCENARIOS / name) for name in ("xy_stage_force", "circle20"))
    with plt.rc_context(STYLE):
        drawn["Fig. 13, linear and nonlinear force"] = svg(draw_stage_force(solve(sweep, build_model(sweep.device))))
        solution = solve(circle, build_model(circle.device))
        drawn["Fig. 14(a), the circle"] = svg(draw_path(solution))
        drawn["Fig. 14(b), the six forces"] = svg(draw_signal(solution, "force"))
    return drawn


def _s3_figures() -> dict[str, str]:
    """Figs. 3-5, the hinge equations against finite elements; empty where scikit-fem is not installed."""
    if find_spec("skfem") is None:
        return {}
    from . import hinge_errors

    data = hinge_errors.hinge_errors()
    return {
        f"{name}, {hinge_errors.LABELS[key]}": hinge_errors.draw_hinge_errors(data, key)
        for key, name in hinge_errors.FIGURES.items()
    }


FIGURES = {"S0": s0_figures.figures, "S1": _s1_figures, "S2": s2_figures.figures, "S3": _s3_figures}


def reproduce(sources: list[str]) -> list[PrintedNumber]:
    """The printed numbers of the named sources, in the order of each paper."""
    return [row for name in sources for row in SOURCES[name]()]


def as_json(rows: list[PrintedNumber]) -> list[dict[str, Any]]:
    """The rows as plain dicts: source, where, printed, ours, difference, taken literally, implied, unit, status, reason."""
    return [
        {
            "source": row.source,
            "where": row.where,
            "printed": row.printed,
            "ours": row.ours,
            "difference": row.difference,
            "taken_literally": row.taken_literally,
            "implied": row.implied,
            "unit": row.unit,
            "status": row.status.value,
            "reason": row.reason,
        }
        for row in rows
    ]


def counts(rows: list[PrintedNumber]) -> Counter[tuple[str, str]]:
    """The number of rows of each (source, status)."""
    return Counter((row.source, row.status.value) for row in rows)


def write_page(rows: list[PrintedNumber], path: Path) -> None:
    """Writes one self-contained HTML page: counts, the figures redrawn from our own results, and every row."""
    sources = list(dict.fromkeys(row.source for row in rows))
    figures = {source: page_figures(FIGURES[source](), {}) for source in sources if source in FIGURES}
    first = next((drawn for group in figures.values() for drawn in group.values()), None)
    page = render(
        Path(__file__).with_name("reproduce.html.j2"),
        rows=as_json(rows),
        sources=sources,
        titles=TITLES,
        counts=counts(rows),
        first=_first_screen(rows, first),
        figures=figures,
        statuses=[status.value for status in ReproductionStatus],
        marks=MARKS,
        origin=origin({}),
    )
    write_text(path, page)


def _first_screen(rows: list[PrintedNumber], figure: PageFigure | None) -> FirstScreen:
    """How many printed numbers are reproduced, and why the others are not is told with each."""
    of = Counter(row.status.value for row in rows)
    others = f"{of['differs']} differ, {of['not computable']} cannot be computed"
    follow = f"{of['reproduced']} of {len(rows)} printed numbers are reproduced, {of['corrected']} more once others are corrected"
    answer = f"{follow}; {others}."
    numbers = tuple((status, str(k)) for status, k in of.most_common())
    steps = (
        "Read the reason of each number that differs, in the table of its paper.",
        "One paper alone: `ctrlgen reproduce S1`.",
    )
    return FirstScreen((answer,), "so" if of["differs"] else "ok", figure, numbers, steps)

"""The whole comparison with print: rows of all four sources, as a table, as JSON and as a page with figures."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import jinja2

from ctrlgen.files import write_text
from ctrlgen.firmware import codegen_folder
from ctrlgen.reproduce import s0, s0_figures, s1, s2, s3
from ctrlgen.reproduce.row import Row

SOURCES = {"S0": s0.rows, "S1": s1.rows, "S2": s2.rows, "S3": s3.rows}
TITLES = {
    "S0": "meso-scale hexapod: kinematics and calibration", "S1": "MEMS hexapod: stiffness model and control",
    "S2": "hinge equations and the measuring chain", "S3": "3-RRR stage: kinetostatic model",
}  # fmt: skip


def reproduce(sources: list[str]) -> list[Row]:
    """Rows of the named sources, in the order of the papers."""
    return [row for name in sources for row in SOURCES[name]()]


def as_json(rows: list[Row]) -> list[dict[str, Any]]:
    """A list of plain rows: source, where, printed, ours, difference, unit, status, reason."""
    return [
        {
            "source": row.source, "where": row.where, "printed": row.printed, "ours": row.ours, "difference": row.difference,
            "unit": row.unit, "status": row.status.value, "reason": row.reason,
        }
        for row in rows
    ]  # fmt: skip


def counts(rows: list[Row]) -> Counter[tuple[str, str]]:
    """How many rows of each (source, status)."""
    return Counter((row.source, row.status.value) for row in rows)


def write_page(rows: list[Row], path: Path) -> None:
    """One self-contained HTML page: counts, the figures redrawn from our own results, and every row."""
    sources = list(dict.fromkeys(row.source for row in rows))
    figures = s0_figures.figures() if "S0" in sources else {}
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(codegen_folder() / "templates"), autoescape=True, undefined=jinja2.StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    page = environment.get_template("reproduce.html.j2").render(
        rows=as_json(rows), sources=sources, titles=TITLES, counts=counts(rows), figures=figures
    )
    write_text(path, page)

"""Console output of a calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape

from ctrlgen.app.console import out, show_table, table_of
from ctrlgen.core.units import difference

if TYPE_CHECKING:
    from ctrlgen.budget.error_budget import ErrorBudget
    from ctrlgen.calibration.calibrate import Calibration


def print_calibration(calibration: Calibration, budgets: tuple[ErrorBudget, ErrorBudget] | None) -> None:
    """The constants, the error on held-out records, and the budgets where there are some."""
    out.print(f"[bold]calibration: {escape(calibration.recording.title)}[/bold]", soft_wrap=True)
    table = table_of(
        ("constant", "left"), ("device file", "right"), ("specimen", "right"), ("95 % interval", "right"), ("", "left")
    )
    for row in calibration.constants:
        c = row.constant
        interval = " ... ".join(c.shown(v, 6) for v in row.interval) if row.determined else f"bounds {c.range_text}"
        remark = row.remark if row.determined else f"default kept: {row.remark}"
        table.add_row(escape(c.path), c.shown(c.default), c.shown(row.value), interval, remark)
    show_table(table)
    table = table_of(
        ("held-out error, rms", "left"), ("device file", "right"), ("specimen", "right"), ("noise", "right")
    )
    for e in calibration.errors:
        cells = [f"{difference(v, e.unit):.4g} {e.unit}" for v in (e.before, e.after, e.noise)]
        table.add_row(escape(e.channel), *cells)
    show_table(table)
    if budgets is not None:
        before, after = budgets
        title = before.solution.scenario.file.title
        for g in before.groups:
            both = f"{g.shown(before.peak(g)):.4g} -> {g.shown(after.peak(g)):.4g} {g.unit}"
            what = f"largest combined standard uncertainty, {g.name}"
            out.print(f"budget of {title}: {what}: {both}", markup=False, soft_wrap=True)
    for note in calibration.notes:
        out.print(note, markup=False, soft_wrap=True, style="yellow")

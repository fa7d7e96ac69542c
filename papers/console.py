"""The rows of `ctrlgen reproduce` on the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.markup import escape

from ctrlgen.app.console import show_table, table_of

from .row import PrintedNumber, ReproductionStatus


def print_reproduced(rows: Sequence[PrintedNumber]) -> None:
    """The printed numbers of the papers beside ours: status and reason."""
    colours = {
        ReproductionStatus.REPRODUCED: "green",
        ReproductionStatus.CORRECTED: "cyan",
        ReproductionStatus.DIFFERS: "red",
        ReproductionStatus.NOT_COMPUTABLE: "yellow",
    }
    table = table_of(
        ("", "left"), ("where", "left"), ("printed", "right"), ("ours", "right"), ("literally", "right"), ("", "left")
    )
    for row in rows:
        ours = "" if row.ours is None else f"{row.ours:.6g}"
        literally = "" if row.taken_literally is None else f"{row.taken_literally:.6g}"
        status = f"[{colours[row.status]}]{row.status.value}[/{colours[row.status]}]"
        table.add_row(
            row.source,
            escape(row.where),
            escape(row.printed if row.unit == "1" else f"{row.printed} {row.unit}"),
            ours,
            literally,
            status,
            escape(row.reason),
        )
    show_table(table)

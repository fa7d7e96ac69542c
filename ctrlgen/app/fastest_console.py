"""Console output of a fastest motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape

from ctrlgen.app.console import out, show_table, table_of
from ctrlgen.core.counts import number_of

if TYPE_CHECKING:
    from ctrlgen.path_timing.fastest import FastestPath

SHOWN = 12  # limits


def print_fastest(motion: FastestPath) -> None:
    """The motions compared, the limits that bind, and what a frequency allows."""
    from ctrlgen.path_timing.fastest_page import between_text, motions, repetition_sentence, runs_text
    from ctrlgen.path_timing.fastest_plots import bound_text

    out.print(f"[bold]fastest motion: {escape(motion.scenario.file.title)}[/bold]", soft_wrap=True)
    closed = motion.curve.closed
    heads = ("one period", "repeated") if closed else ("first to last", "as stated")
    table = table_of(("motion", "left"), (heads[0], "right"), (heads[1], "right"))
    for k, row in enumerate(motions(motion)):
        table.add_row(*row, style="bold" if k == 3 else None)
    show_table(table)
    table = table_of(
        ("limit that binds", "left"),
        ("at", "left"),
        ("bound", "right"),
        ("of the time", "right"),
        ("along the path", "left"),
    )
    for b in motion.bindings[:SHOWN]:
        table.add_row(
            escape(b.side.limit.label), b.side.name, bound_text(b), f"{100 * b.share_of_time:.1f} %", runs_text(b)
        )
    if motion.bindings:
        show_table(table)
    if len(motion.bindings) > SHOWN:
        out.print(f"and {number_of(len(motion.bindings) - SHOWN, 'more limit')}")
    points = f"{len(motion.solution.command)} set-points every {1e3 * motion.sample_time:.6g} ms"
    between = f"largest distance from the path between them: {between_text(motion)}"
    out.print(f"{points}; {between}", markup=False, soft_wrap=True)
    if sentence := repetition_sentence(motion):
        out.print(sentence, markup=False, soft_wrap=True, style="bold")
    for note in motion.notes:
        out.print(note, markup=False, soft_wrap=True, style="yellow")

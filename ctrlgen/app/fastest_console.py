"""Console output of a fastest motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape

from ctrlgen.app.console import out, show_table, table_of

if TYPE_CHECKING:
    from ctrlgen.path_timing.fastest import FastestPath

SHOWN = 12  # limits


def print_fastest(found: FastestPath) -> None:
    """The motions compared, the limits that bind, and what a frequency allows."""
    from ctrlgen.path_timing.fastest_page import between_text, motions, repetition_sentence, runs_text
    from ctrlgen.path_timing.fastest_plots import bound_text

    out.print(f"[bold]fastest motion: {escape(found.scenario.file.title)}[/bold]", soft_wrap=True)
    closed = found.curve.closed
    heads = ("one period", "repeated") if closed else ("first to last", "as stated")
    table = table_of(("motion", "left"), (heads[0], "right"), (heads[1], "right"))
    for k, row in enumerate(motions(found)):
        table.add_row(*row, style="bold" if k == 3 else None)
    show_table(table)
    table = table_of(
        ("limit that binds", "left"),
        ("at", "left"),
        ("bound", "right"),
        ("of the time", "right"),
        ("along the path", "left"),
    )
    for b in found.bindings[:SHOWN]:
        table.add_row(
            escape(b.side.limit.label), b.side.name, bound_text(b), f"{100 * b.share_of_time:.1f} %", runs_text(b)
        )
    if found.bindings:
        show_table(table)
    if len(found.bindings) > SHOWN:
        out.print(f"and {len(found.bindings) - SHOWN} more limits")
    out.print(
        f"{len(found.solution.command)} set-points every {1e3 * found.sample_time:.6g} ms; largest distance from the path between them: "
        f"{between_text(found)}", markup=False, soft_wrap=True,
    )  # fmt: skip
    if sentence := repetition_sentence(found):
        out.print(sentence, markup=False, soft_wrap=True, style="bold")
    for note in found.notes:
        out.print(note, markup=False, soft_wrap=True, style="yellow")

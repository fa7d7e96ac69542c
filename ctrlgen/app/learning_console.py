"""Console output of learning from runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape

from ctrlgen.app.console import Column, out, show_table, table_of
from ctrlgen.core.to_digits import to_digits

if TYPE_CHECKING:
    from ctrlgen.learning.learn import Learning


def print_learning(learning: Learning) -> None:
    """The runs with their errors, reached and predicted, how the device answered, and what comes next."""
    from ctrlgen.learning.learning_page import shown_error, verdict
    from ctrlgen.learning.sensor_words import sensor_words

    out.print(f"[bold]learning from runs: {escape(learning.solution.scenario.file.title)}[/bold]", soft_wrap=True)
    numbers: tuple[Column, ...] = (
        ("measured", "right"),
        ("noise", "right"),
        ("repeating", "right"),
        ("predicted", "right"),
    )
    table = table_of(("run", "left"), ("repetitions", "right"), ("rms error", "left"), *numbers)
    for k, run in enumerate(learning.runs):
        style = "bold" if k == learning.base else None
        for g in learning.groups:
            first = (escape(run.name), str(run.repeats)) if g is learning.groups[0] else ("", "")
            measured, noise = (
                f"{to_digits(g.shown(run.rms[g.name]))} {g.unit}",
                f"{to_digits(g.shown(run.noise[g.name]), 3)}",
            )
            predicted = "" if run.predicted is None else f"{to_digits(g.shown(run.predicted[g.name]), 3)}"
            table.add_row(*first, g.name, measured, noise, shown_error(learning, run, g.name), predicted, style=style)
    for g in learning.groups if not learning.stop else ():
        then = f"{to_digits(g.shown(learning.predicted[g.name]), 3)}"
        table.add_row("next" if g is learning.groups[0] else "", "", g.name, "", "", "", then)
    show_table(table)
    if learning.response is not None:
        names = learning.solution.model.signals["drive"].channels
        pairs = zip(names, learning.response.gain, learning.response.se, strict=True)
        text = ", ".join(f"{name} {gain:.3f} ± {to_digits(se, 2)}" for name, gain, se in pairs if gain == gain)
        out.print(f"observed over predicted change from run to run: {text}", markup=False, soft_wrap=True)
    out.print(verdict(learning), markup=False, soft_wrap=True, style="green" if learning.stop else None)
    if learning.step < 1 and not learning.stop:
        out.print(f"share of the full step that is taken: {learning.step:g}", markup=False, soft_wrap=True)
    for text in sensor_words(learning):
        out.print(text, markup=False, soft_wrap=True)
    for note in learning.notes:
        out.print(note, markup=False, soft_wrap=True, style="yellow")

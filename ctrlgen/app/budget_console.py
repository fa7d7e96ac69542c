"""Console output of an error budget."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape

from ctrlgen.app.console import out, show_table, table_of
from ctrlgen.core.counts import number_of
from ctrlgen.core.to_digits import to_digits

if TYPE_CHECKING:
    from ctrlgen.budget.error_budget import ErrorBudget


def print_budget(budget: ErrorBudget) -> None:
    """The contributors in their order, all combined, the limits, and whether the draws agree."""
    from ctrlgen.budget.budget_record import safety_sentence

    out.print(f"[bold]error budget: {escape(budget.solution.scenario.file.title)}[/bold]", soft_wrap=True)
    heads = [(f"{g.unit} {what}", "right") for g in budget.groups for what in ("per step", "peak", "rms")]
    table = table_of(("contributor", "left"), ("sd", "right"), ("step", "right"), *heads, ("largest share", "right"))  # type: ignore[arg-type]
    for line in budget.lines:
        cells = []
        for g in budget.groups:
            cells += [f"{to_digits(g.shown(v[g.name]), 3)}" for v in (line.sensitivity, line.peak, line.rms)]
        table.add_row(escape(line.called), line.sd, line.per, *cells, f"{100 * line.share:.1f} %")
    cells = []
    for g in budget.groups:
        cells += ["", f"{to_digits(g.shown(budget.peak(g)))}", f"{to_digits(g.shown(budget.rms(g)))}"]
    table.add_row("combined standard uncertainty", "", "", *cells, "", style="bold")
    if budget.model_difference is not None:
        cells = []
        for g in budget.groups:
            cells += [
                "",
                f"{to_digits(g.shown(budget.difference_peak(g)))}",
                f"{to_digits(g.shown(budget.difference_rms(g)))}",
            ]
        table.add_row("model difference", "", "", *cells, "")
    show_table(table)
    bands = ", ".join(
        f"± {to_digits(g.shown(budget.factor * budget.peak(g)))} {g.unit} ({g.name})" for g in budget.groups
    )
    out.print(f"95 % band where it is widest: {bands}", markup=False, soft_wrap=True)
    if budget.model_difference is not None:
        what = f"model difference: {budget.model_difference.finer.model.name} under the same drives; it is not combined with the band"
        out.print(what, markup=False, soft_wrap=True)
    before = {g.name: budget.peak(g) for g in budget.groups}
    for k, line in enumerate([line for line in budget.lines if any(line.peak.values())][:3]):
        halves = ", ".join(
            f"{to_digits(g.shown(before[g.name]))} -> {to_digits(g.shown(line.halved[g.name]))} {g.unit}"
            for g in budget.groups
        )
        what = "next: halve the sd of" if k == 0 else "then also that of"
        out.print(f"{what} {line.called}: {halves}", markup=False, soft_wrap=True)
        before = line.halved
    for safety in budget.safeties:
        style = None if safety.kept >= 0 else "red"
        out.print(safety_sentence(safety, budget.probability), markup=False, soft_wrap=True, style=style)
    for a in budget.agreements:
        g, verdict = a.group, "agree" if a.passed else "DIFFER"
        both = f"{g.name} {to_digits(g.shown(a.drawn))} {g.unit}, first order {to_digits(g.shown(a.linear))} {g.unit}"
        off = (
            f"at most {100 * a.difference:.1f} % in the sd, {100 * a.difference_of_interval:.1f} % in the 95 % interval"
        )
        style = None if a.passed else "yellow"
        out.print(
            f"{number_of(budget.draws, 'draw')}: {both}; they {verdict}: {off}",
            markup=False,
            soft_wrap=True,
            style=style,
        )
    if budget.broken is not None:
        share = f"{to_digits(100 * budget.broken, 3)} % of them break a limit somewhere along the path"
        out.print(share, markup=False, soft_wrap=True, style="red" if budget.broken > 1 - budget.probability else None)
    for reason in (*budget.reasons, *budget.notes):
        out.print(reason, markup=False, soft_wrap=True, style="yellow")

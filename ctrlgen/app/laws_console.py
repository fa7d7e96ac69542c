"""What `ctrlgen laws` prints: every law that a device file may name, or all that is stated of some."""

from __future__ import annotations

import inspect
from collections.abc import Sequence

from rich.markup import escape

from ctrlgen.app.console import out, show_table, table_of
from ctrlgen.effects import Effect
from ctrlgen.estimation.hypothesis import selected_laws


def print_laws(names: Sequence[str]) -> None:
    """One line a law; of those that are named their equation, range, source and parameters. Raises InputError for an unknown name."""
    laws = selected_laws(names or None)
    if names:
        for law in laws:
            _print_law(law)
        return
    table = table_of(("kind", "left"), ("acts on", "left"), ("package", "left"))
    for law in laws:
        table.add_row(law.kind, law.place.value, escape(law.package or "ctrlgen"), escape(law.title))
    show_table(table)


def _print_law(law: type[Effect]) -> None:
    out.print(f"[bold]{law.kind}[/bold], of {escape(law.package or 'ctrlgen')}: {escape(law.title)}", soft_wrap=True)
    out.print(inspect.cleandoc(law.__doc__ or ""), markup=False, soft_wrap=True)
    out.print(f"acts on: {law.place.value}; source: {law.source}", markup=False, soft_wrap=True)
    for p in law.params:
        low, high = p.bounds
        out.print(f"  {p.name} [{p.unit}], {low:g} ... {high:g}: {p.doc}", markup=False, soft_wrap=True)

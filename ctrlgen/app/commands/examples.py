"""The examples that come with the package: example."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from ctrlgen.app.commands.app import DEVICE_PANEL, app
from ctrlgen.app.console import out, show_table, table_of
from ctrlgen.core.errors import Fault, InputError


@app.command(rich_help_panel=DEVICE_PANEL)
def example(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]...", help="Examples to copy.", show_default=False)
    ] = None,
    to: Annotated[
        Path | None, typer.Option("--to", help="Folder to copy them into; nothing is overwritten.", show_default=False)
    ] = None,
) -> None:
    """List the scenarios and recordings that come with ctrlgen, or copy some of them to try and to change.

    A copy holds the device file that the example needs. Copied into a folder named scenarios, the examples of every
    command's help work as they are printed.

    Example:  ctrlgen example circle20 --to scenarios
    """
    from ctrlgen.app.shipped_examples import copy_examples, examples

    known = examples()
    if not names:
        if to is not None:
            raise InputError("example", [Fault(f"--to {to}", "needs a name; ctrlgen example lists them")])
        table = table_of(("example", "left"), ("", "left"), ("what", "left"))
        for one in known:
            what = one.title if one.complete else f"{one.title} (its data are not included: see its README.md)"
            table.add_row(one.name, "recording" if one.recorded else "scenario", escape(what))
        show_table(table)
        out.print(f"copy one:  ctrlgen example {known[0].name} --to scenarios", markup=False)
        return
    if to is None:
        raise InputError("--to", [Fault(" ".join(names), "needs a folder to be copied into, such as --to scenarios")])
    for path in copy_examples(names, to):
        out.print(str(path), soft_wrap=True, markup=False)
    for one in known:
        if one.name in names:
            out.print(f"try it:  {one.command(to)}", soft_wrap=True, markup=False)

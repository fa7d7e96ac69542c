"""Schemas of the files that users write: schema."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ctrlgen.app.commands.app import DEVICE_PANEL, app
from ctrlgen.app.console import out


@app.command(rich_help_panel=DEVICE_PANEL)
def schema(
    kind: Annotated[str, typer.Argument(help="device, scenario or recording.", show_default=False)],
    to: Annotated[
        Path | None, typer.Option("--to", help="The file to write; without it it is printed.", show_default=False)
    ] = None,
) -> None:
    """Print the JSON Schema of a file that you write, for an editor that completes and checks it: every key, its meaning, its unit.

    Files that ctrlgen new and look --to begin name it in their first line, #:schema ./device.schema.json, and have it beside them;
    taplo, and Even Better TOML in VS Code, read that line.

    Example:  ctrlgen schema device --to device.schema.json
    """
    from ctrlgen.app.editor_schemas import schema_text
    from ctrlgen.core.files import write_text

    text = schema_text(kind)
    if to is None:
        print(text, end="")
    else:
        write_text(to, text)
        out.print(str(to), soft_wrap=True, markup=False)

"""Results on a page of this computer: view."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from ctrlgen.app.commands.app import RESULT_PANEL, app
from ctrlgen.app.console import out


@app.command(rich_help_panel=RESULT_PANEL)
def view(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="DIR...", help="Folders that hold results, however deep.", show_default=False),
    ],
    port: Annotated[
        int | None,
        typer.Option(min=0, max=65535, help="Port; 0: any that is free.", show_default="8765, or any"),
    ] = None,
    open_: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
) -> None:
    """Show result folders on a page of this computer: list, compare two side by side, follow work that goes on, download the C.

    The page is for this computer alone (127.0.0.1), and nothing is written. Ctrl-C ends it.

    Example:  ctrlgen view out --open
    """
    from ctrlgen.app.viewer.local_server import serve

    def ready(address: str) -> None:
        out.print(f"[bold]page[/bold]  {address}   (Ctrl-C ends it)", soft_wrap=True)
        if open_:
            webbrowser.open(address)

    serve(folders, port, ready)

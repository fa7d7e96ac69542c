"""The command line: it registers every command and turns every error into one message and an exit status."""

from __future__ import annotations

import inspect
import re
import warnings
from collections.abc import Callable

import typer
from rich.markup import escape

from ctrlgen.app.commands import (  # noqa: F401, they register their commands
    budgets,
    controllers,
    devices,
    examples,
    fastest_paths,
    learning,
    new,
    recordings,
    schemas,
    viewing,
)
from ctrlgen.app.commands.app import PANELS, app
from ctrlgen.app.console import CHECK, complain, err, shows_warnings
from ctrlgen.core.errors import CtrlgenError, Unreachable

app.registered_commands.sort(key=lambda command: PANELS.index(command.rich_help_panel))
for command in (
    *app.registered_commands,
    *new.new.registered_commands,
):  # typer keeps line breaks, and rich takes [words] for styles: the terminal breaks paragraphs, and every word is shown
    command.help = escape(re.sub(r"(?<=[^\n\b])\n(?=\S)", " ", inspect.getdoc(command.callback) or ""))


def execute(check: Callable[[], None] = lambda: None) -> int:
    """Parses and runs the command line; the exit status. Every error is reported in one message on standard error.

    `check` is called before each step of long work and raises KeyboardInterrupt where the work is to end.
    """
    try:
        CHECK.set(check)
        warnings.showwarning = shows_warnings()
        status = app(standalone_mode=False)  # typer turns Ctrl-C into the status 130
        return status if isinstance(status, int) else 0
    except Unreachable as error:
        err.print("[bold red]unreachable[/bold red]: ", end="")
        err.print(str(error), markup=False, soft_wrap=True)
        return 1
    except CtrlgenError as error:
        complain(error)
        return 1
    except typer.Abort:
        return 130
    except OSError as error:
        from ctrlgen.core.files import explained

        place = f"{error.filename}: " if error.filename else ""
        err.print(f"error: {place}{explained(error)}", markup=False, soft_wrap=True)
        return 1
    except Exception as error:
        if not hasattr(error, "format_message"):
            raise
        if not error.format_message():  # no command at all: typer has shown the help
            return 2
        context = getattr(error, "ctx", None)
        err.print(f"error: {error.format_message()}", markup=False, soft_wrap=True)
        err.print(f"try: {context.command_path if context else 'ctrlgen'} --help", markup=False)
        return 2

"""Console output of the commands: tables, progress bars, one message per error."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Literal

from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from ctrlgen.core.errors import CtrlgenError

# lines are broken by the terminal alone: what reads them elsewhere, or copies them, gets them whole
out = Console(highlight=False, width=None if sys.stdout.isatty() else 110, soft_wrap=True)
err = Console(stderr=True, highlight=False)
EVERY = 10.0  # seconds between two lines of long work
Column = tuple[str, Literal["left", "right"]]  # of a table: its heading and how it is aligned
CHECK: ContextVar[Callable[[], None]] = ContextVar("check", default=lambda: None)  # called before each stage of work


def table_of(*columns: Column) -> Table:
    """A plain table with a last column for remarks; words wrap at spaces, numbers (on the right) never."""
    table = Table(box=None, pad_edge=False, header_style="dim")
    for name, justify in (*columns, ("", "left")):
        table.add_column(name, justify=justify, no_wrap=justify == "right")
    return table


def show_table(table: Table) -> None:
    """Prints `table` with every character of it; beyond the terminal's width where its numbers and longest words need that."""
    unlimited = out.options.update_width(1 << 20)
    for column in table.columns:
        sizes = [Measurement.get(out, unlimited, cell) for cell in (column.header, *column.cells)]
        column.min_width = max(size.maximum if column.no_wrap else size.minimum for size in sizes)
    needed = sum((column.min_width or 0) + 1 for column in table.columns) - 1  # a space between columns
    if needed > out.width:
        table.width = needed
    out.print(table, crop=False, soft_wrap=False)


class Lines:
    """What long work says where no bar can be drawn: a line every ten seconds on standard error, with the time to go where the pieces are
    counted, as if those that are left took as long as those that are done."""

    def __init__(self, what: str, total: int | None = None, every: float = EVERY) -> None:
        self.what, self.done, self.total, self.every = what, 0, total, every
        self._began, self._ended = time.monotonic(), threading.Event()

    def line(self) -> str:
        """How long it has taken, what is done at present, what is left."""
        passed = time.monotonic() - self._began
        if not self.total:
            return f"{passed:.0f} s: {self.what}"
        count = f"{passed:.0f} s: {self.what}, {self.done} of {self.total} done"
        left = passed / self.done * (self.total - self.done) if self.done else None
        return count if left is None else f"{count}, about {left:.0f} s to go"

    def _run(self) -> None:
        while not self._ended.wait(self.every):
            err.print(self.line(), markup=False, soft_wrap=True)

    @contextmanager
    def shown(self) -> Iterator[Lines]:
        """Says its lines until the work ends."""
        thread = threading.Thread(target=self._run, daemon=True)
        thread.start()
        try:
            yield self
        finally:
            self._ended.set()
            thread.join()


@contextmanager
def counted(what: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on standard error for work whose pieces are counted; each call says how many of how many are done. Lines in a pipe."""
    check = CHECK.get()
    if not err.is_terminal:
        with Lines(what).shown() as lines:

            def counted_on(done: int, of: int) -> None:
                check()
                lines.done, lines.total = done, of

            yield counted_on
        return
    count = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    columns = (SpinnerColumn(), TextColumn("{task.description}"), *count)
    with Progress(*columns, console=err, transient=True) as bar:
        task = bar.add_task(what, total=None)

        def told(done: int, of: int) -> None:
            check()
            bar.update(task, completed=done, total=of)

        yield told


@contextmanager
def progress(stages: int | None = None) -> Iterator[Any]:
    """A progress bar on standard error, or a spinner where the number of steps is not known; each call names the next. Lines in a pipe."""
    check = CHECK.get()
    if not err.is_terminal:
        with Lines("reading", stages).shown() as lines:

            def named(what: str) -> None:
                check()
                lines.what, lines.done = what, lines.done + (lines.what != "reading")

            yield named
        return
    bar_column = () if stages is None else (BarColumn(),)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), *bar_column, TimeElapsedColumn())
    with Progress(*columns, console=err, transient=True) as bar:
        task = bar.add_task("reading", total=stages)

        def advance(what: str) -> None:
            check()
            bar.update(task, advance=1, description=what)

        yield advance


def complain(error: CtrlgenError) -> None:
    """The message of an error on standard error."""
    err.print("[bold red]error[/bold red]: ", end="")
    err.print(str(error), markup=False, soft_wrap=True)


def shows_warnings() -> Callable[..., None]:
    """What shows a warning in one line, without its place in our code, which tells a user nothing; each text once, although a model is
    built several times on the way."""
    shown: set[str] = set()

    def show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
        if str(message) not in shown:
            shown.add(str(message))
            err.print(f"[yellow]warning[/yellow]: {escape(str(message))}", soft_wrap=True)

    return show_warning

"""Console output of the commands: tables, progress bars, one message per error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Literal

from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from ctrlgen.core.errors import CtrlgenError
from ctrlgen.core.units import from_si, show

if TYPE_CHECKING:
    from ctrlgen.app import scenario_pipeline as pipeline
    from ctrlgen.app.batch import BatchRow
    from ctrlgen.diagnosis.evidence.bootstrap import Bootstrap
    from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
    from ctrlgen.model.model import Model
    from ctrlgen.recordings.recording import Recording
    from ctrlgen.trajectory.scenario import Scenario
    from ctrlgen.verification.build_record import Build

out = Console(highlight=False, width=None if sys.stdout.isatty() else 110)
err = Console(stderr=True, highlight=False)
Column = tuple[str, Literal["left", "right"]]  # of a table: its heading and how it is aligned
SHOWN_COSTS = ("scenario", "worst", "player")
CHECK: ContextVar[Callable[[], None]] = ContextVar("check", default=lambda: None)  # called before each stage of work


def print_shaper(scenario: Scenario, model: Model) -> None:
    """The mode that a shaped path leaves at rest, and by how much longer it lasts; nothing where it is not shaped."""
    if (used := scenario.shaper(model)) is not None:
        mode = f"{show(used.frequency, 'Hz')}, damping ratio {used.damping_ratio:.3g}"
        out.print(f"shaped by {used.kind} for a mode of {mode}: {show(used.times[-1], 's')} longer", soft_wrap=True)


def print_solution(outcome: pipeline.Outcome) -> None:
    """Title, tracking error, margins and expectations."""
    from ctrlgen.verification.scenario_report import robust_sentence

    solution = outcome.solution
    scenario = solution.scenario
    rate = f"at {1 / scenario.sample_time:g} Hz" if scenario.sample_time else "as equilibria"
    out.print(f"[bold]{escape(scenario.file.title)}[/bold]", soft_wrap=True)
    solved = f"{solution.solver} {solution.iterations} iterations"
    out.print(
        f"{len(solution.command)} samples {rate}, {escape(solution.model.device.title)}, {solved}", soft_wrap=True
    )
    print_shaper(scenario, solution.model)
    if solution.between_samples is not None:
        signal = solution.model.signals[scenario.file.follow]
        error = abs(solution.trace.signals[scenario.file.follow] - solution.command).max(axis=0)
        for channel, unit, at, between in zip(
            signal.channels, signal.units, error, solution.between_samples, strict=True
        ):
            out.print(f"error of {channel}: {show(at, unit)} at the samples, {show(between, unit)} between them")
    if (sentence := robust_sentence(solution)) is not None:
        out.print(sentence, markup=False, soft_wrap=True)
    robust: tuple[Column, ...] = (("reserved", "right"),) if sentence is not None else ()
    table = table_of(
        ("limit", "left"),
        ("closest at", "left"),
        ("value", "right"),
        ("bound", "right"),
        *robust,
        ("range left", "right"),
    )
    for margin in solution.margins:
        unit, tightest = margin.limit.unit, margin is solution.tightest
        share = "" if margin.share is None else f"{100 * margin.share:.1f} %"
        where = f"{margin.channel}, " + (
            f"{solution.trace.time[margin.sample]:.3f} s" if scenario.sample_time else f"sample {margin.sample}"
        )
        reserved = (show(margin.reserve, "K" if unit == "degC" else unit, 3) if margin.reserve else "",) * len(robust)
        bound = show(margin.limit.described(margin.bound), unit)
        row = (margin.limit.label, where, show(margin.value, unit), bound, *reserved, share)
        table.add_row(*row, "<- tightest" if tightest else "", style="bold" if tightest else None)
    show_table(table)
    if outcome.expected:
        good = sum(e.passed for e in outcome.expected)
        out.print(f"expected: {good} of {len(outcome.expected)} values in range")
    for e in outcome.expected:
        if not e.passed:
            measured, low, high = (f"{from_si(v, e.unit):.7g}" for v in (e.measured, e.low, e.high))
            out.print(f"[red]  {e.value} = {measured} {e.unit}, expected {low} ... {high}[/red]")


def print_comparison(outcome: pipeline.Outcome) -> None:
    """One line per arithmetic and comparison."""
    from ctrlgen.verification.scenario_report import worst_rows

    if outcome.comparison is None or outcome.c is None:
        return
    comparison, c = outcome.comparison, outcome.c
    tools = ", ".join(comparison.compilers)
    cost = f"{c.operations} operations a sample, {c.worst_operations} at most"
    out.print(f"[bold]generated C[/bold], built strictly with {tools}; {cost}", soft_wrap=True)
    for missing in comparison.missing:
        out.print(f"[yellow]{missing} is not installed: not run[/yellow]")
    table = table_of(("", "left"), ("", "left"), ("worst", "right"), ("limit", "right"))
    for row in worst_rows(comparison):
        if row["passed"] and row["what"].endswith("CasADi"):
            continue
        unit = "" if row["unit"] == "1" else f" {row['unit']}"
        verdict = (
            "[green]ok[/green]" if row["passed"] else f"[red]OUT from sample {row['first']} ({row['build']})[/red]"
        )
        table.add_row(
            row["real"],
            f"{row['what']}, {row['signal']}",
            f"{row['worst']:.2g}{unit}",
            f"{row['limit']:.2g}{unit}",
            verdict,
        )
    show_table(table)
    good = sum(row.passed for row in comparison.rows)
    out.print(f"{good} of {len(comparison.rows)} comparisons within tolerance")


def print_build(build: Build) -> None:
    """One line per target and one per check, then what failed and what did not run."""
    good = sum(row.passed for row in build.comparison.rows)
    out.print(
        f"{good} of {len(build.comparison.rows)} comparisons within tolerance, {', '.join(build.comparison.compilers)}"
    )
    if build.in_loop.runs:
        columns: tuple[Column, ...] = (
            *((kind, "right") for kind in SHOWN_COSTS),
            ("stack", "right"),
            ("code", "right"),
            ("tables", "right"),
        )
        table = table_of(("instructions a sample", "left"), *columns)
        for run in build.in_loop.runs:
            most = run.instructions
            counts = ("-" if most[kind] is None else str(most[kind]) for kind in SHOWN_COSTS)
            sizes = (f"{size} B" for size in (run.stack, run.code, run.tables))
            verdict = "[green]equal bits[/green]" if run.passed else "[red]FAILED[/red]"
            table.add_row(f"{run.core} {run.real.value}, {run.compiler.split()[0]}", *counts, *sizes, verdict)
        show_table(table)
    colours = {"passed": "green", "failed": "red", "not run": "yellow"}
    table = table_of(("check", "left"), ("", "left"))
    for check in build.checks:
        table.add_row(escape(check.tool), f"[{colours[check.state]}]{check.state}[/{colours[check.state]}]")
    show_table(table)
    for what, remedy in build.not_run:
        out.print(f"not run: {what}: {remedy}", style="yellow", markup=False, soft_wrap=True)
    for line in build.failures:
        out.print(f"failed: {line}", style="red", markup=False, soft_wrap=True)


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
    out.print(table, crop=False)


def print_recording(recording: Recording) -> None:
    """The validated records, with the number of samples marked not valid, and the notes."""
    out.print(f"{recording.title}: {', '.join(recording.channels)}", markup=False, soft_wrap=True)
    table = table_of(("record", "left"), ("role", "left"), ("samples", "right"), ("marked", "right"))
    for record in recording.records:
        marked = int((~record.valid).sum())
        table.add_row(escape(record.name), record.role, str(len(record.time)), f"{marked} of {record.valid.size}")
    show_table(table)
    for note in recording.notes:
        out.print(f"note: {note}", markup=False, soft_wrap=True)


def print_diagnosis(found: Diagnosis) -> None:
    """The verdict, the findings and the held-out errors of a diagnosis."""
    from ctrlgen.diagnosis.report.narrative import (
        gathered,
        hypothesis_name,
        interval,
        next_steps,
        sentence,
        share_text,
    )
    from ctrlgen.diagnosis.report.shares_sentences import shares_sentences
    from ctrlgen.reporting.numbers import number

    out.print(f"[bold]{escape(sentence(found))}[/bold]", soft_wrap=True)
    for line in shares_sentences(found):
        out.print(line, markup=False, soft_wrap=True)
    if found.findings:
        table = table_of(
            ("found", "left"),
            ("at", "left"),
            ("share", "right"),
            ("parameter", "left"),
            ("estimate, 95 % interval", "left"),
        )
        for finding in found.findings:
            rows = [(name, interval(e)) for name, e in finding.parameters.items()]
            alike = ", ".join(map(hypothesis_name, finding.alternatives))
            for k, (name, text) in enumerate(rows):
                first = (finding.effect, finding.location, share_text(finding.share)) if k == 0 else ("",) * 3
                table.add_row(*first, name, text, escape(f"or {alike}") if alike and k == 0 else "")
        show_table(table)
    table = table_of(
        ("held out", "left"), ("before", "right"), ("after", "right"), ("noise", "right"), ("parameters", "right")
    )
    for channel, e in found.held_out.items():
        values = (e.rms_before, e.rms_after, e.noise_floor, e.uncertainty)
        table.add_row(channel, *("not known" if v is None else f"{number(v)} {e.unit}" for v in values))
    show_table(table)
    for note in gathered(found.notes):
        out.print(f"note: {note}", markup=False, soft_wrap=True)
    for step in next_steps(found):
        out.print(f"next: {step}", markup=False, soft_wrap=True)


def print_bootstrap(found: Bootstrap) -> None:
    """The percentile interval of each number, and how often a finding vanished."""
    from ctrlgen.diagnosis.report.narrative import interval

    out.print(f"bootstrap: {found.replicates} replicates; {found.note}", markup=False, soft_wrap=True)
    table = table_of(("number", "left"), ("95 % of the replicates", "left"))
    for path, estimate in found.values.items():
        table.add_row(escape(path), interval(estimate))
    show_table(table)
    for line in found.sentences():
        out.print(line, markup=False, soft_wrap=True)


def print_batch(rows: Sequence[BatchRow]) -> None:
    """One line per diagnosis, then the failures with their reasons."""
    from ctrlgen.reporting.numbers import number

    errors: tuple[Column, ...] = (("before", "right"), ("after", "right"), ("noise", "right"))
    table = table_of(("result", "left"), ("verdict", "left"), ("found", "left"), *errors)
    for row in rows:
        if row.state == "failed":
            table.add_row(escape(row.name), "[red]failed[/red]")
            continue
        known = ["not known" if v is None else f"{number(v)} {row.unit}" for v in (row.before, row.after, row.noise)]
        table.add_row(escape(row.name), row.verdict, escape(row.findings) or "-", *known)
    show_table(table)
    for row in rows:
        if row.error:
            out.print(f"{row.name}: {row.error}", style="red", markup=False, soft_wrap=True)
    made, kept, failed = (sum(row.state == state for row in rows) for state in ("done", "done before", "failed"))
    out.print(f"{made} diagnosed, {kept} there already, {failed} failed")


@contextmanager
def counted(what: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on standard error for work whose pieces are counted; each call says how many of how many are done."""
    check = CHECK.get()
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=err, transient=True) as bar:
        task = bar.add_task(what, total=None)

        def told(done: int, of: int) -> None:
            check()
            bar.update(task, completed=done, total=of)

        yield told


@contextmanager
def progress(stages: int | None = None) -> Iterator[Any]:
    """A progress bar on standard error, or a spinner where the number of steps is not known; each call names the next."""
    check = CHECK.get()
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


def print_workspace(found: pipeline.WorkspaceSummary) -> None:
    """The range of every channel at some poses and anywhere, the largest balls, and the typical sizes they are given in."""
    signal_ = found.workspace.model.signals["pose"]
    named = list(enumerate(zip(signal_.channels, signal_.units, strict=True)))

    def place(pose: Any) -> str:
        shown = (f"{c} {from_si(pose[i], u):.4g} {u}" for i, (c, u) in named if abs(pose[i]) > 1e-3 * signal_.scale[i])
        return ", ".join(shown) or "home"

    table = table_of(("from", "left"), *((place(base), "right") for base in found.bases), ("anywhere", "right"))
    for i, (channel, unit) in named:
        rounding = 1e-9 * signal_.scale[i]
        ends = ([v if abs(v) > rounding else 0.0 for v in r[i]] for r in (*found.ranges, found.extent))
        table.add_row(
            escape(f"{channel} [{unit}]"), *(" ... ".join(f"{from_si(v, unit):.4g}" for v in e) for e in ends)
        )
    show_table(table)
    for what, ball in (("translations", found.translations), ("all channels", found.everything)):
        out.print(
            f"largest ball of {what}: radius {ball.radius:.4g} typical sizes around {place(ball.centre)}",
            soft_wrap=True,
        )
    sizes = ", ".join(f"{show(v, u)}" for v, u in sorted(set(zip(signal_.scale, signal_.units, strict=True))))
    out.print(f"typical sizes: {sizes}")

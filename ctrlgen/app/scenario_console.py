"""Console output of a scenario: its solution, the comparison of its C, everything known of its build; the workspace of its device."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.markup import escape

from ctrlgen.app.console import Column, out, show_table, table_of
from ctrlgen.core.counts import number_of
from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import difference, from_si, show, show_difference

if TYPE_CHECKING:
    from ctrlgen.app.scenario_pipeline import Outcome
    from ctrlgen.app.simulated import Simulated
    from ctrlgen.app.workspace_summary import WorkspaceSummary
    from ctrlgen.trajectory.problem import PathProblem
    from ctrlgen.verification.build_record import Build

SHOWN_COSTS = ("scenario", "worst", "player")


def print_shaper(problem: PathProblem) -> None:
    """The mode that a shaped path leaves at rest, and by how much longer it lasts; nothing where it is not shaped."""
    if (used := problem.shaper) is not None:
        mode = f"{show(used.frequency, 'Hz')}, damping ratio {to_digits(used.damping_ratio, 3)}"
        out.print(f"shaped by {used.kind} for a mode of {mode}: {show(used.times[-1], 's')} longer", soft_wrap=True)


def print_solution(outcome: Outcome) -> None:
    """Title, tracking error, margins and expectations."""
    from ctrlgen.verification.summary import robust_sentence

    solution = outcome.solution
    scenario = solution.scenario
    rate = f"at {1 / scenario.sample_time:g} Hz" if scenario.sample_time else "as equilibria"
    out.print(f"[bold]{escape(scenario.file.title)}[/bold]", soft_wrap=True)
    solved = solution.solved_by
    out.print(
        f"{number_of(len(solution.command), 'sample')} {rate}, {escape(solution.model.device.title)}, {solved}",
        soft_wrap=True,
    )
    print_shaper(scenario.bind(solution.model))
    if scenario.file.pivot is not None:
        place = ", ".join(x.text for x in scenario.file.pivot)
        out.print(f"path about the pivot ({place}), seen from the point of the pose", markup=False, soft_wrap=True)
    if solution.between_samples is not None:
        signal = solution.model.signals[scenario.file.follow]
        error = abs(solution.trace.signals[scenario.file.follow] - solution.command).max(axis=0)
        for channel, unit, at, between in zip(
            signal.channels, signal.units, error, solution.between_samples, strict=True
        ):
            out.print(f"error of {channel}: {show(at, unit)} at the samples, {show(between, unit)} between them")
    for angle in solution.angle_columns:
        low, high = min(angle.values), max(angle.values)
        out.print(f"{angle.name} ({scenario.file.angles}): {low:.6g} ... {high:.6g} {angle.unit}", soft_wrap=True)
    for left_out in solution.left_out:
        out.print(f"[yellow]{escape(left_out)}[/yellow]", soft_wrap=True)
    if sentence := robust_sentence(solution):
        out.print(sentence, markup=False, soft_wrap=True)
    robust: tuple[Column, ...] = (("reserved", "right"),) if sentence else ()
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
        reserved = (show_difference(margin.reserve, unit, 3) if margin.reserve else "",) * len(robust)
        bound = show(margin.limit.described(margin.bound), unit)
        row = (margin.limit.label, where, show(margin.value, unit), bound, *reserved, share)
        table.add_row(*row, "<- tightest" if tightest else "", style="bold" if tightest else None)
    show_table(table)
    if outcome.expected:
        good = sum(e.passed for e in outcome.expected)
        out.print(f"expected: {good} of {number_of(len(outcome.expected), 'value')} in range")
    for e in outcome.expected:
        if not e.passed:
            measured, low, high = (f"{from_si(v, e.unit):.7g}" for v in (e.measured, e.low, e.high))
            out.print(f"[red]  {escape(e.value)} = {measured} {e.unit}, expected {low} ... {high}[/red]")


def print_comparison(outcome: Outcome) -> None:
    """One line per arithmetic and comparison."""
    if outcome.comparison is None or outcome.c is None:
        return
    comparison, c = outcome.comparison, outcome.c
    tools = ", ".join(comparison.compilers)
    cost = f"{c.operations} operations a sample, {c.worst_operations} at most"
    out.print(f"[bold]generated C[/bold], built strictly with {tools}; {cost}", soft_wrap=True)
    for missing in comparison.missing:
        out.print(f"[yellow]{missing} is not installed: not run[/yellow]")
    table = table_of(("", "left"), ("", "left"), ("worst", "right"), ("limit", "right"))
    for row in comparison.worst:
        if row.passed and row.what.is_controller:
            continue
        unit = "" if row.unit == "1" else f" {row.unit}"
        verdict = "[green]ok[/green]" if row.passed else f"[red]OUT from sample {row.first} ({row.build})[/red]"
        numbers = (f"{to_digits(value, 2)}{unit}" for value in (row.worst, row.limit))
        table.add_row(row.build.real.value, f"{row.what}, {row.signal}", *numbers, verdict)
    show_table(table)
    good = sum(row.passed for row in comparison.rows)
    out.print(f"{good} of {number_of(len(comparison.rows), 'comparison')} within tolerance")


def print_build(build: Build) -> None:
    """One line per target and one per check, then what failed and what did not run."""
    good = sum(row.passed for row in build.comparison.rows)
    out.print(
        f"{good} of {number_of(len(build.comparison.rows), 'comparison')} within tolerance, {', '.join(build.comparison.compilers)}"
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
            table.add_row(run.short_name, *counts, *sizes, verdict)
        show_table(table)
    colours = {"passed": "green", "failed": "red", "not run": "yellow"}
    table = table_of(("check", "left"), ("", "left"))
    for check in build.checks:
        table.add_row(escape(check.tool), f"[{colours[check.state]}]{check.state}[/{colours[check.state]}]")
    show_table(table)
    for row in build.not_run:
        out.print(f"not run: {row.what}: {row.remedy}", style="yellow", markup=False, soft_wrap=True)
    for line in build.failures:
        out.print(f"failed: {line}", style="red", markup=False, soft_wrap=True)


def print_workspace(summary: WorkspaceSummary) -> None:
    """The range of every channel at some poses and anywhere, the largest balls, and the typical sizes they are given in."""
    from ctrlgen.trajectory.workspace import ROUNDING

    signal_ = summary.workspace.model.signals["pose"]
    named = list(enumerate(zip(signal_.channels, signal_.units, strict=True)))

    def place(pose: Any) -> str:
        shown = (
            f"{c} {to_digits(from_si(pose[i], u))} {u}" for i, (c, u) in named if abs(pose[i]) > 1e-3 * signal_.scale[i]
        )
        return ", ".join(shown) or "home"

    table = table_of(("from", "left"), *((place(base), "right") for base in summary.bases), ("anywhere", "right"))
    for i, (channel, unit) in named:
        rounding = ROUNDING * signal_.scale[i]
        ends = ([v if abs(v) > rounding else 0.0 for v in r[i]] for r in (*summary.ranges, summary.extent))
        table.add_row(
            escape(f"{channel} [{unit}]"), *(" ... ".join(f"{to_digits(from_si(v, unit))}" for v in e) for e in ends)
        )
    show_table(table)
    for i, (channel, _) in named:
        low, high = summary.bound_by[i]
        limits = low if low == high else f"{low} downward and {high} upward"
        out.print(f"{channel} is limited by {limits}", markup=False, soft_wrap=True)
    if summary.area is not None:
        out.print(summary.shown_area, markup=False)
    for what, ball in summary.balls:
        out.print(f"largest ball of {what}: radius {summary.radius_of(ball)} around {place(ball.centre)}")
    sizes = ", ".join(f"{show(v, u)}" for v, u in sorted(set(zip(signal_.scale, signal_.units, strict=True))))
    out.print(f"typical sizes: {sizes}")


def print_simulated(result: Simulated) -> None:
    """The range of every signal, its last value, and the rms of what was measured less what was simulated."""
    from ctrlgen.reporting.numbers import number

    shown = table_of(
        ("signal", "left"), ("unit", "left"), ("smallest", "right"), ("largest", "right"), ("last", "right")
    )
    for role, signal in result.trace.described.items():
        values = result.trace.signals[role]
        for i, (channel, unit) in enumerate(zip(signal.channels, signal.units, strict=True)):
            ends = (values[:, i].min(), values[:, i].max(), values[-1, i])
            shown.add_row(f"{role}.{channel}", escape(unit), *(number(float(from_si(v, unit))) for v in ends))
    show_table(shown)
    for reading in result.measured:
        role, _, channel = reading.partition(".")
        unit = result.model.signals[role].units[result.model.signals[role].channels.index(channel)]
        error = difference(result.error(reading), unit)
        out.print(f"{reading}: measured less simulated {number(error)} {unit} rms", markup=False, soft_wrap=True)
    for v in result.broken:
        at = to_digits(result.trace.time[v.worst])
        reached = f"{v.limit.channels[v.channel]} reaches {show(v.value[v.worst], v.limit.unit)} at {at} s"
        out.print(
            f"beyond {v.limit.text}: {reached}; there the device file need not hold", markup=False, soft_wrap=True
        )

"""Scenarios and their C: run, solve, generate, compare, verify, fmu. The work is imported by the command that does it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from ctrlgen.app.commands.app import SCENARIO_PANEL, OtherDevice, ScenarioPath, app
from ctrlgen.app.commands.result_folder import note_source, out_of, out_option
from ctrlgen.app.console import out, progress

if TYPE_CHECKING:
    from ctrlgen.app.scenario_pipeline import Outcome
    from ctrlgen.trajectory.scenario import Scenario


@app.command(rich_help_panel=SCENARIO_PANEL)
def run(
    scenario: ScenarioPath,
    out_folder: Annotated[Path | None, out_option("out/NAME")] = None,
    device: OtherDevice = None,
) -> None:
    """Solve a scenario, generate its C, compare the C with the model, and report.

    Leaves in --out: report.html (open this first), summary.json, trajectory.csv, figures/, and c/ with its
    CMake file and test. The exit status is 1 when anything is out of tolerance or unreachable.

    Example:  ctrlgen run scenarios/circle20
    """
    from ctrlgen.app import scenario_pipeline as pipeline

    folder = out_of(out_folder, scenario, device=device)
    asked = _read(scenario, device)
    with progress(pipeline.steps(asked)) as advance:
        outcome = pipeline.run(asked, folder, advance)
    from ctrlgen.app.scenario_console import print_comparison, print_solution

    print_solution(outcome)
    print_comparison(outcome)
    note_source(folder, scenario, device)
    out.print(f"[bold]report[/bold]  {escape(str(folder / 'report.html'))}", soft_wrap=True)
    _exit(outcome)


@app.command(rich_help_panel=SCENARIO_PANEL)
def solve(
    scenario: ScenarioPath,
    out_folder: Annotated[Path | None, out_option("out/NAME_solve")] = None,
    device: OtherDevice = None,
) -> None:
    """Solve a scenario for its drives (IPOPT) and report the margin to every limit; no C.

    Example:  ctrlgen solve scenarios/raster
    """
    from ctrlgen.app import scenario_pipeline as pipeline

    folder = out_of(out_folder, scenario, "solve", device)
    with progress(2) as advance:
        outcome = pipeline.solve_into(_read(scenario, device), folder, advance)
    from ctrlgen.app.scenario_console import print_solution

    print_solution(outcome)
    note_source(folder, scenario, device)
    out.print(f"[bold]report[/bold]  {escape(str(folder / 'report.html'))}", soft_wrap=True)
    _exit(outcome)


@app.command(rich_help_panel=SCENARIO_PANEL)
def generate(
    scenario: ScenarioPath,
    out_folder: Annotated[Path | None, out_option("out/NAME_generate")] = None,
    device: OtherDevice = None,
    player: Annotated[
        bool,
        typer.Option(
            "--player", help="Write only the player of the solved trajectory, which needs no inverse on the target."
        ),
    ] = False,
) -> None:
    """Write the C of a scenario: online controller and player, double and float; needs no compiler.

    Leaves in --out a folder that drops into a firmware project as it is; its README.md says how. Where the online
    controller cannot do what the scenario asks, the error says why; --player then writes the player alone.

    Example:  ctrlgen generate scenarios/circle20 -o out/c && cmake -S out/c -B out/build
    """
    from ctrlgen.app import scenario_pipeline as pipeline

    folder = out_of(out_folder, scenario, "generate", device)
    if player:
        with progress(2) as advance:
            written = pipeline.player_into(_read(scenario, device), folder, advance)
        for path in written:
            out.print(str(path), soft_wrap=True, markup=False)
        _tell(folder, scenario, device)
        return
    with progress(2) as advance:
        c = pipeline.generate_into(_read(scenario, device), folder, advance)
    for name in [*c.online.values(), *c.player.values()]:
        out.print(f"{folder / name}.c", soft_wrap=True, markup=False)
    out.print(f"online controller: {c.operations} arithmetic operations a call, {c.worst_operations} at most")
    _tell(folder, scenario, device)


@app.command(rich_help_panel=SCENARIO_PANEL)
def compare(scenario: ScenarioPath, device: OtherDevice = None) -> None:
    """Generate the C, build it with every compiler present, and compare it with the model; keeps nothing.

    Example:  ctrlgen compare scenarios/circle20
    """
    from ctrlgen.app import scenario_pipeline as pipeline

    asked = _read(scenario, device)
    with progress(pipeline.steps(asked) - 1) as advance:
        outcome = pipeline.compare_only(asked, advance)
    from ctrlgen.app.scenario_console import print_comparison

    print_comparison(outcome)
    _exit(outcome)


@app.command(rich_help_panel=SCENARIO_PANEL)
def verify(
    scenario: ScenarioPath,
    out_folder: Annotated[Path | None, out_option("out/NAME_verify")] = None,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help="Leave out cppcheck and the fuzzer, which take over half of the time; both are then listed as not run.",
        ),
    ] = False,
    device: OtherDevice = None,
) -> None:
    """Check a scenario's C in every way and report on one page: limits, cost on each target, equivalence, rules, origin.

    Solves, generates, compares with every compiler, runs the C on emulated Cortex-M4F, M7, M3, M0+ and RV32IMC and on boards,
    analyses it and calls it with hostile inputs. Leaves in --out: build.html (open this first), build.json (every number), and
    c/. The exit status is 1 when any check failed. A missing tool is no failure: what it would have checked is listed as not run,
    with the command that installs it.

    Example:  ctrlgen verify scenarios/circle20
    """
    from ctrlgen.app import scenario_pipeline as pipeline

    folder = out_of(out_folder, scenario, "verify", device)
    asked = _read(scenario, device)
    with progress(pipeline.verify_steps(asked)) as advance:
        build = pipeline.verify(asked, folder, advance, quick)
    from ctrlgen.app.scenario_console import print_build

    print_build(build)
    note_source(folder, scenario, device)
    out.print(f"[bold]page[/bold]  {escape(str(folder / 'build.html'))}", soft_wrap=True)
    if not build.passed:
        raise typer.Exit(1)


@app.command(rich_help_panel=SCENARIO_PANEL)
def fmu(
    scenario: ScenarioPath,
    out_folder: Annotated[Path | None, out_option("out/NAME_fmu")] = None,
    fmi: Annotated[int, typer.Option(help="Version of the FMI standard, 3 or 2.")] = 3,
    device: OtherDevice = None,
) -> None:
    """Write controller and plant as FMI co-simulation units, for Simulink, Dymola, OpenModelica, FMPy and others.

    The controller takes targets and gives drives; the plant takes drives and gives every signal of the model. Both wrap
    the same C as the firmware, step by whole samples, and contain their sources; binaries are for this computer and need a
    C compiler. In a loop, step the controller first, pass its drives to the plant, then step the plant: a target is the
    value at the end of the step. With start_settled = true both start in equilibrium at their first inputs.

    Example:  ctrlgen fmu scenarios/circle20
    """
    from ctrlgen.app import scenario_pipeline as pipeline

    folder = out_of(out_folder, scenario, "fmu", device)
    made = pipeline.fmus_into(_read(scenario, device), folder, fmi)
    for path in made.paths:
        out.print(str(path), soft_wrap=True, markup=False)
    out.print(f"FMI {fmi}.0, {'binaries for ' + made.binary if made.binary else 'no binaries'}", markup=False)
    if made.remark:
        out.print(made.remark, markup=False, soft_wrap=True)
    _tell(folder, scenario, device)


def _tell(folder: Path, scenario: Path, device: Path | None) -> None:
    note_source(folder, scenario, device)
    out.print(f"[bold]folder[/bold]  {escape(str(folder))}", soft_wrap=True)


def _read(scenario: Path, device: Path | None) -> Scenario:
    """The scenario, with another device where one is named."""
    from ctrlgen.trajectory.scenario import load_scenario

    return load_scenario(scenario, device)


def _exit(outcome: Outcome) -> None:
    if not outcome.passed:
        out.print("[red]out of tolerance[/red]")
        raise typer.Exit(1)

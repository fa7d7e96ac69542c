"""The pipeline of a scenario: solve, generate its C, compare, report. A result folder appears whole or not at all.

What only one of the jobs needs is imported when it is done: all of it takes a tenth of `run`.
"""

from __future__ import annotations

import json
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ctrlgen.budget.budget_section import budget_section
from ctrlgen.budget.robust import solve
from ctrlgen.core.errors import SolverError
from ctrlgen.core.files import whole_folder, write_text
from ctrlgen.core.steps import noted
from ctrlgen.core.tabular import Reported
from ctrlgen.devices import Device
from ctrlgen.firmware.c.toolchains import find_compilers
from ctrlgen.firmware.folder import CFolder, generate
from ctrlgen.firmware.player_only import check_online, generate_player
from ctrlgen.model.assembly import build_model
from ctrlgen.trajectory.frame import Frame
from ctrlgen.trajectory.metrics import ExpectationResult, expectations
from ctrlgen.trajectory.scenario import Scenario, load_scenario, model_of
from ctrlgen.trajectory.solution import Solution
from ctrlgen.trajectory.solution_plots import draw_solution
from ctrlgen.verification.comparison import Comparison, compare
from ctrlgen.verification.reference import ReferenceAnswers
from ctrlgen.verification.scenario_report import write_report
from ctrlgen.verification.summary import passed

if TYPE_CHECKING:
    from ctrlgen.app.workspace_summary import WorkspaceSummary
    from ctrlgen.firmware.fmi.fmu import Fmus
    from ctrlgen.verification.build_record import Build

Progress = Callable[[str], None]
STEPS = 8  # calls of `progress` in `run`: model, solve, C, four builds, report
# in `verify` with every tool installed: also reference, errors, six arithmetics of cores by two compilers, four boards, four analysers, two
# fuzzers, the page
VERIFY_STEPS = 32
# of the controller in integers: two builds; in `verify` also five cores by two compilers and three boards
INTEGER_STEPS, INTEGER_VERIFY_STEPS = 2, 15


@dataclass(frozen=True, repr=False)
class Outcome(Reported):
    """The results of a run; `c` and `comparison` are None where they were not asked for."""

    solution: Solution
    c: CFolder | None
    comparison: Comparison | None
    expected: tuple[ExpectationResult, ...]

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "passed": self.passed,
            "scenario": self.solution.scenario.file.title,
            "C in": "none" if self.c is None else self.c.path,
            "comparisons": 0 if self.comparison is None else len(self.comparison.rows),
            "expectations": f"{sum(e.passed for e in self.expected)} of {len(self.expected)} met",
        }

    @property
    def passed(self) -> bool:
        """Whether every expectation and every comparison that was made is within tolerance."""
        return passed(self.comparison, self.expected)


def quiet(_: str) -> None:
    """Reports no progress."""


def steps(scenario: Scenario) -> int:
    """Calls of `progress` in `run`."""
    return STEPS + INTEGER_STEPS * scenario.file.fixed_point


def verify_steps(scenario: Scenario) -> int:
    """Calls of `progress` in `verify` where every tool is installed."""
    return VERIFY_STEPS + INTEGER_VERIFY_STEPS * scenario.file.fixed_point


def solve_scenario(scenario: Scenario | Path | str, progress: Progress = quiet) -> Solution:
    """Loads and solves a scenario. Raises InputError, Unreachable, SolverError."""
    scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    progress("symbolic model")
    solution = solve(scenario, model_of(scenario), progress)
    if scenario.file.outcome == "unreachable":
        raise SolverError(
            f"{scenario.path}: outcome = 'unreachable', but the path can be followed; remove that line or move the path"
        )
    return solution


def run(scenario: Scenario | Path | str, out: Path | str, progress: Progress = quiet) -> Outcome:
    """Solves, generates, compares and reports into the folder `out`, which is replaced whole or not at all.

    Raises InputError, Unreachable, SolverError, ToolError. A value out of tolerance is no error: `passed` is then False.
    """
    find_compilers()
    scenario = _with_online(scenario)
    with whole_folder(Path(out)) as draft:
        progress = noted(draft, progress)
        solution = solve_scenario(scenario, progress)
        expected = expectations(solution)
        progress("C sources")
        drawn = draw_solution(solution)
        c = generate(solution.scenario, solution.model, draft / "c", solution, drawn)
        comparison = compare(c, solution, lambda build: progress(f"compared: {build}"))
        progress("report")
        write_report(draft, solution, comparison, expected, c, drawn, budget_section(solution))
    return Outcome(solution, replace(c, path=Path(out) / "c"), comparison, expected)


def verify(scenario: Scenario | Path | str, out: Path | str, progress: Progress = quiet, quick: bool = False) -> Build:
    """Solves, generates, compares, runs on emulated targets, analyses, fuzzes; writes one page into the folder `out`.

    Left there: build.html, build.json, c/. `quick` leaves out cppcheck and the fuzzer, which take most of the time; they
    are then listed as not run. Raises InputError, Unreachable, SolverError, ToolError (no C compiler, or one that refuses the
    C); whatever else fails is in `failures` of what is returned, and what did not run in `not_run`.
    """
    from ctrlgen.verification.build_page import write_build
    from ctrlgen.verification.build_record import Build
    from ctrlgen.verification.hostile import check_hostile
    from ctrlgen.verification.in_loop import run_in_loop
    from ctrlgen.verification.qemu import check_on_boards
    from ctrlgen.verification.rules import check_rules
    from ctrlgen.verification.tracking import tracking_errors

    find_compilers()
    scenario = _with_online(scenario)
    with whole_folder(Path(out)) as draft:
        progress = noted(draft, progress)
        solution = solve_scenario(scenario, progress)
        expected = expectations(solution)
        progress("C sources")
        c = generate(solution.scenario, solution.model, draft / "c", solution, draw_solution(solution))
        progress("reference")
        reference = ReferenceAnswers(solution)
        comparison = compare(c, solution, lambda build: progress(f"compared: {build}"), reference, "-O2")
        progress("error along the trajectory")
        errors = tracking_errors(c, reference)
        in_loop = run_in_loop(c, reference, lambda target: progress(f"emulated: {target}"))
        checks = (
            *check_on_boards(c, lambda board: progress(f"board: {board}")),
            *check_rules(c, lambda tool: progress(f"rules: {tool}"), quick=quick),
            *check_hostile(
                c, solution.scenario, solution.model, lambda tool: progress(f"hostile: {tool}"), quick=quick
            ),
        )
        progress("page")
        build = Build(solution, c, expected, comparison, in_loop, checks, errors)
        write_build(draft, build)
        return replace(build, c=replace(c, path=Path(out) / "c"))


def solve_into(scenario: Scenario | Path | str, out: Path | str, progress: Progress = quiet) -> Outcome:
    """Solves and reports into the folder `out`, without C. Raises InputError, Unreachable, SolverError."""
    with whole_folder(Path(out)) as draft:
        progress = noted(draft, progress)
        solution = solve_scenario(scenario, progress)
        expected = expectations(solution)
        progress("report")
        write_report(draft, solution, None, expected, None, draw_solution(solution), budget_section(solution))
        return Outcome(solution, None, None, expected)


def generate_into(scenario: Scenario | Path | str, out: Path | str, progress: Progress = quiet) -> CFolder:
    """Solves and writes only the folder of C, which needs no compiler. Raises InputError, Unreachable, SolverError."""
    scenario = _with_online(scenario)
    with whole_folder(Path(out)) as draft:
        progress = noted(draft, progress)
        solution = solve_scenario(scenario, progress)
        c = generate(solution.scenario, solution.model, draft, solution, draw_solution(solution))
    return replace(c, path=Path(out))


def player_into(scenario: Scenario | Path | str, out: Path | str, progress: Progress = quiet) -> list[Path]:
    """Solves and writes only the player; the paths of its C. Raises InputError, Unreachable, SolverError."""
    with whole_folder(Path(out)) as draft:
        written = generate_player(solve_scenario(scenario, progress), draft)
    return [Path(out) / path.name for path in written]


def fmus_into(scenario: Scenario, out: Path, fmi: int) -> Fmus:
    """Writes controller and plant as FMI units; only of a robust scenario is the path solved, for the controller's limits. Raises as
    `write_fmus` and `solve_scenario`."""
    from ctrlgen.firmware.fmi.fmu import write_fmus

    limited = None if scenario.file.robust is None else solve_scenario(scenario).model
    return write_fmus(scenario, out, fmi, limited)


def _with_online(scenario: Scenario | Path | str) -> Scenario:
    """The scenario, of a device whose drives the online C can compute. Raises InputError before anything is solved."""
    scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    with warnings.catch_warnings():  # solving says them
        warnings.simplefilter("ignore")
        check_online(scenario, model_of(scenario))
    return scenario


def compare_only(scenario: Scenario | Path | str, progress: Progress = quiet) -> Outcome:
    """Solves, generates into a temporary folder and compares; nothing is kept. Raises as `run`."""
    find_compilers()
    scenario = _with_online(scenario)
    with tempfile.TemporaryDirectory(prefix="ctrlgen-") as scratch:
        solution = solve_scenario(scenario, progress)
        progress("C sources")
        c = generate(solution.scenario, solution.model, Path(scratch), solution)
        comparison = compare(c, solution, lambda build: progress(f"compared: {build}"))
    return Outcome(solution, c, comparison, ())


def map_workspace(device: Device, poses: list[str], out: Path) -> WorkspaceSummary:
    """Maps the workspace of a device into the folder `out`: workspace.json, workspace.svg and workspace.html.

    `poses` such as "delta_x=5um,delta_z=20um", channels left out being zero; without any, those of `Workspace.bases`. The
    balls and the extent are searched from the middle one of the list. Raises InputError.
    """
    import matplotlib.pyplot as plt

    from ctrlgen.app.workspace_page import workspace_page
    from ctrlgen.app.workspace_summary import WorkspaceSummary, workspace_numbers
    from ctrlgen.reporting.plots import STYLE, svg
    from ctrlgen.trajectory.workspace import Workspace
    from ctrlgen.trajectory.workspace_plots import draw_workspace

    model = build_model(device)
    workspace, signal = Workspace(model), model.signals["pose"]
    frame = Frame(signal.channels, signal.units)
    bases = [frame.pose(pose, "--at") for pose in poses] or workspace.bases()
    ranges = [workspace.ranges(base) for base in bases]
    middle = bases[len(bases) // 2]
    balls = workspace.ball(middle, workspace.leading), workspace.ball(middle, tuple(range(len(signal.channels))))
    drawn = workspace.drawn
    area = workspace.area(middle, *drawn[:2]) if len(drawn) > 1 else None
    summary = WorkspaceSummary(
        workspace, bases, ranges, workspace.extent(middle), *balls, workspace.bound_by(middle), area
    )
    with whole_folder(out) as draft:
        with plt.rc_context(STYLE):
            picture = svg(draw_workspace(workspace, bases, balls[0]))
        write_text(draft / "workspace.svg", picture)
        write_text(draft / "workspace.json", json.dumps(workspace_numbers(summary), indent=1) + "\n")
        write_text(draft / "workspace.html", workspace_page(summary, picture))
    return summary

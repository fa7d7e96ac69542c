"""The whole job: solve a scenario, generate its C, compare, report; nothing appears unless all of it is there."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ctrlgen import report
from ctrlgen.comparison import Comparison, compare, find_compilers
from ctrlgen.files import whole_folder
from ctrlgen.firmware import CFolder, generate
from ctrlgen.measures import Expected, expectations
from ctrlgen.model import build_model
from ctrlgen.scenario import Scenario, load_scenario
from ctrlgen.solution import Solution, solve

Progress = Callable[[str], None]
STAGES = 8  # calls of `progress` in `run`: model, solve, C, four builds, report


@dataclass(frozen=True)
class Outcome:
    """What a run produced; `c` and `comparison` are None where they were not asked for."""

    solution: Solution
    c: CFolder | None
    comparison: Comparison | None
    expected: tuple[Expected, ...]

    @property
    def passed(self) -> bool:
        """Whether everything that was checked is within tolerance."""
        return report.passed(self.comparison, self.expected)


def quiet(_: str) -> None:
    """No progress."""


def solve_scenario(scenario: Scenario | Path | str, progress: Progress = quiet) -> Solution:
    """Loads and solves. Raises InputError, Unreachable, SolverError."""
    scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    progress("symbolic model")
    return solve(scenario, build_model(scenario.device), progress)


def run(scenario: Scenario | Path | str, out: Path | str, progress: Progress = quiet) -> Outcome:
    """Solve, generate, compare, report into the folder `out`, which is replaced whole or left alone.

    Raises InputError, Unreachable, SolverError, ToolError; out of tolerance is not an error but `passed` False.
    """
    find_compilers()
    with whole_folder(Path(out)) as draft:
        solution = solve_scenario(scenario, progress)
        expected = expectations(solution)
        progress("C sources")
        c = generate(solution.scenario, solution.model, draft / "c", solution)
        comparison = compare(c, solution, lambda build: progress(f"compared: {build}"))
        progress("report")
        report.write_report(draft, solution, comparison, expected, c)
        return Outcome(solution, c, comparison, expected)


def solve_into(scenario: Scenario | Path | str, out: Path | str, progress: Progress = quiet) -> Outcome:
    """Solve and report into `out`, without C."""
    with whole_folder(Path(out)) as draft:
        solution = solve_scenario(scenario, progress)
        expected = expectations(solution)
        report.write_report(draft, solution, None, expected, None)
        return Outcome(solution, None, None, expected)


def generate_into(scenario: Scenario | Path | str, out: Path | str, progress: Progress = quiet) -> CFolder:
    """Solve and write only the C folder, which needs no compiler."""
    with whole_folder(Path(out)) as draft:
        solution = solve_scenario(scenario, progress)
        c = generate(solution.scenario, solution.model, draft, solution)
    return CFolder(Path(out), c.online, c.player, c.operations, c.worst_operations)


def compare_only(scenario: Scenario | Path | str, progress: Progress = quiet) -> Outcome:
    """Solve, generate into a scratch folder, compare; nothing is kept."""
    find_compilers()
    with tempfile.TemporaryDirectory(prefix="ctrlgen-") as scratch:
        solution = solve_scenario(scenario, progress)
        progress("C sources")
        c = generate(solution.scenario, solution.model, Path(scratch), solution)
        comparison = compare(c, solution, lambda build: progress(f"compared: {build}"))
    return Outcome(solution, c, comparison, ())

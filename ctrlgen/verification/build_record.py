"""Everything that is known of one build, for build.json: what was generated, compared, run, checked, and what was not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PlainSerializer

from ctrlgen.core.shown import Shown
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder
from ctrlgen.firmware.player.compression import INSTRUCTION_BUDGET
from ctrlgen.reporting.result_file import Keys
from ctrlgen.trajectory.metrics import ExpectationResult
from ctrlgen.trajectory.solution import Solution
from ctrlgen.verification.c_interface import Interface, interface
from ctrlgen.verification.check import Check, CheckState, ToolFinding
from ctrlgen.verification.comparison import Comparison
from ctrlgen.verification.emulated_target import NotRun, StoppedTarget, Target
from ctrlgen.verification.hostile import SEED
from ctrlgen.verification.in_loop import InLoop
from ctrlgen.verification.summary import Summary, by_channel, passed, summary_keys
from ctrlgen.verification.tracking import Piece

BUDGET_CORE, BUDGET_DRIVES = "Cortex-M4F", 6  # the core and the number of drives that the budgets are stated for
# instructions of one sample; goals, not conditions
BUDGETS = {"scenario": 700, "worst": 6000, "player": INSTRUCTION_BUDGET}


class Budgets(Keys):
    """Instructions of one sample that are aimed at."""

    core: str = Field(description="Processor for which they are stated.")
    scenario: int = Field(description="Along the scenario.")
    worst: int = Field(description="Over random and hostile targets.")
    player: int = Field(description="One call of the player.")


class ToolCheck(Keys):
    """One tool that read or ran the generated C."""

    tool: str = Field(description="Name of the tool.")
    version: str = Field(description="Its version; empty where it is not known.")
    state: Annotated[CheckState, PlainSerializer(str, return_type=Literal["passed", "failed", "not run"])] = Field(
        title="State", description="Its outcome."
    )
    note: str = Field(description="Remark, or the remedy where it did not run.")
    files: list[str] = Field(description="Files that it was given.")
    permitted: int = Field(description="Findings that DEVIATIONS.md permits.")
    findings: tuple[ToolFinding, ...] = Field(description="Findings that it does not permit.")


class BuildRecord(Summary):
    """Result of `ctrlgen verify`: everything of summary.json, and every check of the generated C."""

    failures: tuple[str, ...] = Field(description="What failed, one line each.")
    not_run: tuple[NotRun, ...] = Field(description="Checks that did not run.")
    interface: Interface = Field(description="What the generated C takes and gives.")
    budgets: Budgets | None = Field(description="Null for devices for which no budget is stated.")
    errors_along_the_trajectory: list[dict[str, str | float]] = Field(
        description="Largest error of the model driven by the C, by 'channel [unit]', with the keys c (online C or player C) and real."
    )
    targets: tuple[Target, ...] = Field(description="The C on emulated processors.")
    stopped: tuple[StoppedTarget, ...] = Field(description="Emulated runs that stopped early.")
    checks: list[ToolCheck] = Field(description="Analysers and tests of the generated C.")


@dataclass(frozen=True, repr=False)
class Build(Shown):
    """One generated package with the results of every check.

    `errors` along the trajectory are those of `ctrlgen.verification.tracking.tracking_errors`: online C, player C ->
    arithmetic -> (samples, channels) in SI.
    """

    solution: Solution
    c: CFolder
    expected: tuple[ExpectationResult, ...]
    comparison: Comparison
    in_loop: InLoop
    checks: tuple[Check, ...]
    errors: Mapping[Piece, Mapping[Real, np.ndarray]]

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "C in": self.c.path,
            "failures": len(self.failures),
            "comparisons": len(self.comparison.rows),
            "checks": len(self.checks),
        }

    @property
    def failures(self) -> tuple[str, ...]:
        """A line for each failure; empty where everything that ran passed."""
        rows = [f"expected {e.value} is out of range" for e in self.expected if not e.passed]
        rows += [
            f"{row.build}: {row.what}, {row.signal}, is out of tolerance"
            for row in self.comparison.rows
            if not row.passed
        ]
        rows += [f"{run.name}: {run.fault}" for run in self.in_loop.runs if run.fault]
        rows += [f"{run.name}: {run.words}" for run in self.in_loop.stopped]
        rows += [f"{c.tool}: {_first_finding(c)}" for c in self.checks if c.state is CheckState.FAILED]
        return tuple(rows)

    @property
    def not_run(self) -> tuple[NotRun, ...]:
        """Everything that did not run, with why or how to make it run."""
        compilers = (NotRun(what=c, remedy=f"missing; apt-get install {c}") for c in self.comparison.missing)
        checks = (NotRun(what=c.tool, remedy=c.note) for c in self.checks if c.state is CheckState.NOT_RUN)
        return (*compilers, *self.in_loop.not_run, *checks)

    @property
    def passed(self) -> bool:
        """Whether everything that ran passed; what did not run counts as neither."""
        return passed(self.comparison, self.expected) and not self.failures

    @property
    def budgeted(self) -> bool:
        """Whether the budgets apply: the device has as many drives and is driven sample by sample."""
        return len(self.solution.model.axes) == BUDGET_DRIVES and self.solution.scenario.sample_time is not None


def _first_finding(check: Check) -> str:
    count = len(check.refused)
    return f"{count} finding{'s' * (count != 1)}, first {check.refused[0]}"


def record(build: Build) -> BuildRecord:
    """What build.json holds: summary.json's numbers and all that follow from the C; the same for the same input and tools."""
    changed = {"seed": SEED, "passed": build.passed}
    return BuildRecord(
        **(summary_keys(build.solution, build.comparison, build.expected, build.c) | changed),
        failures=build.failures,
        not_run=build.not_run,
        interface=interface(build.solution, build.c),
        budgets=Budgets(core=BUDGET_CORE, **BUDGETS) if build.budgeted else None,
        errors_along_the_trajectory=[
            {"c": piece.value, "real": real.value, **_worst(build, off)}
            for piece, by_real in build.errors.items()
            for real, off in by_real.items()
        ],
        targets=build.in_loop.runs,
        stopped=build.in_loop.stopped,
        checks=[_check(check) for check in build.checks],
    )


def _worst(build: Build, off: np.ndarray) -> dict[str, float]:
    """'delta_x [um]' -> the largest error of that channel."""
    signal = build.solution.model.signals[build.solution.scenario.file.follow]
    return by_channel(signal, np.abs(off).max(axis=0))


def _check(check: Check) -> ToolCheck:
    return ToolCheck(
        tool=check.tool,
        version=check.version,
        state=check.state,
        note=check.note,
        files=[name for name, _ in check.subjects],
        permitted=sum(f.permitted for f in check.findings),
        findings=check.refused,
    )

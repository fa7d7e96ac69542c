"""Everything that is known of one build, for build.json: what was generated, compared, run, checked, and what was not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ctrlgen.controller.feedforward import ControllerStatus
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.core.units import base_unit, from_si, show
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder
from ctrlgen.firmware.player.compression import INSTRUCTION_BUDGET
from ctrlgen.trajectory.metrics import ExpectationResult
from ctrlgen.trajectory.solution import Solution
from ctrlgen.verification.check import Check
from ctrlgen.verification.comparison import Comparison
from ctrlgen.verification.hostile import SEED
from ctrlgen.verification.in_loop import InLoop, Stopped, TargetRun
from ctrlgen.verification.scenario_report import passed, summary

BUDGET_CORE, BUDGET_DRIVES = "Cortex-M4F", 6  # the core and the number of drives that the budgets are stated for
# instructions of one sample; goals, not conditions
BUDGETS = {"scenario": 700, "worst": 6000, "player": INSTRUCTION_BUDGET}
STATUS_WORDS = {
    ControllerStatus.DISPLACEMENT: "displacement beyond its range: the nearest target inside was taken",
    ControllerStatus.COMPOSITE: "a limit of several channels, such as a stress: displacement scaled toward home",
    ControllerStatus.STATE: "actuator state set to its limit",
    ControllerStatus.DRIVE: "drive at its limit: as far toward the target as it reaches in one sample",
    ControllerStatus.INPUT: "target is no number, or absurd: safe drives",
    ControllerStatus.LOST: "state is no number, absurd, or was not initialised: safe drives until it is",
    ControllerStatus.RATE: "drives change as fast as they may: the target is reached later",
}


@dataclass(frozen=True)
class Build:
    """One generated package with the results of every check.

    `errors` along the trajectory are those of `ctrlgen.verification.tracking.tracking_errors`: 'online C', 'player C' ->
    arithmetic -> (samples, channels) in SI.
    """

    solution: Solution
    c: CFolder
    expected: tuple[ExpectationResult, ...]
    comparison: Comparison
    in_loop: InLoop
    checks: tuple[Check, ...]
    errors: Mapping[str, Mapping[Real, np.ndarray]]

    @property
    def failures(self) -> tuple[str, ...]:
        """A line for each failure; empty where everything that ran passed."""
        rows = [f"expected {e.value} is out of range" for e in self.expected if not e.passed]
        rows += [
            f"{row.build}: {row.what}, {row.signal}, is out of tolerance"
            for row in self.comparison.rows
            if not row.passed
        ]
        rows += [f"{run_name(run)}: {fault}" for run in self.in_loop.runs if (fault := run_fault(run))]
        rows += [f"{run_name(run)}: {run.words}" for run in self.in_loop.stopped]
        rows += [f"{c.tool}: {_first_finding(c)}" for c in self.checks if c.state == "failed"]
        return tuple(rows)

    @property
    def not_run(self) -> tuple[tuple[str, str], ...]:
        """(what, why or how to make it run) of everything that did not run."""
        compilers = [(name, f"missing; apt-get install {name}") for name in self.comparison.missing]
        checks = [(c.tool, c.note) for c in self.checks if c.state == "not run"]
        return (*compilers, *self.in_loop.not_run, *checks)

    @property
    def passed(self) -> bool:
        """Whether everything that ran passed; what did not run counts as neither."""
        return passed(self.comparison, self.expected) and not self.failures

    @property
    def budgeted(self) -> bool:
        """Whether the budgets apply: the device has as many drives and is driven sample by sample."""
        return len(self.solution.model.axes) == BUDGET_DRIVES and self.solution.scenario.sample_time is not None


def run_name(run: TargetRun | Stopped) -> str:
    """'Cortex-M4F, zig 0.13.0, float'."""
    return f"{run.core}, {run.compiler}, {run.real.value}"


def run_fault(run: TargetRun) -> str:
    """What is wrong with a run; empty where nothing is."""
    faults = []
    if run.differing:
        faults.append(
            f"{run.differing} of {run.numbers} numbers differ from this computer's by up to {run.ulp} units in the last "
            f"place, first in {run.where}"
        )
    if run.writable:
        faults.append(f"{run.writable} bytes of static writable memory, where none is promised")
    return "; ".join(faults)


def _first_finding(check: Check) -> str:
    found = [f for f in check.findings if not f.permitted]
    return f"{len(found)} finding{'s' * (len(found) != 1)}, first {found[0]}"


def record(build: Build) -> dict[str, Any]:
    """What build.json holds: summary.json's numbers and every one found since; the same for the same input and tools."""
    solution, c = build.solution, build.c
    return {
        **summary(solution, build.comparison, build.expected, c),
        "seed": SEED,
        "passed": build.passed,
        "failures": list(build.failures),
        "not_run": [{"what": what, "remedy": remedy} for what, remedy in build.not_run],
        "interface": interface(build),
        "budgets": {"core": BUDGET_CORE, **BUDGETS} if build.budgeted else None,
        "errors_along_the_trajectory": [
            {"c": what, "real": real.value, **_worst(build, off)} for what, by_real in build.errors.items() for real, off in by_real.items()
        ],
        "targets": [_target(run) for run in build.in_loop.runs],
        "stopped": [{**vars(run), "real": run.real.value} for run in build.in_loop.stopped],
        "checks": [_check(check) for check in build.checks],
    }  # fmt: skip


def interface(build: Build) -> dict[str, Any]:
    """The arguments and results of the C, in SI, and the values that its status can have."""
    model, scenario = build.solution.model, build.solution.scenario
    controller = controller_of(model, scenario.file.follow, scenario.sample_time)
    m = controller.kernels.nominal
    follow, drive, state = controller.kernels.target, m.signals["drive"], m.signals.get("state")

    def channels(signal: Any) -> list[str]:
        return [f"{c} [{base_unit(u)}]" for c, u in zip(signal.channels, signal.units, strict=True)]

    possible = [
        s for s in ControllerStatus
        if not (s is ControllerStatus.COMPOSITE and not controller.kernels.guarded_limits)
        and not (s is ControllerStatus.STATE and not controller.state_can_be_limited)
        and not (s is ControllerStatus.RATE and controller.rate is None)
    ]  # fmt: skip
    return {
        "functions": {real.value: _functions(build, build.c.online[real], build.c.player.get(real)) for real in build.c.online},
        "target": {"label": follow.label, "channels": channels(follow)},
        "drive": {"label": drive.label, "channels": channels(drive)},
        "actuator_state": None if state is None else {"label": state.label, "channels": channels(state)},
        "memory": [
            *(f"{n} [{u}]" for n, u in zip(m.x_names, m.x_units, strict=True)), *(f"displacement {a} [m]" for a in m.axes),
            *([] if controller.rate is None else [f"last {c}" for c in channels(drive)]),
        ],
        "status": [{"value": int(s), "name": s.name, "meaning": STATUS_WORDS[s]} for s in possible],
        "limits": [
            {
                "label": limit.label,
                "lower": None if limit.lower is None else show(limit.lower, limit.unit),
                "upper": None if limit.upper is None else show(limit.upper, limit.unit),
            }
            for limit in model.limits
        ],
    }  # fmt: skip


def _functions(build: Build, online: str, player: str | None) -> list[str]:
    stepped = [f"{online}_step(state, target, out)"] if build.solution.scenario.sample_time else []
    played = [f"{player}_sample(index, drive)", f"{player}_at(time, drive)"] if player else []
    return [f"{online}_init(state)", f"{online}_settle(state, target, out)", *stepped, *played]


def _target(run: TargetRun) -> dict[str, Any]:
    return {
        **vars(run), "real": run.real.value, "costs": [vars(cost) for cost in run.costs], "passed": run.passed,
        "instructions": run.instructions,
    }  # fmt: skip


def _worst(build: Build, off: np.ndarray) -> dict[str, float]:
    """'delta_x [um]' -> the largest error of that channel."""
    signal = build.solution.model.signals[build.solution.scenario.file.follow]
    return {
        f"{c} [{u}]": float(from_si(np.abs(off[:, i]).max(), u))
        for i, (c, u) in enumerate(zip(signal.channels, signal.units, strict=True))
    }


def _check(check: Check) -> dict[str, Any]:
    return {
        "tool": check.tool, "version": check.version, "state": check.state, "note": check.note,
        "files": [name for name, _ in check.subjects],
        "permitted": sum(f.permitted for f in check.findings),
        "findings": [vars(f) for f in check.findings if not f.permitted],
    }  # fmt: skip

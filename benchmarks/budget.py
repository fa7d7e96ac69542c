"""The error budget of the circle with 10^4 draws, against plain Monte Carlo through the simulator; the whole process."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.job import PEER
from benchmarks.measure import Line, Note, interleave, timed
from benchmarks.samples import SCENARIO, Disagreement
from ctrlgen.budget.error_budget import DRAWS, ErrorBudget, budget_of
from ctrlgen.budget.robust import solve
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.budget.uncertainty import load_uncertainties
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.model.assembly import build_model
from ctrlgen.model.simulation import simulate
from ctrlgen.trajectory.scenario import load_scenario

SIMULATED = 4  # draws of the peer in a round
NEAR = 1e-3  # of the largest deviation that a number makes: what two answers may differ by; a step of a draw is allowed as much
AIM = 10.0  # s


def run(repeat: int) -> list[Line | Note]:
    """Seconds per draw, the sensitivities and all tables of ours included; and wall time of the process with its report."""
    scenario = load_scenario(SCENARIO)
    model = build_model(scenario.device)
    solution, stated = solve(scenario, model), load_uncertainties(scenario, model)
    numbers = {path: number.si for path, number in scenario.device.quantities()}
    path = UncertainPath(solution, stated)
    names = [name for line in stated.lines for name in line.paths]
    own = [i for i, name in enumerate(names) if name in path.moving][:SIMULATED]

    def simulated(values: dict[str, float]) -> np.ndarray:
        """(n, channels) the pose of the device with other numbers, as a plain simulation draws it."""
        start = path.start[: model.x.numel()], path.start[model.x.numel() :]
        device = build_model(changed(scenario.device, values))
        trace = simulate(device, path.drive, path.sample_time, *start)
        return trace.signals[scenario.file.follow][path.before + 1 :]

    def peer() -> None:
        for i in own:
            simulated({names[i]: numbers[names[i]] + stated.sds[i]})

    found = budget_of(solution, stated)
    nominal = simulated({})
    for i in own:
        _check(found, i, simulated({names[i]: numbers[names[i]] + stated.sds[i]}) - nominal, names[i])
    seconds = interleave(
        {"ours": timed(lambda: budget_of(solution, stated), DRAWS), "peer": timed(peer, len(own))}, repeat
    )
    whole = _processes(repeat)
    return [
        Line("error budget of the circle, per draw", seconds["ours"], "ctrlgen simulate", seconds["peer"]),
        Line("ctrlgen budget circle20", whole["ours"], f"python -c '{PEER}'", whole["peer"], AIM),
    ]


def _check(found: ErrorBudget, column: int, deviation: np.ndarray, name: str) -> None:
    """Raises Disagreement where the deviations (n, channels) that a simulation gives are not those of the budget's draws."""
    drawn = found.drawn
    if drawn is None:
        raise Disagreement("the budget has no draws")
    own = drawn.alone[0, column]
    off = np.abs(deviation[drawn.kept] - own).max(axis=0)
    if np.any(off > NEAR * np.abs(found.combined).max(axis=0)):
        raise Disagreement(f"{name} changed by its standard deviation: draw and simulation differ by {off} [SI]")


def _processes(repeat: int) -> dict[str, list[float]]:
    with tempfile.TemporaryDirectory(prefix="ctrlgen-bench-") as scratch:
        out = str(Path(scratch) / "out")
        commands = {
            "ours": [sys.executable, "-m", "ctrlgen", "budget", str(SCENARIO), "--out", out],
            "peer": [sys.executable, "-c", PEER],
        }

        def process(name: str) -> None:
            done = subprocess.run(commands[name], capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise Disagreement(f"{' '.join(commands[name])} ended with {done.returncode}:\n{done.stderr[-2000:]}")

        for name in commands:
            process(name)
        return interleave({name: timed(lambda name=name: process(name)) for name in commands}, repeat)

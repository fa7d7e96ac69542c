"""The solution of a scenario. Limits that are to hold for what is not known exactly are reduced to limits of the device as described.

The reduction leaves a scenario whose path is moved to where its limits hold best, and of more drives than axes those of the smallest
expected error; the solution of that is then judged (`ctrlgen.budget.chance_constraint`), and the limits of its model are tightened by
what was reserved. The idea of reductions: A. Agrawal, R. Verschueren, S. Diamond, S. Boyd, J. Control Decis. 5 (2018) 42.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from ctrlgen.budget.chance_constraint import ChanceConstraint
from ctrlgen.budget.judged_path import JudgedPath
from ctrlgen.budget.least_error_drives import of_least_error
from ctrlgen.budget.moved_path import MovablePath, shown_home
from ctrlgen.budget.uncertainty import Uncertainties, load_uncertainties
from ctrlgen.budget.unkept_limits import not_kept
from ctrlgen.core.errors import Unreachable
from ctrlgen.devices import Signal
from ctrlgen.model.model import Model
from ctrlgen.trajectory.nominal import solve_nominal
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.trajectory.scenario_file import Robust
from ctrlgen.trajectory.solution import Solution, judged_by

Progress = Callable[[str], None]


def solve(scenario: Scenario, model: Model, progress: Progress = lambda _: None) -> Solution:
    """The drives that follow `scenario`, with limits that hold at the probability that it asks for, where it does.

    The model of a robust solution has limits tightened by what was reserved (`Limit.reserve`), and its scenario the place to which the
    path was moved (`Scenario.home`). Where more drives than axes push, those of the smallest expected error are taken. `progress` is
    called before each step. Raises Unreachable where the path cannot be followed, or not at that probability; SolverError where no
    drives are found; InputError for a device that cannot be inverted, a path that is not smooth enough for one with inertia, or a closed
    path of one that changes with time.
    """
    robust = scenario.file.robust
    if robust is None or model.probability is not None:
        return solve_nominal(scenario, model, progress)
    stated = load_uncertainties(scenario, model)
    nominal, model = _reduced(scenario, model, robust, stated, progress)
    begin = _begin(model.signals[nominal.file.follow], nominal.home)
    try:
        solution = solve_nominal(nominal, model, progress)
    except Unreachable as error:
        raise Unreachable(f"{begin}{error}", error.infeasibility) from None
    progress("what is uncertain along the path")
    judged = JudgedPath.of(solution, stated)
    chance = ChanceConstraint(judged.margins, robust.chance)
    if not chance.holds:
        raise not_kept(solution, judged, chance, robust.probability, begin)
    restored = replace(scenario, home=nominal.home, inputs={**scenario.inputs, **stated.inputs})
    return judged_by(solution, restored, model.tightened(judged.kept(chance.reserve, model), robust.chance))


def _reduced(
    scenario: Scenario, model: Model, robust: Robust, stated: Uncertainties, progress: Progress
) -> tuple[Scenario, Model]:
    """The scenario without its request, where it may be moved at the place with the smallest expected error, and the model with the
    drives of the smallest."""
    nominal = replace(scenario, file=scenario.file.model_copy(update={"robust": None}))
    if model.redundant:
        model = of_least_error(model, stated, scenario.file.follow)
    if robust.home:
        nominal = replace(nominal, home=MovablePath(nominal, model, robust, stated, progress).best())
    return nominal, model


def _begin(signal: Signal, home: Mapping[str, float]) -> str:
    """How a message about a path begins that may be moved."""
    return f"moved by {shown_home(signal, home)}, the best place that was found: " if home else ""

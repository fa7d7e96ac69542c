"""The error budget in the report of a solution: first order only, so that it costs little beside the solution."""

from __future__ import annotations

from dataclasses import dataclass

from ctrlgen.budget.budget_record import BudgetRecord, budget_record, safety_sentence
from ctrlgen.budget.error_budget import ErrorBudget, budget_of
from ctrlgen.budget.uncertainty import FILE, load_uncertainties
from ctrlgen.core.errors import InputError, SolverError
from ctrlgen.trajectory.solution import Solution

MOST_SAMPLES = 20_000  # of a path whose budget takes a few seconds


@dataclass(frozen=True)
class BudgetSection:
    """What the report says of uncertainty: the `budget`, or the sentence why there is none, `missing`."""

    budget: ErrorBudget | None
    missing: str

    @property
    def record(self) -> BudgetRecord | None:
        """What budget.json would hold; None where no budget is drawn up."""
        return None if self.budget is None else budget_record(self.budget)

    @property
    def sentences(self) -> list[tuple[str, bool]]:
        """What is said of each limit, and whether it is kept."""
        b = self.budget
        return [] if b is None else [(safety_sentence(s, b.probability), s.kept >= 0) for s in b.safeties]

    @property
    def sources(self) -> dict[str, str]:
        """SHA-256 of the files that state what is uncertain, by name."""
        return {} if self.budget is None else {n: read.sha256 for n, read in self.budget.uncertainties.inputs.items()}


def budget_section(solution: Solution) -> BudgetSection | None:
    """To first order (GUM 5) what is stated to be uncertain does to the path; None where nothing is stated, neither by a file beside
    the scenario nor by an sd in the device file. Raises nothing: a report does not fail for its budget."""
    scenario, device = solution.scenario, solution.model.device
    if not (scenario.path.parent / FILE).is_file() and not any(number.sd for _, number in device.quantities()):
        return None
    if (n := len(solution.command)) > MOST_SAMPLES:
        return BudgetSection(None, f"not drawn up here, for a path of {n} samples takes long")
    try:
        stated = load_uncertainties(scenario, solution.model)
        return BudgetSection(budget_of(solution, stated, draws=0), "")
    except InputError as error:
        return BudgetSection(None, f"not drawn up: {error.source}: {'; '.join(map(str, error.faults))}")
    except SolverError as error:
        return BudgetSection(None, f"not drawn up: {error}")

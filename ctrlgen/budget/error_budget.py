"""The error budget of a solved path, as precision engineers draw it up (Slocum): every contributor, their combination, their order.

The drives are those computed for the device as described; what acts on them is a device with other numbers, in other surroundings,
through a converter. To first order by the law of propagation of uncertainty (GUM, JCGM 100), and by Monte Carlo on the
nonlinear model (GUM supplement 1, JCGM 101).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy

from ctrlgen.budget.contributors import BudgetLine, Group, budget_lines, groups_of, largest, rms
from ctrlgen.budget.finer_model import FinerModel, ModelDifference, difference_to, load_finer
from ctrlgen.budget.limits import DrawnLimits, Safety, critical_samples, margins, safeties, slopes_of_limits
from ctrlgen.budget.linear import Propagated, propagate
from ctrlgen.budget.monte_carlo import Drawn, draw
from ctrlgen.budget.robust import solve
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.budget.uncertainty import Uncertainties, load_uncertainties
from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError, SolverError
from ctrlgen.core.tabular import Column, Reported, Tabular
from ctrlgen.devices import Device
from ctrlgen.devices.quantities import shared_path
from ctrlgen.trajectory.scenario import Scenario, load_scenario, model_of
from ctrlgen.trajectory.solution import Solution

DRAWS = 10_000  # ends of a 95 % interval to 1.4 %; JCGM 101 7.2 would have 10^4/(1 - p) = 200,000
FEWEST_DRAWS = 200  # the sd of as many draws is itself known to 5 %
MOST_DRAWS = 1_000_000
PROBABILITY = 0.999
COVERAGE = 0.95
# Share of draws whose pose or limited quantities may be not finite, as those of a device beyond buckling
MOST_LOST = 0.01
KEPT = 60  # samples along the path at which draws are kept
TOLERANCE = 0.10  # of the first-order result, within which the draws confirm it
COMPARED = 0.5  # of the largest uncertainty along the path: smaller ones are not compared
OUTLYING = 10.0  # standard uncertainties: no draw of a million of a path that is nearly linear lies so far off


@dataclass(frozen=True)
class Agreement:
    """First order against the draws for one group, SI: largest combined standard uncertainty by both, largest relative difference
    along the path of the standard deviation and of the half width of the 95 % interval, and the largest mean of the draws; how many draws
    are `outlying`, and the numbers that have `turned` their sign in all of these."""

    group: Group
    linear: float
    drawn: float
    difference: float
    difference_of_interval: float
    mean: float
    outlying: int
    turned: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether standard deviation and interval agree within `TOLERANCE`."""
        return max(self.difference, self.difference_of_interval) <= TOLERANCE


@dataclass(frozen=True, repr=False)
class ErrorBudget(Tabular, Reported):
    """The error budget of a path. `combined` (n, channels) is the standard uncertainty u_c of the followed signal [SI], `lines` come in
    the order of what to measure or tighten next; `safeties` of the limits at `probability`. Without draws `drawn` is None, without a finer
    model `model_difference`."""

    solution: Solution
    uncertainties: Uncertainties
    groups: tuple[Group, ...]
    lines: tuple[BudgetLine, ...]
    combined: np.ndarray
    linear: Propagated
    drawn: Drawn | None
    agreements: tuple[Agreement, ...]
    safeties: tuple[Safety, ...]
    probability: float
    draws: int
    seed: int
    model_difference: ModelDifference | None = None

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "scenario": self.solution.scenario.file.title,
            "largest standard uncertainty": ", ".join(
                f"{g.name} {g.shown(self.peak(g)):.3g} {g.unit}" for g in self.groups
            ),
            "first to measure": self.lines[0].name if self.lines else "nothing",
            "draws": self.draws,
        }

    def columns(self) -> tuple[Column, ...]:
        """The contributors, what to measure or tighten first before the others: standard uncertainty of the path by each, and how much of
        the variance is gone without it."""
        lines = self.lines
        by_group = (
            Column(f"{what} {g.name}", g.unit, [g.shown(getattr(line, what)[g.name]) for line in lines])
            for g in self.groups
            for what in ("peak", "rms")
        )
        share = Column("share", "%", [100 * line.share for line in lines])
        stated = (Column(what, "", [getattr(line, what) for line in lines]) for what in ("sd", "source"))
        return (Column("contributor", "", [line.name for line in lines]), *by_group, share, *stated)

    @property
    def factor(self) -> float:
        """Coverage factor k of the 95 % band, GUM 6.3: deviations are normal to first order."""
        return float(scipy.special.ndtri(0.5 + COVERAGE / 2))

    def peak(self, group: Group) -> float:
        """The largest combined standard uncertainty of a group [SI]."""
        return float(self.combined[:, group.channels].max())

    def rms(self, group: Group) -> float:
        """Root mean square along the path of the combined standard uncertainty of the channel where it is largest [SI]."""
        return rms(self.combined[:, group.channels])

    def difference_peak(self, group: Group) -> float:
        """The largest deviation of the finer model in a channel of a group [SI]; 0 without one."""
        return 0.0 if self.model_difference is None else largest(self.model_difference.deviation, group)

    def difference_rms(self, group: Group) -> float:
        """Root mean square along the path of that deviation, of the channel where it is largest [SI]; 0 without a finer model."""
        return 0.0 if self.model_difference is None else rms(self.model_difference.deviation[:, group.channels])

    @property
    def broken(self) -> float | None:
        """The share of the draws that break a limit anywhere on the path; None without draws."""
        return None if self.drawn is None else float(self.drawn.broken.mean())

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader should know of how the budget was made."""
        lost = 0 if self.drawn is None else self.drawn.lost
        why = "their simulated pose or a limited quantity is not finite, as those of a stage that buckles"
        what = f"{lost} of {self.draws} draws left out: {why}"
        return (what,) if lost else ()

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the draws differ from the first order; empty where they agree."""
        why = []
        for a in self.agreements:
            group = a.group
            off = a.difference_of_interval if a.outlying else max(a.difference, a.difference_of_interval)
            if a.outlying and not a.passed and a.turned:
                why.append(
                    f"{group.name}: {a.outlying} of {self.draws} draws lie more than {OUTLYING:g} standard uncertainties off and make "
                    f"the sd of the draws: in all of them {' and '.join(a.turned)} has the other sign, as a normal distribution with so "
                    "large an sd reaches; state a smaller sd, or compare the 95 % intervals"
                )
            elif a.outlying and not a.passed:
                why.append(
                    f"{group.name}: {a.outlying} of {self.draws} draws lie more than {OUTLYING:g} standard uncertainties off and make "
                    "the sd of the draws: such a device resonates or is nearly unstable, or its simulation diverges, for the integrator is "
                    "exact for the described numbers alone; lower the sds, or simulate that device on its own"
                )
            if off > TOLERANCE:
                most = max(self.lines, key=lambda line: line.alone[group.name])
                why.append(
                    f"{group.name}: the draws differ by {100 * off:.0f} % from the first order, because the path is not linear in what is "
                    f"uncertain: at one standard deviation the second order of {most.name} adds "
                    f"{group.shown(most.alone[group.name]):.3g} {group.unit}; take the 95 % interval of the draws"
                )
        return tuple(why)


def error_budget(
    scenario: Scenario | Path | str,
    uncertainty: Path | str | None = None,
    *,
    probability: float = PROBABILITY,
    draws: int = DRAWS,
    seed: int = 0,
    finer: Device | Path | str | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> ErrorBudget:
    """The error budget of a scenario: y(q) of the path under the drives computed for the described device, q what `uncertainty` states
    (a file; by default uncertainty.toml beside the scenario) and the sds of the device file.

    u_c^2 = sum_ij dy/dq_i cov(q_i, q_j) dy/dq_j plus what scatters from sample to sample. Limits are judged at `probability` at each
    sample; 0 `draws` leave the Monte Carlo out. `finer` is another description of the same device, or its file: by how much that moves
    otherwise under the same drives. Raises InputError (with all faults), Unreachable, SolverError.
    Sources: JCGM 100:2008 section 5; JCGM 101:2008; A. H. Slocum, Precision Machine Design (1992), chapter 2.
    """
    scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    _check(probability, draws)
    progress("symbolic model")
    model = model_of(scenario)
    stated = load_uncertainties(scenario, model, uncertainty)
    other = None if finer is None else load_finer(scenario, model, finer)
    return budget_of(solve(scenario, model, progress), stated, probability, draws, seed, other, progress)


def _check(probability: float, draws: int) -> None:
    """Refuses a probability or a number of draws that means nothing. Raises InputError."""
    faults = []
    if not 0.5 <= probability < 1:
        faults.append(Fault("probability", f"{probability:g} must be at least 0.5 and below 1, such as 0.999"))
    if draws and not FEWEST_DRAWS <= draws <= MOST_DRAWS:
        faults.append(Fault("draws", f"{draws} must be 0, or between {FEWEST_DRAWS} and {MOST_DRAWS}"))
    if faults:
        raise InputError("budget", faults)


def budget_of(
    solution: Solution,
    stated: Uncertainties,
    probability: float = PROBABILITY,
    draws: int = DRAWS,
    seed: int = 0,
    finer: FinerModel | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> ErrorBudget:
    """The error budget of a path that is solved already; as `error_budget`."""
    progress("sensitivities along the path")
    path = UncertainPath(solution, stated)
    linear = _propagated(path)
    other = None
    if finer is not None:
        progress("finer model")
        other = difference_to(finer, path, linear)
    combined = linear.combined("pose", stated)
    groups = groups_of(path.signal)
    slopes = slopes_of_limits(path, linear)
    path_margins = margins(path, linear, slopes)
    critical = critical_samples(path_margins, probability)
    drawn = None
    if draws:
        progress(number_of(draws, "draw"))
        drawn = draw(path, linear, DrawnLimits(path_margins, slopes), _kept(combined, groups), critical, draws, seed)
        if drawn.lost > MOST_LOST * draws:
            raise SolverError(
                f"the simulated pose or a limited quantity of {drawn.lost} of {draws} draws is not finite, as those of a stage that "
                "buckles: some standard deviations are too large for this device; lower them"
            )
    rows = safeties(path, path_margins, slopes, drawn, critical, probability)
    lines = budget_lines(path, linear, groups, drawn)
    agreements = () if drawn is None else tuple(agreement(g, combined, drawn, path) for g in groups)
    return ErrorBudget(
        solution, stated, groups, lines, combined, linear, drawn, agreements, rows, probability, draws, seed, other
    )


def _propagated(path: UncertainPath) -> Propagated:
    try:
        return propagate(path)
    except FloatingPointError as error:
        raise SolverError(f"{error}: a law of the device has no derivative there; smooth it, or leave it out") from None


def _kept(combined: np.ndarray, groups: tuple[Group, ...]) -> np.ndarray:
    """The samples at which draws are kept: some along the path, and the largest uncertainty of each group."""
    n = len(combined)
    peaks = [int(combined[:, g.channels].max(axis=1).argmax()) for g in groups]
    return np.unique([*np.linspace(0, n - 1, min(n, KEPT)).astype(int), *peaks])


def agreement(group: Group, combined: np.ndarray, drawn: Drawn, path: UncertainPath) -> Agreement:
    """How the draws of one group agree with its combined standard uncertainty (n, channels) along `path`, to first order."""
    linear = combined[drawn.kept][:, group.channels]
    deviations = drawn.pose[:, :, group.channels]
    sd, mean = deviations.std(axis=0, ddof=1), deviations.mean(axis=0)
    low, high = np.quantile(deviations, [0.5 - COVERAGE / 2, 0.5 + COVERAGE / 2], axis=0)
    compared = (linear >= COMPARED * linear.max()) & (linear > 0)
    expected = float(scipy.special.ndtri(0.5 + COVERAGE / 2)) * linear

    def off(values: np.ndarray, against: np.ndarray) -> float:
        return float(np.abs(values[compared] / against[compared] - 1).max(initial=0.0))

    far = (np.abs(deviations) > OUTLYING * np.where(compared, linear, np.inf)).any(axis=(1, 2))
    values, turned = {name: number.si for name, number in path.model.device.quantities()}, list[str]()
    columns = [(name, line.kind) for line in path.uncertainties.lines for name in line.paths]
    for i, (name, kind) in enumerate(columns):
        described = values.get(shared_path(name), 0.0)
        if kind == "number" and far.any() and np.all((described + drawn.columns[far, i]) * described < 0):
            turned.append(name)
    return Agreement(
        group,
        linear=float(linear.max()),
        drawn=float(sd.max()),
        difference=off(sd, linear),
        difference_of_interval=off((high - low) / 2, expected),
        mean=float(np.abs(mean).max()),
        outlying=int(far.sum()),
        turned=tuple(turned),
    )

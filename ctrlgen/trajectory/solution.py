"""A solved scenario: the drives over time and the margin to every limit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ctrlgen.core.errors import Fault, InputError, SolverError
from ctrlgen.model.model import Limit, Model
from ctrlgen.model.simulation import Trace
from ctrlgen.trajectory.infeasibility import FEASIBILITY_TOLERANCE, unreachable
from ctrlgen.trajectory.optimisation import OptimisationResult, TrajectoryProgramme
from ctrlgen.trajectory.path_inverse import InverseTrajectory, PathInverse, count_faults
from ctrlgen.trajectory.scenario import Scenario

INERTIA = "has inertia: it can be simulated, diagnosed and exported as a plant, but not be led along a path yet"


@dataclass(frozen=True)
class Margin:
    """Distance of a limited quantity to its nearer bound: its `value` at the sample where it is closest, all SI.

    `share` is the distance over the admissible range (over the bound itself where only one is given; None
    for a one-sided bound at zero).
    """

    limit: Limit
    channel: str
    sample: int
    value: float
    bound: float
    distance: float
    share: float | None


@dataclass(frozen=True)
class Solution:
    """A solved scenario, SI. `trace` holds the samples; `drive` (n, axes) acts from sample k to k + 1."""

    scenario: Scenario
    model: Model
    command: np.ndarray
    trace: Trace
    drive: np.ndarray
    margins: tuple[Margin, ...]
    iterations: int
    rows_added: tuple[str, ...]

    @property
    def tightest(self) -> Margin:
        """The margin with the smallest share of its range left."""
        return min((m for m in self.margins if m.share is not None), key=lambda m: m.share or 0.0)


def check_feasibility(scenario: Scenario, model: Model, command: np.ndarray) -> tuple[PathInverse, InverseTrajectory]:
    """The inverse of `command` (n, channels) [SI] and what it needs, without IPOPT. Raises Unreachable where that breaks a limit, and
    InputError for a device that cannot be inverted, with inertia or too many or few drives, or a closed path of one that changes with
    time."""
    if model.inertial:
        what = f"{model.name} {INERTIA}; name a device that is in balance at every moment"
        raise InputError(scenario.path, [Fault("device", what)])
    if model.clocks and scenario.closed:
        what = "is closed, but an effect of the device changes with time, so no period repeats; make the path open, or drop the effect"
        raise InputError(scenario.path, [Fault("path", what)])
    if faults := count_faults(model, scenario.file.follow):
        raise InputError(scenario.path, faults)
    inverse = PathInverse(model, scenario.file.follow, scenario.sample_time)
    needed = inverse.trajectory(command, scenario.closed)
    if (error := unreachable(scenario, inverse, command, needed)) is not None:
        raise error
    return inverse, needed


def solve(scenario: Scenario, model: Model, progress: Callable[[str], None] = lambda _: None) -> Solution:
    """The drives that follow `scenario`. Raises Unreachable where it cannot be followed, SolverError where IPOPT fails, and
    InputError for a device with inertia or a closed path of one that changes with time.

    The inverse of the path says sample by sample what it takes. Where that breaks a limit the path cannot be followed; where it
    keeps all of them it is the solution, from which IPOPT begins, and the answer where IPOPT ends elsewhere. `progress` is called
    before each run of IPOPT.
    """
    command = scenario.command(model)
    inverse, needed = check_feasibility(scenario, model, command)

    def step(rows: Sequence[Limit]) -> None:
        progress(f"IPOPT, {len(command)} samples" + (f", with {', '.join(r.label for r in rows)}" if rows else ""))

    programme = TrajectoryProgramme(model, scenario.file.follow, command, scenario.sample_time, scenario.closed)
    try:
        result, rows = programme.optimum(needed, step)
    except SolverError:
        if not needed.exact:
            raise
        result, rows = programme.exact(needed), []
    if np.linalg.norm(result.unreachable_by, axis=1).max() > FEASIBILITY_TOLERANCE:
        if not needed.exact:
            off = np.linalg.norm(result.unreachable_by, axis=1)
            raise unreachable(scenario, inverse, command, needed, certain=True) or SolverError(
                f"the nearest trajectory that IPOPT found is off the command, most at sample {int(off.argmax())}, and the inverse "
                "finds no drives there that satisfy the device's equations; command smaller or slower motions"
            )
        result, rows = programme.exact(needed), []
    added = tuple(limit.name for limit in rows)
    margins = tuple(_margins(model, result))
    return Solution(scenario, model, command, result.trace, result.u, margins, result.iterations, added)


def _margins(model: Model, result: OptimisationResult) -> list[Margin]:
    """One Margin per limit: the smallest distance to its nearer side."""
    n = len(result.u)
    values = model.evaluate_limits.map(n)(result.x.T, result.z.T, result.u.T, np.tile(model.p_nominal[:, None], (1, n)))
    margins = []
    for limit, value in zip(model.limits, values, strict=True):
        table = value.full().T
        sides = []
        for bound, sign in ((limit.lower, 1.0), (limit.upper, -1.0)):
            if bound is None:
                continue
            distance = sign * (table - bound)
            k, i = np.unravel_index(int(np.argmin(distance)), distance.shape)
            span = (limit.upper - limit.lower) if limit.lower is not None and limit.upper is not None else abs(bound)
            share = float(distance[k, i]) / span if span else None
            sides.append(
                Margin(limit, limit.channels[i], int(k), float(table[k, i]), bound, float(distance[k, i]), share)
            )
        margins.append(min(sides, key=lambda side: side.distance))
    return margins

"""A solved scenario: the drives over time and the margin to every limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ctrlgen.core.errors import Fault, InputError, SolverError
from ctrlgen.model.model import Limit, Model
from ctrlgen.model.simulation import Trace
from ctrlgen.trajectory.infeasibility import FEASIBILITY_TOLERANCE, infeasibility_error
from ctrlgen.trajectory.optimisation import OptimisationResult, TrajectoryProgramme
from ctrlgen.trajectory.scenario import Scenario

INERTIA = "has inertia: it can be simulated, diagnosed and exported as a plant, but not be led along a path yet"
BROKEN = 1e-7  # of a limit: an excess below is what IPOPT's relaxed bounds (1e-8) may leave


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


def solve(scenario: Scenario, model: Model, progress: Callable[[str], None] = lambda _: None) -> Solution:
    """The drives that follow `scenario`. Raises Unreachable where it cannot be followed, SolverError where IPOPT fails, and
    InputError for a device with inertia.

    Composite limits (stress, rotation) are left out at first; those that the solution breaks are added and the problem is
    solved again. An optimum without them that keeps all of them is the optimum with them. `progress` is called before each.
    """
    if model.inertial:
        what = f"{model.name} {INERTIA}; name a device that is in balance at every moment"
        raise InputError(scenario.path, [Fault("device", what)])
    command = scenario.command(model)
    programme = TrajectoryProgramme(model, scenario, command)
    rows: list[Limit] = []
    relaxed: OptimisationResult | None = None
    while True:
        progress(f"IPOPT, {len(command)} samples" + (f", with {', '.join(r.label for r in rows)}" if rows else ""))
        try:
            result = programme.run(rows)
        except SolverError:
            if relaxed is None:
                raise
            raise infeasibility_error(scenario, model, command, relaxed, None, rows) from None
        if np.linalg.norm(result.unreachable_by, axis=1).max() > FEASIBILITY_TOLERANCE:
            raise infeasibility_error(scenario, model, command, relaxed or result, result, rows)
        margins = _margins(model, result)
        broken = [
            m.limit for m in margins if m.distance < -BROKEN * max(abs(m.bound), abs(m.value)) and m.limit not in rows
        ]
        if not broken:
            added = tuple(limit.name for limit in rows)
            return Solution(scenario, model, command, result.trace, result.u, tuple(margins), result.iterations, added)
        relaxed = relaxed or result
        rows += broken


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

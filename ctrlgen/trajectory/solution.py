"""A solved scenario: the drives over time and the margin to every limit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import ceil

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError, SolverError
from ctrlgen.core.units import show
from ctrlgen.model.discretisation import one_step_map
from ctrlgen.model.model import Limit, Model
from ctrlgen.model.quasi_static import natural_modes, quasi_static
from ctrlgen.model.simulation import Trace, periodic_start, simulate
from ctrlgen.trajectory.infeasibility import FEASIBILITY_TOLERANCE, unreachable
from ctrlgen.trajectory.inverse.balanced import InverseTrajectory, PathInverse, count_faults
from ctrlgen.trajectory.inverse.inertial import InertialInverse
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.inverse.redundant import LeastEffortInverse, motion_inverse, path_inverse
from ctrlgen.trajectory.inverse.sampled import SampledTrajectory
from ctrlgen.trajectory.inverse.violations import Before, limited_values, violations
from ctrlgen.trajectory.optimisation import OptimisationResult, TrajectoryProgramme
from ctrlgen.trajectory.scenario import Scenario, check_tightened
from ctrlgen.trajectory.scenario_file import MOST_SAMPLES

SHOWN = 3  # limits that a message names
LOOKED_AT_BETWEEN = 4  # parts of a sample at whose ends the motion between samples is looked at


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

    @property
    def reserve(self) -> float:
        """What is kept of the device's own bound for what is not known exactly; the distance is what is left beside it."""
        return abs(self.limit.described(self.bound) - self.bound)


@dataclass(frozen=True)
class Solution:
    """A solved scenario, SI. `trace` holds the samples; `drive` (n, axes) acts from sample k to k + 1. `iterations` of IPOPT, or with
    inertia of Newton's method; `between_samples` (channels,) is the largest distance from the path between samples, with inertia."""

    scenario: Scenario
    model: Model
    command: np.ndarray
    trace: Trace
    drive: np.ndarray
    margins: tuple[Margin, ...]
    iterations: int
    rows_added: tuple[str, ...]
    between_samples: np.ndarray | None = None

    @property
    def solver(self) -> str:
        """What `iterations` counts."""
        return "Newton's method" if self.model.inertial else "IPOPT"

    @property
    def tightest(self) -> Margin:
        """The margin with the smallest share of its range left."""
        return min((m for m in self.margins if m.share is not None), key=lambda m: m.share or 0.0)


def _one_period(model: Model, x: np.ndarray, z: np.ndarray, u: np.ndarray, sample_time: float) -> int:
    """Samples of one period of the slowest mode, after a path at whose end it may still vibrate; none where none does."""
    modes = natural_modes(model, x, z, u)
    return min(ceil(1 / (min(f for f, _ in modes) * sample_time)), MOST_SAMPLES) if modes else 0


def check_feasibility(
    scenario: Scenario, model: Model, command: np.ndarray
) -> tuple[PathInverse | LeastEffortInverse, InverseTrajectory]:
    """The inverse of `command` (n, channels) [SI] and what it needs, without IPOPT. Raises Unreachable where that breaks a limit, and
    InputError for a device that cannot be inverted, with too many or few drives, or a closed path of one that changes with time."""
    _check_invertible(scenario, model)
    inverse = path_inverse(model, scenario.file.follow, scenario.sample_time)
    needed = inverse.trajectory(command, scenario.closed)
    if (error := unreachable(scenario, inverse, command, needed)) is not None:
        raise error
    return inverse, needed


def check_motion(
    scenario: Scenario, model: Model
) -> tuple[InertialInverse | LeastEffortInverse, Motion, InverseTrajectory]:
    """The inverse of a device with inertia, the commanded motion and what it needs. Raises as `check_feasibility`, and InputError for
    a path that is not as smooth as the drive needs."""
    _check_invertible(scenario, model)
    motion = scenario.motion(model)
    inverse = motion_inverse(model, scenario.file.follow, scenario.sample_time or 0.0)
    needed = inverse.trajectory(motion, scenario.closed)
    if (error := unreachable(scenario, inverse, motion, needed)) is not None:
        raise error
    return inverse, motion, needed


def check_static(
    scenario: Scenario, model: Model
) -> tuple[PathInverse | LeastEffortInverse, InverseTrajectory]:  # fmt: skip
    """The inverse of a device with inertia in balance, and what it needs. Raises as `check_feasibility`, and InputError for a device
    without inertia, or whose static drive depends on the motion."""
    if not model.inertial or scenario.sample_time is None:
        what = (
            "is static, but the device has no inertia"
            if not model.inertial
            else "is of motions: give sample_rate and duration"
        )
        raise InputError(scenario.path, [Fault("feedforward", f"{what}; leave it out")])
    still = quasi_static(model)
    _check_invertible(scenario, still)
    inverse = path_inverse(still, scenario.file.follow, scenario.sample_time)
    command = scenario.command(model)
    led = command if model.n_states else scenario.positions(model, -0.5)
    needed = inverse.trajectory(led, scenario.closed)
    if (error := unreachable(scenario, inverse, command, needed)) is not None:
        raise error
    return inverse, needed


def _check_invertible(scenario: Scenario, model: Model) -> None:
    check_tightened(scenario, model)
    if model.clocks and scenario.closed:
        what = "is closed, but an effect of the device changes with time, so no period repeats; make the path open, or drop the effect"
        raise InputError(scenario.path, [Fault("path", what)])
    if faults := count_faults(model, scenario.file.follow):
        raise InputError(scenario.path, faults)


def solve(scenario: Scenario, model: Model, progress: Callable[[str], None] = lambda _: None) -> Solution:
    """The drives that follow `scenario`. Raises Unreachable where it cannot be followed, SolverError where none are found, and
    InputError for a device that cannot be inverted, a path that is not smooth enough for one with inertia, a closed path of one
    that changes with time, or limits that are to be tightened and are not (`ctrlgen.budget.robust.solve` tightens them).

    The inverse of the path says sample by sample what it takes. Where that breaks a limit the path cannot be followed; where it
    keeps all of them it is the solution, from which IPOPT begins, and the answer where IPOPT ends elsewhere. With inertia it is what
    the drives are near that are held from sample to sample. `progress` is called before each run of IPOPT.
    """
    if scenario.file.feedforward == "static":
        return _solve_static(scenario, model, progress)
    return (_solve_inertial if model.inertial else _solve_balanced)(scenario, model, progress)


def _solve_static(scenario: Scenario, model: Model, progress: Callable[[str], None]) -> Solution:
    """The drives of a device with inertia that would follow if it stood in balance, and what it does under them: an open path from rest at
    its start, a closed one in its periodic motion. A drive that acts without lag fits the middle of the sample for which it is held."""
    inverse, needed = check_static(scenario, model)
    assert scenario.sample_time is not None
    command = scenario.command(model)
    u, velocities = np.clip(needed.u, *model.u_bounds), np.zeros(model.v.numel())
    x, z, _ = inverse.at_rest(command[0])
    start = np.concatenate([x, velocities, z])
    iterations = 0
    if scenario.closed:
        progress(f"periodic motion, {len(u)} samples")
        start, iterations = periodic_start(model, u, scenario.sample_time, start)
    x, z = np.split(start, [model.x.numel()])
    n, after = len(u), 0 if scenario.closed else _one_period(model, x, z, u[-1], scenario.sample_time)
    held = np.vstack([u, np.tile(u[-1:], (after, 1))])
    reached = simulate(model, held, scenario.sample_time, x, z)
    samples = Trace(reached.time[:n], {k: v[:n] for k, v in reached.signals.items()}, reached.x[:n], reached.z[:n])
    before = Before(needed.before(scenario.closed), scenario.sample_time)
    if broken := violations(model, samples.x, samples.z, u, before=before) or violations(
        model, reached.x[:-1], reached.z[:-1], held
    ):
        names = "; ".join(f"{v.limit.label} at sample {v.worst}" for v in broken[:SHOWN])
        raise SolverError(
            f"without inertia feedforward the stage overshoots its limits ({names}); shape the path, slow it down, or leave out "
            'feedforward = "static"'
        )
    margins = tuple(closest_margins(model, samples.x, samples.z, u, before))
    between = error_between_samples(scenario, model, samples, u)
    return Solution(scenario, model, command, samples, u, margins, iterations, (), between)


def _solve_inertial(scenario: Scenario, model: Model, progress: Callable[[str], None]) -> Solution:
    """By the sampled inverse; the trace is that of the model driven so by the shipped integrator."""
    inverse, motion, _ = check_motion(scenario, model)
    assert inverse.sample_time is not None
    progress(f"sampled inverse, {len(motion)} samples")
    found = inverse.sampled(motion, scenario.closed)
    u = np.clip(found.u, *model.u_bounds)  # what NEGLIGIBLE lets pass is rounding
    needed = inverse.needed(found, motion, scenario.closed)
    if (error := unreachable(scenario, inverse, motion, needed)) is not None:
        raise error
    samples = _driven(model, found, u, inverse.sample_time)
    off = np.linalg.norm(
        (samples.signals[scenario.file.follow] - motion.position) / model.signals[scenario.file.follow].scale, axis=1
    )
    if not off.max() <= FEASIBILITY_TOLERANCE:
        raise SolverError(
            f"drives held for {show(inverse.sample_time, 's')} follow the path only to {off.max():.1g} of its typical size, worst at "
            f"sample {int(off.argmax())}; raise sample_rate, or make the path slower or smoother"
        )
    margins = tuple(
        closest_margins(model, samples.x, samples.z, u, Before(needed.before(scenario.closed), inverse.sample_time))
    )
    between = error_between_samples(scenario, model, samples, u)
    return Solution(scenario, model, motion.position, samples, u, margins, found.iterations, (), between)


def _driven(model: Model, found: SampledTrajectory, u: np.ndarray, sample_time: float) -> Trace:
    """The samples of the model under the drives u (n, n_u), by the shipped integrator."""
    reached, n = simulate(model, u, sample_time, found.x[0], found.z[0]), len(u)
    return Trace(reached.time[:n], {k: v[:n] for k, v in reached.signals.items()}, reached.x[:n], reached.z[:n])


def unlimited(scenario: Scenario, model: Model) -> Solution:
    """What the path of `scenario` takes, whether or not it keeps the limits: without margins. Raises as `solve` where the inverse of
    the path alone does not give it."""
    if model.inertial:
        motion = scenario.motion(model)
        moved = motion_inverse(model, scenario.file.follow, scenario.sample_time or 0.0)
        found = moved.sampled(motion, scenario.closed)
        return Solution(
            scenario, model, motion.position, _driven(model, found, found.u, scenario.sample_time or 0.0), found.u, (),
            found.iterations, (),
        )  # fmt: skip
    command = scenario.command(model)
    needed = path_inverse(model, scenario.file.follow, scenario.sample_time).trajectory(command, scenario.closed)
    if not needed.exact:
        return solve(scenario, model)
    free = replace(model, limits=())  # which would clip
    result = TrajectoryProgramme(free, scenario.file.follow, command, scenario.sample_time, scenario.closed).exact(
        needed
    )
    return Solution(scenario, model, command, result.trace, result.u, (), 0, ())


def judged_by(solution: Solution, scenario: Scenario, model: Model) -> Solution:
    """The same drives with the margins that the limits of `model` leave; those on rates stay."""
    trace, rates = solution.trace, {limit.name for limit in model.rate_limits}
    margins = closest_margins(model, trace.x, trace.z, solution.drive, None)
    kept = [m for m in solution.margins if m.limit.name in rates]
    return replace(solution, scenario=scenario, model=model, margins=(*margins, *kept))


def error_between_samples(scenario: Scenario, model: Model, samples: Trace, u: np.ndarray) -> np.ndarray:
    """(channels,) the largest distance [SI] of the followed signal from the path between the samples of a device with inertia, under
    drives u (n, n_u) that are held: at `LOOKED_AT_BETWEEN` moments of each sample, by steps of the shipped integrator."""
    h, n, p = scenario.sample_time or 0.0, len(u), np.tile(model.p_nominal[:, None], (1, len(u)))
    worst = np.zeros(samples.signals[scenario.file.follow].shape[1])
    for k in range(1, LOOKED_AT_BETWEEN):
        share = k / LOOKED_AT_BETWEEN
        after = one_step_map(model, share * h)
        signal = ca.substitute(
            model.signals[scenario.file.follow].expr, ca.vertcat(model.x, model.z), ca.vertcat(after.x, after.z)
        )
        reached = ca.Function("between", [model.x, model.z, model.u, model.p], [signal]).map(n)(
            samples.x.T, samples.z.T, u.T, p
        )
        smooth = scenario.file.feedforward == "inertia"
        wanted = scenario.motion(model, np.arange(n) + share).position if smooth else scenario.positions(model, share)
        worst = np.maximum(worst, np.abs(reached.full().T - wanted).max(axis=0))
    return worst


def _solve_balanced(scenario: Scenario, model: Model, progress: Callable[[str], None]) -> Solution:
    """By IPOPT, begun at the inverse of the path."""
    command = scenario.command(model)
    inverse, needed = check_feasibility(scenario, model, command)

    def step(rows: Sequence[Limit]) -> None:
        progress(f"IPOPT, {len(command)} samples" + (f", with {', '.join(r.label for r in rows)}" if rows else ""))

    programme = TrajectoryProgramme(model, scenario.file.follow, command, scenario.sample_time, scenario.closed)
    if model.redundant:  # IPOPT has chosen the drives already, where there was something to choose
        if not needed.exact:
            raise SolverError(
                f"the memories of {model.name} do not settle within a period, and it has more drives than axes; make the path open, or "
                "leave out effects with memories"
            )
        return _from_result(scenario, model, command, programme.exact(needed), ())
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
    return _from_result(scenario, model, command, result, tuple(limit.name for limit in rows))


def _from_result(
    scenario: Scenario, model: Model, command: np.ndarray, result: OptimisationResult, added: tuple[str, ...]
) -> Solution:
    """The solution with its margins. Raises SolverError where it breaks a limit."""
    before = None if scenario.sample_time is None else Before(result.before, scenario.sample_time)
    if broken := violations(model, result.x, result.z, result.u, before=before):
        names = ", ".join(dict.fromkeys(v.limit.label for v in broken))
        raise SolverError(f"what the solver calls a solution breaks limits ({names}); command a smaller or slower path")
    margins = tuple(closest_margins(model, result.x, result.z, result.u, before))
    return Solution(scenario, model, command, result.trace, result.u, margins, result.iterations, added)


def closest_margins(model: Model, x: np.ndarray, z: np.ndarray, u: np.ndarray, before: Before | None) -> list[Margin]:
    """One Margin per limit, with the drives `before` also of their rates: the smallest distance to its nearer side."""
    margins = []
    for limit, table in limited_values(model, x, z, u, before):
        sides = []
        for bound, sign in ((limit.lower, 1.0), (limit.upper, -1.0)):
            if bound is None:
                continue
            distance = sign * (table - bound)
            k, i = np.unravel_index(int(np.argmin(distance)), distance.shape)
            share = float(distance[k, i]) / limit.span if limit.span else None
            sides.append(
                Margin(limit, limit.channels[i], int(k), float(table[k, i]), bound, float(distance[k, i]), share)
            )
        margins.append(min(sides, key=lambda side: side.distance))
    return margins

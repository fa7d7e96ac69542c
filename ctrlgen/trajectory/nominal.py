"""The drives that follow a path with the limits that the model has; `ctrlgen.budget.robust` tightens these where a scenario asks for it.

The inverse of the path says sample by sample what it takes. Where that breaks a limit the path cannot be followed; where it
keeps all of them it is the solution, from which IPOPT begins, and the answer where IPOPT ends elsewhere. With inertia it is what
the drives are near that are held from sample to sample.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil

import numpy as np

from ctrlgen.core.errors import SolverError
from ctrlgen.core.units import show
from ctrlgen.devices import Limit
from ctrlgen.model.model import Model
from ctrlgen.model.quasi_static import natural_modes
from ctrlgen.model.simulation import Trace, first_samples, periodic_start, simulate
from ctrlgen.trajectory.infeasibility import FEASIBILITY_TOLERANCE, check_feasible, unreachable
from ctrlgen.trajectory.intersample import between_samples
from ctrlgen.trajectory.inverse.clock import in_time
from ctrlgen.trajectory.inverse.path_inverse import InverseTrajectory
from ctrlgen.trajectory.inverse.violations import violations
from ctrlgen.trajectory.optimisation import MOST_CONFIRMED, SATISFIED, OptimisationResult, TrajectoryProgramme
from ctrlgen.trajectory.problem import PathProblem
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.trajectory.scenario_file import MOST_SAMPLES
from ctrlgen.trajectory.solution import Solution, closest_margins
from ctrlgen.trajectory.unstated_modes import moved_with_modes

SHOWN = 3  # limits that a message names
Progress = Callable[[str], None]


def solve_nominal(scenario: Scenario, model: Model, progress: Progress) -> Solution:
    """The drives that follow `scenario` within the limits of `model`. `progress` is called before each run of IPOPT. Raises as
    `ctrlgen.budget.robust.solve`, which alone calls it."""
    problem = scenario.bind(model)
    if scenario.file.feedforward == "static":
        return _led_statically(scenario, problem, progress)
    if scenario.file.leads_modes:
        return _led_with_modes(scenario, problem, progress)
    needed = check_feasible(problem)
    if problem.order:
        return _held(scenario, problem, progress)
    if model.redundant:
        return _exact(scenario, problem, needed)
    return _optimal(scenario, problem, needed, progress)


def _led_statically(scenario: Scenario, problem: PathProblem, progress: Progress) -> Solution:
    """The drives of a device with inertia that would follow if it stood in balance, and what it does under them: an open path from rest at
    its start, a closed one in its periodic motion. A drive that acts without lag fits the middle of the sample for which it is held."""
    needed, velocities = check_feasible(problem), np.zeros(problem.model.v.numel())
    x, z, _ = problem.in_balance.inverse.at_rest(problem.samples[0])
    found = _led_by(scenario, problem, needed, np.concatenate([x, velocities, z]), progress)
    return replace(found, between_samples=_error_between_samples(problem, found.trace, found.drive))


def _led_with_modes(scenario: Scenario, problem: PathProblem, progress: Progress) -> Solution:
    """The drives of the online controller that leads modes of the bodies, each that of the middle of the sample for which it is held, and
    what axes and pose with these modes do under them. States and displacements of the trace are those of the model."""
    needed, model = check_feasible(problem), problem.model
    held = problem.inverse.trajectory(problem.motion_after(0.5))
    if (error := unreachable(problem, held)) is not None:
        raise error
    found = _led_by(scenario, problem, held, np.concatenate([needed.x[0], needed.z[0]]), progress)
    moved = moved_with_modes(model, found.trace, found.drive, problem.closed)
    margins = tuple(closest_margins(model, moved.x, moved.z, found.drive, held.before))
    return replace(found, trace=replace(found.trace, signals=moved.signals), margins=margins)


def _led_by(
    scenario: Scenario, problem: PathProblem, needed: InverseTrajectory, start: np.ndarray, progress: Progress
) -> Solution:
    """What a device with inertia does under drives that are given: an open path from `start`, a closed one in its periodic motion."""
    model, h = problem.model, in_time(problem.clock).sample_time
    u, iterations = np.clip(needed.u, *model.u_bounds), 0
    if problem.closed:
        progress(f"periodic motion, {len(u)} samples")
        start, iterations = periodic_start(model, u, h, start)
    x, z = np.split(start, [model.x.numel()])
    n, after = len(u), 0 if problem.closed else _one_period(model, x, z, u[-1], h)
    held = np.vstack([u, np.tile(u[-1:], (after, 1))])
    reached = simulate(model, held, h, x, z)
    samples = first_samples(reached, n)
    broken = violations(model, samples.x, samples.z, u, before=needed.before)
    if broken := broken or violations(model, reached.x[:-1], reached.z[:-1], held):
        names = "; ".join(f"{v.limit.label} at sample {v.worst}" for v in broken[:SHOWN])
        raise SolverError(
            f"so led the stage overshoots its limits ({names}); shape the path, slow it down, or leave out "
            f'feedforward = "{scenario.file.feedforward}"'
        )
    margins = tuple(closest_margins(model, samples.x, samples.z, u, needed.before))
    return Solution(scenario, model, problem.asked, samples, u, margins, iterations, ())


def _one_period(model: Model, x: np.ndarray, z: np.ndarray, u: np.ndarray, sample_time: float) -> int:
    """Samples of one period of the slowest mode, after a path at whose end it may still vibrate; none where none does."""
    modes = natural_modes(model, x, z, u)
    return min(ceil(1 / (min(f for f, _ in modes) * sample_time)), MOST_SAMPLES) if modes else 0


def _held(scenario: Scenario, problem: PathProblem, progress: Progress) -> Solution:
    """By the sampled inverse; the trace is that of the model driven so by the shipped integrator."""
    model, motion, clock = problem.model, problem.motion, in_time(problem.clock)
    progress(f"sampled inverse, {len(motion)} samples")
    needed = problem.inverse.held(motion)
    if (error := unreachable(problem, needed)) is not None:
        raise error
    u = np.clip(needed.u, *model.u_bounds)  # what NEGLIGIBLE lets pass is rounding
    samples = _driven(problem, needed, u)
    off = np.linalg.norm((samples.signals[problem.follow] - motion.position) / problem.signal.scale, axis=1)
    if not off.max() <= FEASIBILITY_TOLERANCE:
        raise SolverError(
            f"drives held for {show(clock.sample_time, 's')} follow the path only to {off.max():.1g} of its typical size, worst at "
            f"sample {int(off.argmax())}; raise sample_rate, or make the path slower or smoother"
        )
    margins = tuple(closest_margins(model, samples.x, samples.z, u, needed.before))
    between = _error_between_samples(problem, samples, u)
    return Solution(scenario, model, motion.position, samples, u, margins, needed.iterations, (), between)


def _driven(problem: PathProblem, needed: InverseTrajectory, u: np.ndarray) -> Trace:
    """The samples of the model under the drives u (n, n_u), by the shipped integrator."""
    reached = simulate(problem.model, u, in_time(problem.clock).sample_time, needed.x[0], needed.z[0])
    return first_samples(reached, len(u))


def _error_between_samples(problem: PathProblem, samples: Trace, u: np.ndarray) -> np.ndarray:
    """(channels,) the largest distance [SI] of the followed signal from the path between the samples, under held drives u (n, n_u)."""
    smooth = problem.file.feedforward == "inertia"
    worst = np.zeros(len(problem.signal.channels))
    h = in_time(problem.clock).sample_time
    for share, reached in between_samples(problem.model, problem.follow, samples, u, h):
        wanted = problem.motion_after(share).position if smooth else problem.positions(share)
        worst = np.maximum(worst, np.abs(reached - wanted).max(axis=0))
    return worst


def _programme(problem: PathProblem) -> TrajectoryProgramme:
    return TrajectoryProgramme(problem.model, problem.follow, problem.motion, problem.clock)


def _exact(scenario: Scenario, problem: PathProblem, needed: InverseTrajectory) -> Solution:
    """With more drives than axes: IPOPT has chosen the drives already, where there was something to choose."""
    if not needed.exact:
        raise SolverError(
            f"the memories of {problem.model.name} do not settle within a period, and it has more drives than axes; make the path open, or "
            "leave out effects with memories"
        )
    return _from_result(scenario, problem, _programme(problem).exact(needed))


def _optimal(scenario: Scenario, problem: PathProblem, needed: InverseTrajectory, progress: Progress) -> Solution:
    """The solution by IPOPT, begun at the inverse of the path; of long paths the inverse itself where it satisfies all equations, which
    makes it the optimum."""
    programme = _programme(problem)
    if needed.exact and len(problem.motion) > MOST_CONFIRMED and (off := programme.residual(needed)) <= SATISFIED:
        return replace(_from_result(scenario, problem, programme.exact(needed)), residual=off)

    def step(rows: Sequence[Limit]) -> None:
        added = f", with {', '.join(r.label for r in rows)}" if rows else ""
        progress(f"IPOPT, {len(problem.motion)} samples{added}")

    try:
        result, rows = programme.optimum(needed, step)
    except SolverError:
        if not needed.exact:
            raise
        return _from_result(scenario, problem, programme.exact(needed))
    off = np.linalg.norm(result.unreachable_by, axis=1)
    if off.max() <= FEASIBILITY_TOLERANCE:
        return _from_result(scenario, problem, result, tuple(limit.name for limit in rows))
    if needed.exact:
        return _from_result(scenario, problem, programme.exact(needed))
    raise unreachable(problem, needed, certain=True) or SolverError(
        f"the nearest trajectory that IPOPT found is off the command, most at sample {int(off.argmax())}, and the inverse "
        "finds no drives there that satisfy the device's equations; command smaller or slower motions"
    )


def _from_result(
    scenario: Scenario, problem: PathProblem, result: OptimisationResult, added: tuple[str, ...] = ()
) -> Solution:
    """The solution with its margins. Raises SolverError where it breaks a limit."""
    model = problem.model
    if broken := violations(model, result.x, result.z, result.u, before=result.before):
        names = ", ".join(dict.fromkeys(v.limit.label for v in broken))
        raise SolverError(f"the computed solution breaks limits ({names}); command a smaller or slower path")
    margins = tuple(closest_margins(model, result.x, result.z, result.u, result.before))
    return Solution(scenario, model, problem.motion.position, result.trace, result.u, margins, result.iterations, added)


def unlimited(scenario: Scenario, model: Model) -> Solution:
    """What the path of `scenario` takes, whether or not it keeps the limits: without margins. Raises as `solve_nominal` where the inverse
    of the path alone does not give it."""
    problem = scenario.bind(model)
    motion = problem.motion
    needed = problem.inverse.held(motion)
    if motion.order:
        samples, u = _driven(problem, needed, needed.u), needed.u
        return Solution(scenario, model, motion.position, samples, u, (), needed.iterations, ())
    if not needed.exact:
        return solve_nominal(scenario, model, lambda _: None)
    free = replace(problem, model=replace(model, limits=()))  # which would clip
    result = _programme(free).exact(needed)
    return Solution(scenario, model, motion.position, result.trace, result.u, (), 0, ())

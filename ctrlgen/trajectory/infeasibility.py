"""Why a trajectory cannot be followed: which samples, which actuators, by how much, and what could be followed instead."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, Infeasibility, InputError, SolverError, Unreachable
from ctrlgen.core.units import from_si, show, show_difference
from ctrlgen.devices import Signal
from ctrlgen.model.model import Model
from ctrlgen.trajectory.alternatives import Alternatives
from ctrlgen.trajectory.inverse.choice import count_faults
from ctrlgen.trajectory.inverse.clock import Settled
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.inverse.path_inverse import InverseTrajectory
from ctrlgen.trajectory.inverse.violations import Violation, violations
from ctrlgen.trajectory.optimisation import TrajectoryProgramme
from ctrlgen.trajectory.problem import PathProblem

# typical sizes (1 um, or 1 um at the platform's rim) off the command that count as none: 10 pm
FEASIBILITY_TOLERANCE = 1e-5
SHOWN_RUNS = 6  # runs of samples that a message lists
SHOWN_CAUSES = 8  # limits that it lists


def check_feasible(problem: PathProblem) -> InverseTrajectory:
    """What the path takes by its inverse, without IPOPT. Raises Unreachable where that breaks a limit, and InputError for a device that
    cannot be inverted, with too many or few drives, a closed path of one that changes with time, a path that is not as smooth as the
    drive needs, or a static feedforward of a device without inertia."""
    statically = problem.file.feedforward == "static"
    solved = problem.in_balance if statically else problem
    _check_invertible(solved)
    motion = solved.motion
    if statically and not solved.model.n_states:
        motion = Motion.of_samples(solved.positions(-0.5), solved.closed)
    needed = solved.inverse.trajectory(motion)
    if (error := unreachable(solved, needed)) is not None:
        raise error
    return needed


def _check_invertible(problem: PathProblem) -> None:
    if problem.model.clocks and problem.closed:
        what = "is closed, but an effect of the device changes with time, so no period repeats; make the path open, or drop the effect"
        raise InputError(problem.source, [Fault("path", what)])
    if faults := count_faults(problem.model, problem.follow):
        raise InputError(problem.source, faults)


def unreachable(problem: PathProblem, needed: InverseTrajectory, certain: bool = False) -> Unreachable | None:
    """The error that names the samples, the actuators and limits, by how much, and what can be followed instead; None where
    what is `needed` breaks no limit, or perhaps none, unless it is `certain` from elsewhere that the path cannot be followed."""
    model, inverse, signal = problem.model, problem.inverse, problem.signal
    n, wanted, following = len(problem.motion), problem.motion.position, problem.motion.following
    causes = primary(model, needed.violations(model))
    if not needed.exact and not certain:
        # of what may still change, or is out of the equations' range, only displacements far enough out of theirs
        least = 0.0 if not needed.solved else 2 * needed.unsettled * float(model.z_scale.max())
        causes = [c for c in causes if model.limited_variable(c.limit, c.channel) == "z" and c.beyond.max() > least]
    if not causes:
        return None
    samples = tuple(map(int, np.flatnonzero(np.any([c.beyond > 0 for c in causes], axis=0))))
    worst, at = causes[0].worst, problem.clock.moment
    lines = [
        f"cannot follow {len(samples)} of {number_of(n, 'sample')} ({_runs(samples)}); the worst is sample {worst}{at(worst)}: "
        f"{_point(signal, wanted[worst])}"
    ]
    ends = wanted[[worst, following[worst]]]  # of the drive of the worst sample
    x, z, u = (np.array(v) for v in zip(*map(inverse.at_rest, ends), strict=True))
    held = violations(model, x, z, u)
    listed, also = _grouped(model, causes)
    lines += [
        f"  {_said(model, cause, bool(held))}, worst at sample {cause.worst}{at(cause.worst)}, in {len(cause.samples)} of {n} "
        f"samples{f'; {others} more like it' if others else ''}"
        for cause, others in zip(listed[:SHOWN_CAUSES], also, strict=False)
    ]
    if len(listed) > SHOWN_CAUSES:
        lines.append(f"  and {number_of(len(listed) - SHOWN_CAUSES, 'more limit')}")
    nearest = _nearest_pose(model, problem.follow, wanted[worst]) if held else None
    if nearest is not None:
        lines.append(f"  nearest pose of that sample that can be held: {_point(signal, nearest)}")
    line, others = instead(problem, [c.worst for c in causes])
    lines += [line] * bool(line)
    return Unreachable("\n".join(lines), Infeasibility(samples, worst, wanted, nearest, others))


def instead(problem: PathProblem, worst: Sequence[int]) -> tuple[str, dict[str, np.ndarray]]:
    """What can be followed instead of a path that breaks limits most at the samples `worst`: a line of text, empty for one pose, and
    the paths (n, channels) [SI] by what they are compared with the commanded one."""
    nearest = Alternatives(problem, worst).nearest()
    line = ""
    if nearest:
        line = f"  the path can be followed {'; or '.join(a.what for a in nearest)}"
    elif len(problem.motion) > 1:
        line = "  no shifted, smaller or slower path was found that can be followed; command smaller motions near home"
    return line, {a.what: a.motion.position for a in nearest}


def primary(model: Model, broken: Sequence[Violation]) -> list[Violation]:
    """Of the limits that would be `broken` those that do not follow from another: where a displacement is out of range, so are the
    force, the state and the drive that would hold it there; where a state is, the drive that would lead to it."""
    left = list(broken)
    for variable in ("z", "x"):
        first = [e for e in left if model.limited_variable(e.limit, e.channel) == variable]
        if first:
            out = np.any([e.beyond > 0 for e in first], axis=0)
            out |= np.roll(out, -1) | np.roll(out, 1)  # the drive before it leads there, that after it back
            left = [e for e in left if any(e is f for f in first) or np.any((e.beyond > 0) & ~out)]
    return left


def _grouped(model: Model, causes: Sequence[Violation]) -> tuple[list[Violation], list[int]]:
    """The causes to list, and how many more channels break the same: of a limit on an expression the worst channel stands for all."""
    listed: dict[object, list[Violation]] = {}
    for cause in causes:
        composite = model.limited_variable(cause.limit, cause.channel) is None
        listed.setdefault(cause.limit.name if composite else (cause.limit.name, cause.channel), []).append(cause)
    return [broken[0] for broken in listed.values()], [len(broken) - 1 for broken in listed.values()]


def _said(model: Model, cause: Violation, held: bool) -> str:
    """What is needed of whom, against which bound, and why there is one; `held`: a limit is also broken at rest."""
    limit, channel, value = cause.limit, cause.limit.channels[cause.channel], cause.value[cause.worst]
    below, variable = value < cause.bound, model.limited_variable(limit, cause.channel)
    side, missing = "below" if below else "above", show_difference(abs(value - cause.bound), limit.unit)
    amount = f"{show(value, limit.unit)}, {missing} {side} {show(cause.bound, limit.unit)}"
    if variable == "z":
        why = "the actuator only pushes" if below and cause.bound == 0 else "its stroke ends there"
        return f"actuator {channel}: needs {amount} ({why})"
    if variable is None:
        return f"{limit.label} at {channel} would be {amount}"
    whose = limit.label if channel in limit.label.split() else f"{limit.label} of {channel}"
    needed = f"{whose} would have to be {amount}"
    if variable == "rate":
        return f"{needed} (the path is too fast)"
    if variable == "u" and not held:
        heated = below and "power" in model.signals
        return f"{needed} ({'it cannot cool faster than passively' if heated else 'the path is too fast'})"
    return needed


def _nearest_pose(model: Model, follow: str, target: np.ndarray) -> np.ndarray | None:
    """The pose that can be held nearest to `target`, by IPOPT; None where it finds none."""
    try:
        result, _ = TrajectoryProgramme(model, follow, Motion.of_samples(target[None]), Settled()).optimum()
    except SolverError:
        return None
    return result.trace.signals[follow][0]


def _runs(samples: Sequence[int]) -> str:
    """The first few runs of successive samples as text, such as '3-5, 9'."""
    runs: list[list[int]] = []
    for k in samples:
        if runs and k == runs[-1][1] + 1:
            runs[-1][1] = k
        else:
            runs.append([k, k])
    shown = [f"{a}" if a == b else f"{a}-{b}" for a, b in runs[:SHOWN_RUNS]]
    return ", ".join(shown) + (
        f", ... {number_of(len(runs) - SHOWN_RUNS, 'more run')}" if len(runs) > SHOWN_RUNS else ""
    )


def _point(signal: Signal, values: np.ndarray) -> str:
    """A sample with its non-zero channels in the reader's units; "home" where all are zero."""
    rows = zip(signal.channels, signal.units, signal.scale, values, strict=True)
    parts = [f"{c} = {from_si(v, u):.4g} {u}" for c, u, size, v in rows if abs(v) > 1e-6 * size]
    return ", ".join(parts) or "home"

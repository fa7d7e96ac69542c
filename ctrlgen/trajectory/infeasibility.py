"""Why a trajectory cannot be followed: which samples, which actuators, by how much, and what could be followed instead."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ctrlgen.core.errors import Infeasibility, SolverError, Unreachable
from ctrlgen.core.units import from_si, show, show_difference
from ctrlgen.model.model import Model, Signal
from ctrlgen.trajectory.alternatives import Alternatives, Inverse
from ctrlgen.trajectory.inverse.balanced import InverseTrajectory
from ctrlgen.trajectory.inverse.motion import Command, samples_of
from ctrlgen.trajectory.inverse.violations import Violation, violations
from ctrlgen.trajectory.optimisation import TrajectoryProgramme
from ctrlgen.trajectory.scenario import Scenario

FEASIBILITY_TOLERANCE = (
    1e-5  # typical sizes (1 um, or 1 um at the platform's rim) off the command that count as none: 10 pm
)
SHOWN_RUNS = 6  # runs of samples that a message lists
SHOWN_CAUSES = 8  # limits that it lists


def unreachable(
    scenario: Scenario, inverse: Inverse, command: Command, needed: InverseTrajectory, certain: bool = False
) -> Unreachable | None:
    """The error that names the samples, the actuators and limits, by how much, and what can be followed instead; None where
    what is `needed` breaks no limit, or perhaps none, unless it is `certain` from elsewhere that the path cannot be followed."""
    model, n, wanted = inverse.model, len(command), samples_of(command)
    causes = primary(model, needed.violations(model, scenario.sample_time, scenario.closed))
    if not needed.exact and not certain:
        # of what may still change, or is out of the equations' range, only displacements far enough out of theirs
        least = 0.0 if not needed.solved else 2 * needed.unsettled * float(model.z_scale.max())
        causes = [c for c in causes if model.limited_variable(c.limit, c.channel) == "z" and c.beyond.max() > least]
    if not causes:
        return None
    signal = model.signals[scenario.file.follow]
    samples = tuple(map(int, np.flatnonzero(np.any([c.beyond > 0 for c in causes], axis=0))))
    worst = causes[0].worst
    at = _moment(scenario)
    lines = [
        f"cannot follow {len(samples)} of {n} samples ({_runs(samples)}); the worst is sample {worst}{at(worst)}: "
        f"{_point(signal, wanted[worst])}"
    ]
    leads = (worst + 1) % n if scenario.closed else min(worst + 1, n - 1)  # where the drive of the worst sample leads
    x, z, u = (np.array(v) for v in zip(*map(inverse.at_rest, wanted[[worst, leads]]), strict=True))
    held = violations(model, x, z, u)
    listed, also = _grouped(model, causes)
    lines += [
        f"  {_said(model, cause, bool(held))}, worst at sample {cause.worst}{at(cause.worst)}, in {len(cause.samples)} of {n} "
        f"samples{f'; {others} more like it' if others else ''}"
        for cause, others in zip(listed[:SHOWN_CAUSES], also, strict=False)
    ]
    if len(listed) > SHOWN_CAUSES:
        lines.append(f"  and {len(listed) - SHOWN_CAUSES} more limits")
    nearest = _nearest_pose(model, scenario.file.follow, wanted[worst]) if held else None
    if nearest is not None:
        lines.append(f"  nearest pose of that sample that can be held: {_point(signal, nearest)}")
    line, found = instead(scenario, inverse, command, [c.worst for c in causes])
    lines += [line] * bool(line)
    return Unreachable("\n".join(lines), Infeasibility(samples, worst, wanted, nearest, found))


def instead(
    scenario: Scenario, inverse: Inverse, command: Command, worst: Sequence[int]
) -> tuple[str, dict[str, np.ndarray]]:
    """What can be followed instead of a path that breaks limits most at the samples `worst`: a line of text, empty for one pose, and
    the paths (n, channels) [SI] by what they are compared with the commanded one."""
    slowed = None if scenario.sample_time is None else scenario.slowed(inverse.model)
    signal = inverse.model.signals[scenario.file.follow]
    found = Alternatives(inverse, signal, command, scenario.closed, slowed, worst).found()
    line = ""
    if found:
        line = f"  the path can be followed {'; or '.join(a.what for a in found)}"
    elif len(command) > 1:
        line = "  no shifted, smaller or slower path was found that can be followed; command smaller motions near home"
    return line, {a.what: samples_of(a.command) for a in found}


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
    return [own[0] for own in listed.values()], [len(own) - 1 for own in listed.values()]


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
    own = f"{whose} would have to be {amount}"
    if variable == "rate":
        return f"{own} (the path is too fast)"
    if variable == "u" and not held:
        heated = below and "power" in model.signals
        return f"{own} ({'it cannot cool faster than passively' if heated else 'the path is too fast'})"
    return own


def _nearest_pose(model: Model, follow: str, target: np.ndarray) -> np.ndarray | None:
    """The pose that can be held nearest to `target`, by IPOPT; None where it finds none."""
    try:
        result, _ = TrajectoryProgramme(model, follow, target[None]).optimum()
    except SolverError:
        return None
    return result.trace.signals[follow][0]


def _moment(scenario: Scenario) -> Callable[[int], str]:
    """The text of a sample's time."""
    h = scenario.sample_time
    return lambda k: "" if h is None else f" at {show(k * h, 's')}"


def _runs(samples: Sequence[int]) -> str:
    """'3-5, 9': the first few runs of successive samples."""
    runs: list[list[int]] = []
    for k in samples:
        if runs and k == runs[-1][1] + 1:
            runs[-1][1] = k
        else:
            runs.append([k, k])
    shown = [f"{a}" if a == b else f"{a}-{b}" for a, b in runs[:SHOWN_RUNS]]
    return ", ".join(shown) + (f", ... {len(runs) - SHOWN_RUNS} more runs" if len(runs) > SHOWN_RUNS else "")


def _point(signal: Signal, values: np.ndarray) -> str:
    """A sample with its non-zero channels in the reader's units; "home" where all are zero."""
    parts = [
        f"{c} = {from_si(v, u):.4g} {u}" for c, u, v in zip(signal.channels, signal.units, values, strict=True)
        if abs(v) > 1e-6 * signal.scale[signal.channels.index(c)]
    ]  # fmt: skip
    return ", ".join(parts) or "home"

"""Why a trajectory cannot be followed: which samples, which actuators, by how much, and what is nearest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.core.errors import Infeasibility, Unreachable
from ctrlgen.core.units import from_si, show
from ctrlgen.model.feedforward import Controller
from ctrlgen.model.model import Limit, Model, Signal
from ctrlgen.trajectory.optimisation import OptimisationResult
from ctrlgen.trajectory.scenario import Scenario

FEASIBILITY_TOLERANCE = (
    1e-5  # typical sizes (1 um, or 1 um at the platform's rim) off the command that count as none: 10 pm
)
SMALLEST_EXCESS = 1e-12  # m; less beyond a stroke's end is rounding
AT_BOUND = 1e-6  # of the larger bound: a drive or state so near a bound is held there
SHOWN_RUNS = 6  # runs of samples that a message lists


def infeasibility_error(
    scenario: Scenario,
    model: Model,
    command: np.ndarray,
    relaxed: OptimisationResult,
    nearest: OptimisationResult | None,
    rows: Sequence[Limit],
) -> Unreachable:
    """The error that names the samples, the actuators or limits, by how much, and the nearest trajectory.

    `relaxed` is the solution without the limits `rows`, which it breaks; `nearest` the one that keeps every limit, None
    where IPOPT found none.
    """
    signal = model.signals[scenario.file.follow]
    excess = _excess(model, relaxed, rows)
    distance = np.linalg.norm((nearest or relaxed).unreachable_by, axis=1)
    size = distance if nearest else np.max([e.max(axis=1) for e in excess.values()], axis=0)
    samples = tuple(int(k) for k in np.flatnonzero(size > (FEASIBILITY_TOLERANCE if nearest else 0.0)))
    worst = int(np.argmax(size))
    where = f"the worst is sample {worst}: {_point(signal, command[worst])}"
    lines = [f"cannot follow {len(samples)} of {len(command)} samples ({_runs(samples)}); {where}"]
    strokes = _stroke_causes(scenario, model, command, relaxed)
    drives = _drive_causes(model, relaxed, samples) if scenario.sample_time and not strokes and not rows else []
    limits = [_limit_cause(limit, table, len(command)) for limit, table in excess.items()]
    lines += strokes + drives + limits or ["  the limits of several actuators together"]
    reached = None if nearest is None else nearest.trace.signals[scenario.file.follow]
    if reached is None:
        lines.append("  no nearest trajectory was found; shrink the path until every limit above is kept")
    else:
        lines.append(f"  nearest reachable pose of that sample: {_point(signal, reached[worst])}")
    advice = []
    if any("only pushes" in line for line in strokes):
        advice.append(
            "add a common motion that every actuator can push toward (for a hexapod: height), or shrink the path"
        )
    if any("stroke ends" in line for line in strokes) or limits:
        advice.append("shrink the path or move it toward home")
    if drives:
        advice.append("slow the path down")
    lines.append("  " + "; ".join(advice or ["shrink the path or move it"]))
    infeasibility = Infeasibility(samples, worst, command, command if reached is None else reached)
    return Unreachable("\n".join(lines), infeasibility)


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


def _stroke_causes(scenario: Scenario, model: Model, command: np.ndarray, relaxed: OptimisationResult) -> list[str]:
    """Actuators that would have to leave their displacement range."""
    kernel = Controller(model, scenario.file.follow, None).static.displacement
    needed = kernel.map(len(command))(relaxed.x.T, relaxed.z.T, command.T).full().T
    low, high = model.z_bounds
    causes = []
    for i, axis in enumerate(model.axes):
        beyond = np.maximum(low[i] - needed[:, i], needed[:, i] - high[i])
        broken = np.flatnonzero(beyond > SMALLEST_EXCESS)
        if not broken.size:
            continue
        k = int(np.argmax(beyond))
        value = needed[k, i]
        why = "the actuator only pushes" if value < low[i] == 0 else "its stroke ends there"
        bound = low[i] if value < low[i] else high[i]
        amount = f"needs {show(value, 'um')}, {show(abs(value - bound), 'um')} beyond {show(bound, 'um')} ({why})"
        causes.append(f"  actuator {axis}: {amount}, worst at sample {k}, in {broken.size} of {len(command)} samples")
    return causes


def _excess(model: Model, relaxed: OptimisationResult, rows: Sequence[Limit]) -> dict[Limit, np.ndarray]:
    """(n, channels) by which the relaxed solution exceeds each limit of `rows`, SI."""
    n = len(relaxed.u)
    p = np.tile(model.p_nominal[:, None], (1, n))
    values = model.evaluate_limits.map(n)(relaxed.x.T, relaxed.z.T, relaxed.u.T, p)
    tables = dict(zip(model.limits, values, strict=True))
    return {limit: np.maximum(tables[limit].full().T - limit.upper, 0.0) for limit in rows if limit.upper is not None}


def _limit_cause(limit: Limit, excess: np.ndarray, count: int) -> str:
    """The channel that breaks a limit most, by how much, and in how many samples."""
    k, i = np.unravel_index(int(np.argmax(excess)), excess.shape)
    value = show((limit.upper or 0.0) + excess[k, i], limit.unit)
    broken = int(np.count_nonzero(excess.max(axis=1) > 0))
    amount = f"would be {value}, {show(excess[k, i], limit.unit)} above {show(limit.upper or 0.0, limit.unit)}"
    return f"  {limit.label} at {limit.channels[i]}: {amount}, worst at sample {k}, in {broken} of {count} samples"


def _drive_causes(model: Model, result: OptimisationResult, samples: Sequence[int]) -> list[str]:
    """Actuators whose drive or state is held at a bound around the samples that are not followed."""
    slowest = "it cannot cool faster than passively" if "power" in model.signals else "that is its minimum"
    around = sorted({max(k + shift, 0) for k in samples for shift in (-1, 0)})
    causes = []
    for values, bounds, what, low_reason in (
        (result.u, model.u_bounds, model.signals["drive"], slowest),
        (
            result.x[:, : model.n_states],
            model.x_bounds,
            model.signals.get("state"),
            "it cannot fall below its value at rest",
        ),
    ):
        if what is None:
            continue
        low, high = bounds
        for i, axis in enumerate(model.axes):
            for bound, reason in ((low[i], low_reason), (high[i], "that is its maximum")):
                if np.isfinite(bound) and np.any(
                    np.abs(values[around, i] - bound) < AT_BOUND * max(abs(high[i]), abs(low[i]))
                ):
                    causes.append(f"  actuator {axis}: {what.label} is held at {show(bound, what.units[i])}; {reason}")
    return causes


def _point(signal: Signal, values: np.ndarray) -> str:
    """A sample with its non-zero channels in the reader's units; "home" where all are zero."""
    parts = [
        f"{c} = {from_si(v, u):.4g} {u}" for c, u, v in zip(signal.channels, signal.units, values, strict=True)
        if abs(v) > 1e-6 * signal.scale[signal.channels.index(c)]
    ]  # fmt: skip
    return ", ".join(parts) or "home"

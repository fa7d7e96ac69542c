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
    1e-5  # shortfall, in typical sizes (1 um, or 1 um at the platform's rim), that counts as none: 0.01 nm
)


def infeasibility_error(
    scenario: Scenario,
    model: Model,
    command: np.ndarray,
    wanted: OptimisationResult,
    nearest: OptimisationResult | None,
    rows: Sequence[Limit],
) -> Unreachable:
    """An error that says which samples, which actuators, by how much, and what is nearest.

    `wanted` is the solution without the limits `rows`, which are broken on it; `nearest` the one that keeps
    everything, None where IPOPT found none.
    """
    signal = model.signals[scenario.file.follow]
    excess = _excess(model, wanted, rows)
    short = np.linalg.norm((nearest or wanted).unreachable_by, axis=1)
    size = short if nearest else np.max([e.max(axis=1) for e in excess.values()], axis=0)
    samples = tuple(int(k) for k in np.flatnonzero(size > (FEASIBILITY_TOLERANCE if nearest else 0.0)))
    worst = int(np.argmax(size))
    where = f"the worst is sample {worst}: {_point(signal, command[worst])}"
    lines = [f"cannot follow {len(samples)} of {len(command)} samples ({_intervals(samples)}); {where}"]
    strokes = _stroke_causes(scenario, model, command, wanted)
    heats = _drive_causes(model, wanted, samples) if scenario.sample_time and not strokes and not rows else []
    limits = [_limit_cause(limit, table, len(command)) for limit, table in excess.items()]
    lines += strokes + heats + limits or ["  the limits of several actuators together"]
    reached = None if nearest is None else nearest.trace.signals[scenario.file.follow]
    if reached is None:
        lines.append("  no nearest trajectory was found; shrink the path until every limit above is kept")
    else:
        lines.append(f"  nearest reachable there: {_point(signal, reached[worst])}")
    advice = []
    if any("only pushes" in line for line in strokes):
        advice.append(
            "add a common motion that every actuator can push toward (for a hexapod: height), or shrink the path"
        )
    if any("stroke ends" in line for line in strokes) or limits:
        advice.append("shrink the path or move it toward home")
    if heats:
        advice.append("slow the path down")
    lines.append("  " + "; ".join(advice or ["shrink the path or move it"]))
    return Unreachable(
        "\n".join(lines), Infeasibility(samples, worst, command, command if reached is None else reached)
    )


def _intervals(samples: Sequence[int]) -> str:
    """'3-5, 9': runs of samples, the first few."""
    runs: list[list[int]] = []
    for k in samples:
        if runs and k == runs[-1][1] + 1:
            runs[-1][1] = k
        else:
            runs.append([k, k])
    shown = [f"{a}" if a == b else f"{a}-{b}" for a, b in runs[:6]]
    return ", ".join(shown) + (f", ... {len(runs) - 6} more runs" if len(runs) > 6 else "")


def _stroke_causes(scenario: Scenario, model: Model, command: np.ndarray, wanted: OptimisationResult) -> list[str]:
    """Actuators that would have to leave their displacement range."""
    kernel = Controller(model, scenario.file.follow, None).static.displacement
    needed = kernel.map(len(command))(wanted.x.T, wanted.z.T, command.T).full().T
    low, high = model.z_bounds
    causes = []
    for i, axis in enumerate(model.axes):
        beyond = np.maximum(low[i] - needed[:, i], needed[:, i] - high[i])
        bad = np.flatnonzero(beyond > 1e-12)
        if not bad.size:
            continue
        k = int(np.argmax(beyond))
        value = needed[k, i]
        why = "the actuator only pushes" if value < low[i] == 0 else "its stroke ends there"
        bound = low[i] if value < low[i] else high[i]
        amount = f"needs {show(value, 'um')}, {show(abs(value - bound), 'um')} beyond {show(bound, 'um')} ({why})"
        causes.append(f"  actuator {axis}: {amount}, worst at sample {k}, in {bad.size} of {len(command)}")
    return causes


def _excess(model: Model, wanted: OptimisationResult, rows: Sequence[Limit]) -> dict[Limit, np.ndarray]:
    """(n, channels) by which the relaxed solution exceeds each limit of `rows`, SI."""
    n = len(wanted.u)
    values = model.evaluate_limits.map(n)(wanted.x.T, wanted.z.T, wanted.u.T, np.tile(model.p_nominal[:, None], (1, n)))
    tables = dict(zip(model.limits, values, strict=True))
    return {limit: np.maximum(tables[limit].full().T - limit.upper, 0.0) for limit in rows if limit.upper is not None}


def _limit_cause(limit: Limit, excess: np.ndarray, count: int) -> str:
    """Which channel breaks a limit, by how much and when."""
    k, i = np.unravel_index(int(np.argmax(excess)), excess.shape)
    value = show((limit.upper or 0.0) + excess[k, i], limit.unit)
    bad = int(np.count_nonzero(excess.max(axis=1) > 0))
    amount = f"would be {value}, {show(excess[k, i], limit.unit)} above {show(limit.upper or 0.0, limit.unit)}"
    return f"  {limit.label} at {limit.channels[i]}: {amount}, worst at sample {k}, in {bad} of {count}"


def _drive_causes(model: Model, result: OptimisationResult, samples: Sequence[int]) -> list[str]:
    """Actuators whose drive or state sits on a bound around the samples that fall short."""
    slowest = "it cannot cool faster than passively" if "power" in model.signals else "that is its minimum"
    around = sorted({max(k + shift, 0) for k in samples for shift in (-1, 0)})
    causes = []
    for values, bounds, what, low_reason in (
        (result.u, model.u_bounds, model.signals["drive"], slowest),
        (result.x[:, : model.n_states], model.x_bounds, model.signals.get("state"), "it cannot go below its rest"),
    ):
        if what is None:
            continue
        low, high = bounds
        for i, axis in enumerate(model.axes):
            for bound, reason in ((low[i], low_reason), (high[i], "that is its maximum")):
                if np.isfinite(bound) and np.any(
                    np.abs(values[around, i] - bound) < 1e-6 * max(abs(high[i]), abs(low[i]))
                ):
                    causes.append(f"  actuator {axis}: {what.label} is held at {show(bound, what.units[i])}; {reason}")
    return causes


def _point(signal: Signal, values: np.ndarray) -> str:
    """A sample with its non-zero channels in the reader's units."""
    parts = [
        f"{c} = {from_si(v, u):.4g} {u}" for c, u, v in zip(signal.channels, signal.units, values, strict=True)
        if abs(v) > 1e-6 * signal.scale[signal.channels.index(c)]
    ]  # fmt: skip
    return ", ".join(parts) or "home"

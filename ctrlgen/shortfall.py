"""Why a trajectory cannot be followed: which samples, which actuators, by how much, and what is nearest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.controller import Controller
from ctrlgen.errors import Shortfall, Unreachable
from ctrlgen.model import Limit, Model, Signal
from ctrlgen.programme import Result
from ctrlgen.scenario import Scenario
from ctrlgen.units import from_si, show

REACHED = 1e-5  # shortfall, in typical sizes (1 um, or 1 um at the platform's rim), that counts as none: 0.01 nm


def unreachable(
    scenario: Scenario, model: Model, command: np.ndarray, result: Result, short: np.ndarray, rows: Sequence[Limit]
) -> Unreachable:
    """An error that says which samples, which actuators, by how much, and what is nearest."""
    signal = model.signals[scenario.file.follow]
    samples = tuple(int(k) for k in np.flatnonzero(short > REACHED))
    worst = int(np.argmax(short))
    nearest = result.trace.signals[scenario.file.follow]
    kernel = Controller(model, scenario.file.follow, None).static.displacement
    needed = kernel.map(len(command))(result.x.T, result.z.T, command.T).full().T
    low, high = model.z_bounds
    lines = [
        f"cannot follow {len(samples)} of {len(command)} samples; the worst is sample {worst}: {_point(signal, command[worst])}"
    ]
    causes = []
    for i, axis in enumerate(model.axes):
        bad = np.flatnonzero((needed[:, i] < low[i] - 1e-12) | (needed[:, i] > high[i] + 1e-12))
        if bad.size:
            k = int(bad[np.argmax(np.maximum(low[i] - needed[bad, i], needed[bad, i] - high[i]))])
            value = needed[k, i]
            why = "the actuator only pushes" if value < low[i] else "its stroke ends there"
            bound = low[i] if value < low[i] else high[i]
            causes.append(
                f"  actuator {axis}: needs {show(value, 'um')}, {show(abs(value - bound), 'um')} beyond {show(bound, 'um')} ({why}), "
                f"worst at sample {k}, in {bad.size} of {len(command)}"
            )
    if not causes:
        causes += _dynamic_causes(model, result, samples) + [
            f"  {limit.label} is at its limit of {show(limit.upper or 0.0, limit.unit)}" for limit in rows
        ]
    lines += causes or ["  the limits of several actuators together"]
    lines.append(f"  nearest reachable there: {_point(signal, nearest[worst])}")
    lines.append(
        "  move or shrink the path (a hexapod that only pushes needs height first: raise delta_z), or slow it down"
    )
    return Unreachable("\n".join(lines), Shortfall(samples, worst, command, nearest))


def _dynamic_causes(model: Model, result: Result, samples: Sequence[int]) -> list[str]:
    """Actuators whose drive or state sits on a bound around the samples that fall short."""
    around = sorted({max(k + shift, 0) for k in samples for shift in (-1, 0)})
    causes = []
    for values, bounds, what, low_reason in (
        (result.u, model.u_bounds, model.signals["drive"], "it cannot cool faster than passively"),
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

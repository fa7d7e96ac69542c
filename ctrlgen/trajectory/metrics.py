"""Metrics of a solution by name, as scenarios state expectations: 'force.1X.max', 'displacement.2Y[3]', 'margin.stroke'."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import difference_unit, from_si, parse
from ctrlgen.trajectory.solution import Solution

_STATISTICS: dict[str, Callable[[np.ndarray], np.floating]] = {
    "min": np.min,
    "max": np.max,
    "rms": lambda column: np.sqrt(np.mean(column**2)),
    "abs": lambda column: np.abs(column).max(),
}
_NAME = re.compile(r"^(\w+)\.(\w+)(?:\.(min|max|rms|abs)|\[(\d+)\])?$")


@dataclass(frozen=True)
class ExpectationResult:
    """One expectation of a scenario and the solution's value: `measured`, `low` and `high` in SI, `unit` the reader's."""

    value: str
    measured: float
    low: float
    high: float
    unit: str
    source: str

    @property
    def passed(self) -> bool:
        """Whether the measured value is in the range."""
        return self.low <= self.measured <= self.high


def force_parts(solution: Solution) -> dict[str, np.ndarray]:
    """The parts of the restoring force over the samples by name, (n, axes) [N]; empty where the device states none."""
    m = solution.model
    if not m.force_parts:
        return {}
    f = ca.Function("parts", [m.z, m.p], list(m.force_parts.values())).map(len(solution.trace.z))
    parts = f(solution.trace.z.T, np.tile(m.p_nominal[:, None], (1, len(solution.trace.z))))
    parts = parts if isinstance(parts, tuple) else (parts,)
    return {name: part.full().T for name, part in zip(m.force_parts, parts, strict=True)}


def metric(solution: Solution, name: str) -> tuple[float, str]:
    """The value of `name` in SI and the reader's unit. Raises ValueError for a name that does not exist.

    SIGNAL.CHANNEL.min|max|rms|abs (abs: the largest absolute value) or SIGNAL.CHANNEL[sample], where SIGNAL is one of the
    model's, `force_linear`, `force_nonlinear` or `error` (followed minus commanded); margin.LIMIT: the smallest distance to
    that limit.
    """
    m, match = solution.model, _NAME.match(name)
    if not match:
        raise ValueError(f"{name!r}: write SIGNAL.CHANNEL.max, SIGNAL.CHANNEL[sample] or margin.LIMIT")
    group, channel, how, index = match.groups()
    if group == "margin":
        margin = next((margin for margin in solution.margins if margin.limit.name == channel), None)
        if margin is None:
            raise ValueError(
                f"{name!r}: limits are {', '.join(margin.limit.name for margin in solution.margins)}; write one of them"
            )
        return margin.distance, difference_unit(margin.limit.unit)
    followed = solution.scenario.file.follow
    tables = {
        (signal.name if role == "state" else role): (signal, solution.trace.signals[role])
        for role, signal in m.signals.items()
    }
    tables |= {f"force_{part}": (m.signals["force"], table) for part, table in force_parts(solution).items()}
    tables["error"] = (m.signals[followed], solution.trace.signals[followed] - solution.command)
    if group not in tables:
        raise ValueError(f"{name!r}: signals are {', '.join(tables)}; write one of them")
    signal, table = tables[group]
    if channel not in signal.channels or (how is None and index is None):
        raise ValueError(f"{name!r}: write {group}.CHANNEL.max with a channel of {', '.join(signal.channels)}")
    column = table[:, signal.channels.index(channel)]
    unit = signal.units[signal.channels.index(channel)]
    if index is not None:
        if int(index) >= len(column):
            raise ValueError(f"{name!r}: samples are 0 to {len(column) - 1}; write one of them")
        return float(column[int(index)]), unit
    value = _STATISTICS[how or "abs"](column)
    return float(value), unit


def expectations(solution: Solution) -> tuple[ExpectationResult, ...]:
    """Every expectation of the scenario with the solution's value. Raises InputError listing malformed ones."""
    results, faults = [], []
    for k, expect in enumerate(solution.scenario.file.expect):
        try:
            measured, unit = metric(solution, expect.value)
            low, high = (parse(text, unit) for text in expect.range)
            if low > high:
                raise ValueError(f"range {list(expect.range)} is reversed; write the smaller bound first")
        except ValueError as error:
            faults.append(Fault(f"expect[{k}]", str(error)))
            continue
        results.append(
            ExpectationResult(expect.value, measured, low, high, unit.replace("delta_degC", "K"), expect.source)
        )
    if faults:
        raise InputError(solution.scenario.path, faults)
    return tuple(results)


def in_unit(si: float, unit: str) -> float:
    """An SI value in the reader's `unit`."""
    return float(from_si(si, unit))

"""A solved scenario: the drives over time and the margin to every limit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.tabular import Column, Reported, Tabular
from ctrlgen.core.units import from_si
from ctrlgen.devices import Limit
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import Trace
from ctrlgen.physics.euler_angles import angles_of
from ctrlgen.trajectory.frame import ROTATIONS
from ctrlgen.trajectory.inverse.violations import Before, limited_values
from ctrlgen.trajectory.late_memory import LateMemory, late_memory
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.trajectory.unstated_inertia import UnstatedInertia, unstated_inertia
from ctrlgen.trajectory.unstated_modes import UnstatedModes, unstated_modes
from ctrlgen.trajectory.unstated_stretching import UnstatedStretching, unstated_stretching


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


@dataclass(frozen=True, repr=False)
class Solution(Tabular, Reported):
    """A solved scenario, SI. `trace` holds the samples; `drive` (n, axes) acts from sample k to k + 1. `iterations` of IPOPT, or with
    inertia of Newton's method; `between_samples` (channels,) is the largest distance from the path between samples, with inertia.
    `residual`: of a path that is solved sample by sample without IPOPT, the largest of all equations [typical sizes]."""

    scenario: Scenario
    model: Model
    command: np.ndarray
    trace: Trace
    drive: np.ndarray
    margins: tuple[Margin, ...]
    iterations: int
    rows_added: tuple[str, ...]
    between_samples: np.ndarray | None = None
    residual: float | None = None

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "scenario": self.scenario.file.title,
            "samples": len(self.command),
            "tightest limit": f"{self.tightest.limit.label} of {self.tightest.channel}, {100 * (self.tightest.share or 0):.3g} % left",
            "solved by": self.solved_by,
        }

    @cached_property
    def unstated_inertia(self) -> UnstatedInertia | None:
        """What masses of the file that the model leaves out do along the path; None where there are none."""
        return unstated_inertia(self.scenario, self.model, self.command, self.trace, self.drive)

    @cached_property
    def unstated_modes(self) -> UnstatedModes | None:
        """What modes of the device that the model is condensed without do along the path; None where that is nothing."""
        return unstated_modes(self.scenario, self.model, self.command, self.trace, self.drive)

    @cached_property
    def unstated_stretching(self) -> UnstatedStretching | None:
        """What flexures do along the path whose stretching the model leaves out; None where that is nothing."""
        return unstated_stretching(self.model, self.trace, self.drive)

    @cached_property
    def late_memory(self) -> LateMemory | None:
        """What creep, which learns of the displacement half a sample late, does along the path; None where that is nothing."""
        file = self.scenario.file
        return late_memory(self.model, file.follow, self.trace, self.drive, self.scenario.sample_time)

    @cached_property
    def left_out(self) -> tuple[str, ...]:
        """In sentences what the device's file states and the model leaves out, where the path notices; and where its range ends."""
        told = (self.unstated_inertia, self.unstated_modes, self.unstated_stretching, self.late_memory)
        return (*(each.sentence() for each in told if each is not None), *self.model.device.range_remarks())

    def columns(self) -> tuple[Column, ...]:
        """Those of its trace, and the commanded signal as command.channel."""
        signal = self.model.signals[self.scenario.file.follow]
        commanded = (
            Column(f"command.{channel}", unit, from_si(self.command[:, i], unit))
            for i, (channel, unit) in enumerate(zip(signal.channels, signal.units, strict=True))
        )
        return (*self.trace.columns(), *commanded, *self.angle_columns)

    @property
    def angle_columns(self) -> tuple[Column, ...]:
        """The pose's rotation as the angles whose order the scenario states, in the order in which they turn: angle.x, ...; none where
        it states none. Raises InputError where two of them are one."""
        order, signal = self.scenario.file.angles, self.model.signals["pose"]
        if order is None:
            return ()
        places = [signal.channels.index(name) for name in ROTATIONS]
        try:
            angles = angles_of(self.trace.signals["pose"][:, places], order)
        except ValueError as error:
            raise InputError(self.scenario.path, [Fault("angles", str(error))]) from None
        told = [(axis, signal.units[places["xyz".index(axis)]]) for axis in order[:3]]
        return tuple(Column(f"angle.{axis}", unit, from_si(angles[:, i], unit)) for i, (axis, unit) in enumerate(told))

    @property
    def solved_by(self) -> str:
        """The method, with its iterations, or by how much its equations are off."""
        if self.residual is not None:
            return f"the inverse sample by sample, all equations within {self.residual:.1g} of typical sizes"
        method = "Newton's method" if self.model.inertial else "IPOPT"
        return f"{method}, {self.iterations} iterations"

    @property
    def tightest(self) -> Margin:
        """The margin with the smallest share of its range left."""
        return min((m for m in self.margins if m.share is not None), key=lambda m: m.share or 0.0)


def judged_by(solution: Solution, scenario: Scenario, model: Model) -> Solution:
    """The same drives with the margins that the limits of `model` leave; those on rates stay."""
    trace, rates = solution.trace, {limit.name for limit in model.rate_limits}
    margins = closest_margins(model, trace.x, trace.z, solution.drive, None)
    kept = [m for m in solution.margins if m.limit.name in rates]
    return replace(solution, scenario=scenario, model=model, margins=(*margins, *kept))


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

"""A device with some causes added and some of its numbers free: what a fit works on.

The nominal device is nested in every structure: an effect at its `off`, a number at its nominal.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.estimation.device_with_causes import device_with_causes
from ctrlgen.estimation.free_parameters import FreeParameter, free_parameters
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, is_of_effect, nominal_physics
from ctrlgen.estimation.late_readings import effects_apart
from ctrlgen.estimation.simulator import Simulator, compiled_simulator
from ctrlgen.recordings.recording import Timing

# Of a number: 5 % off, the steps of an axis that is read twice in a period of its own raise the objective by 0.7, 10 % off by 1.9, 38 % off
# by 98 (the axis of tests/test_expanded_again.py)
FAR = 0.05
FULL = 1e-3
"""Share of the range of a delay within which it is as long as the samples that are kept for it."""


@dataclass(frozen=True, eq=False)
class Structure:
    """`device` as described, with `causes` and their starting values ({parameter: SI}, one mapping a cause).

    `nominal_starts`: where a fit begins of the device's uncertain numbers, by path [SI]; those not given begin as stated.
    `expansion`: the values of the causes about which a simulator is expanded, as `starts`, and those where None. They are where each
    cause was first suspected, wherever a later fit of the structure begins.
    `free`: the numbers that are free, None for the device's uncertain ones and the parameters of the causes.
    `finer`: how many times the integrator's own steps a simulation takes.
    """

    device: Device
    causes: tuple[Hypothesis, ...] = ()
    starts: tuple[dict[str, float], ...] = ()
    nominal_starts: dict[str, float] = field(default_factory=dict)
    expansion: tuple[dict[str, float], ...] | None = None
    free: tuple[FreeParameter, ...] | None = None
    finer: int = 1

    def __getstate__(self) -> dict[str, Any]:
        """Its fields: what is derived from them need not be sent to another process, and cannot be where a user wrote the device."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def expanded_at(self) -> tuple[dict[str, float], ...]:
        """The values of the causes about which a simulator is expanded, one mapping a cause."""
        return self.starts if self.expansion is None else self.expansion

    def with_cause(self, cause: Hypothesis, start: dict[str, float]) -> Structure:
        """This structure with one cause more."""
        return replace(
            self,
            causes=(*self.causes, cause),
            starts=(*self.starts, start),
            expansion=(*self.expanded_at, start),
        )

    def without(self, index: int) -> Structure:
        """This structure with one cause less."""
        causes, starts, expansion = (
            (*row[:index], *row[index + 1 :]) for row in (self.causes, self.starts, self.expanded_at)
        )
        return replace(self, causes=causes, starts=starts, expansion=expansion)

    def restarted(self, index: int, start: dict[str, float]) -> Structure:
        """The same with the fit of one cause begun elsewhere."""
        starts = (*self.starts[:index], start, *self.starts[index + 1 :])
        return replace(self, starts=starts, expansion=self.expanded_at)

    def expanded_again(self) -> Structure:
        """The same, expanded about the starts of those causes that are numbers of the device, where one is `FAR` from where it was first
        suspected: the steps of an integrator that is expanded about another stiffness are as far off as if they were longer."""
        here, there = list(self.expanded_at), self.starts
        for k, cause in enumerate(self.causes):
            if cause.effect == PARAMETER and abs(there[k]["value"] - here[k]["value"]) > FAR * abs(there[k]["value"]):
                here[k] = there[k]
        return self if tuple(here) == self.expanded_at else replace(self, expansion=tuple(here))

    def halved(self, known: Collection[Hypothesis]) -> Structure:
        """The same with the causes that are not `known` begun, and expanded, with half the amplitude: at the whole one, no such
        device may stand."""
        starts, expansion = list(self.starts), list(self.expanded_at)
        for k, cause in enumerate(self.causes):
            if cause in known or cause.effect == PARAMETER:
                continue
            if (p := cause.law.amplitude()).name in starts[k]:
                off = cause.channel_on(self.device).si(p.off or 0.0, p)
                starts[k] = expansion[k] = starts[k] | {p.name: (starts[k][p.name] + off) / 2}
        return replace(self, starts=tuple(starts), expansion=tuple(expansion))

    @property
    def log_prior_odds(self) -> float:
        """The sum of the log prior odds of its causes."""
        return sum(c.prior.log_prior_odds + c.machine_odds for c in self.causes)

    def cause_of(self, parameter: FreeParameter) -> Hypothesis:
        """The cause that a parameter belongs to. Raises ValueError for one of the device's own."""
        if parameter.cause is None:
            raise ValueError(f"{parameter.path} belongs to the device, not to a cause")
        return self.causes[parameter.cause]

    def plausible_range(self, unknown: FreeParameter) -> tuple[float, float] | None:
        """The range [SI] outside of which an amplitude means something else than its effect's name says."""
        cause = self.cause_of(unknown)
        if cause.effect == PARAMETER:
            return None
        p = cause.law.amplitude()
        plausible = cause.prior.of(p).plausible_range
        if plausible is None:
            return None
        channel = cause.channel_on(self.device)
        return channel.si(plausible[0], p), channel.si(plausible[1], p)

    @cached_property
    def device_with_causes(self) -> Device:
        """The device with the causes at their starting values."""
        return device_with_causes(self.device, self.causes, self.starts)

    @cached_property
    def expanded_device(self) -> Device:
        """The device with the causes where a simulator is expanded: what is simulated, with other values of the free numbers."""
        return device_with_causes(self.device, self.causes, self.expanded_at)

    @cached_property
    def free_parameters(self) -> tuple[FreeParameter, ...]:
        """The numbers given as `free`; else the device's uncertain ones, then every parameter of every cause. A delay of which a simulator
        keeps every sample goes as far as these."""
        if self.free is not None:
            return self.free
        found = tuple(free_parameters(self.device, self.causes, self.starts))
        kept = self._kept_shifts(found)
        return tuple(replace(p, high=min(p.high, kept[i])) if i in kept else p for i, p in enumerate(found))

    def _kept_shifts(self, found: Sequence[FreeParameter]) -> dict[int, float]:
        """How far each of the numbers `found`, by its place among them, may shift a reading [s] with the samples that a simulator keeps;
        those alone of which it keeps samples."""
        device = self.expanded_device
        places = {
            i: int(p.path.removeprefix("effect[").partition("]")[0])
            for i, p in enumerate(found)
            if p.cause is not None and p.amplitude and is_of_effect(p.path)
        }
        late = {i: k for i, k in places.items() if device.effect[k].late_by}
        if not late:
            return {}
        apart = effects_apart(device, nominal_physics(self.device), [p.path for p in found])
        steps = {i: self.cause_of(found[i]).sample_time for i in late}
        return {i: device.effect[k].reaches(steps[i]) for i, k in late.items() if k not in apart}

    def with_room(self, theta: np.ndarray | None = None) -> Structure:
        """The same with those delays begun, and expanded, where they start, or end at `theta` (k,), that are as long there as the samples
        kept for them: as many are kept again and more."""
        begun = self
        for i in self._kept_shifts(self.free_parameters):
            p = self.free_parameters[i]
            assert p.cause is not None
            there = self.starts[p.cause][p.name] if theta is None else float(theta[i])
            full = there >= p.high - FULL * (p.high - p.low)
            if full and there > self.expanded_at[p.cause][p.name]:
                begun = begun.restarted(p.cause, begun.starts[p.cause] | {p.name: there})
                here = begun.expanded_at
                expansion = (*here[: p.cause], here[p.cause] | {p.name: there}, *here[p.cause + 1 :])
                begun = replace(begun, expansion=expansion)
        return begun

    @cached_property
    def start(self) -> np.ndarray:
        """Where a fit begins, one SI number a free parameter."""
        values = []
        for p in self.free_parameters:
            begin = self.nominal_starts.get(p.path, p.nominal) if p.cause is None else self.starts[p.cause][p.name]
            values.append(min(max(begin, p.low), p.high))
        return np.array(values)

    def simulator(self, channels: tuple[str, ...], timing: Timing) -> Simulator:
        """The compiled simulator of the readings `channels` for records of one timing."""
        paths = tuple(p.path for p in self.free_parameters)
        return compiled_simulator(self.expanded_device, paths, channels, timing, self.finer)

"""A device with some causes added and some of its numbers free: what a fit works on.

The nominal device is nested in every structure: an effect at its `off`, a number at its nominal.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from ctrlgen.core.units import Quantity, written_unit
from ctrlgen.devices import Device
from ctrlgen.devices.changed_numbers import changed, written
from ctrlgen.effects import Channel, Param
from ctrlgen.estimation.hypothesis import (
    PARAMETER,
    Hypothesis,
    nominal_physics,
    nuisances,
    numbers,
)
from ctrlgen.estimation.settings import FIT
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.model.assembly import movable
from ctrlgen.model.effect_terms import channels, partner_channels
from ctrlgen.recordings.recording import Recording, Timing


@dataclass(frozen=True)
class FreeParameter:
    """One free number [SI]: `sd` is its stated deviation from `nominal`, None where nothing is known beforehand.

    `cause` is the place of its hypothesis in the structure, None for the device's own uncertain numbers.
    """

    path: str
    unit: str
    nominal: float
    low: float
    high: float
    size: float
    sd: float | None = None
    cause: int | None = None
    amplitude: bool = False

    @property
    def name(self) -> str:
        """Of the parameter in its effect; "value" for a number of the device."""
        return self.path.rpartition(".")[2] if self.path.startswith("effect[") else "value"


@dataclass(frozen=True, eq=False)
class Structure:
    """`device` as described, with `causes` and their starting values ({parameter: SI}, one mapping a cause).

    `nominal_starts`: where a fit begins of the device's uncertain numbers, by path [SI]; those not given begin as stated.
    """

    device: Device
    causes: tuple[Hypothesis, ...] = ()
    starts: tuple[dict[str, float], ...] = ()
    nominal_starts: dict[str, float] = field(default_factory=dict)

    def __getstate__(self) -> dict[str, Any]:
        """Its fields: what is derived from them need not be sent to another process, and cannot be where a user wrote the device."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def with_cause(self, cause: Hypothesis, start: dict[str, float]) -> Structure:
        """The same with one cause more."""
        return replace(self, causes=(*self.causes, cause), starts=(*self.starts, start))

    def without(self, index: int) -> Structure:
        """The same with one cause less."""
        keep = [k for k in range(len(self.causes)) if k != index]
        return replace(self, causes=tuple(self.causes[k] for k in keep), starts=tuple(self.starts[k] for k in keep))

    def restarted(self, index: int, start: dict[str, float]) -> Structure:
        """The same with the fit of one cause begun elsewhere."""
        return replace(self, starts=(*self.starts[:index], start, *self.starts[index + 1 :]))

    def halved(self, known: Collection[Hypothesis]) -> Structure:
        """The same with the causes that are not `known` begun with half the amplitude."""
        starts = list(self.starts)
        for k, cause in enumerate(self.causes):
            if cause in known or cause.effect == PARAMETER:
                continue
            if (p := cause.law.amplitude()).name in starts[k]:
                off = self.channel_of(cause).si(p.off or 0.0, p)
                starts[k] = starts[k] | {p.name: (starts[k][p.name] + off) / 2}
        return replace(self, starts=tuple(starts))

    @property
    def log_prior_odds(self) -> float:
        """The sum over its causes."""
        return sum(c.prior.log_prior_odds for c in self.causes)

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
        channel = self.channel_of(cause)
        return channel.si(plausible[0], p), channel.si(plausible[1], p)

    def channel_of(self, cause: Hypothesis) -> Channel:
        """The channel at which a cause acts; the first one where it acts at all of them."""
        physics, law = nominal_physics(self.device), cause.law
        every = {c.name: c for c in channels(physics, law.place)}
        own = next(iter(every.values())) if cause.at == "all" else every[cause.at]
        if cause.of is None:
            return own
        return own.paired_with(next(c for c in partner_channels(physics, law) if c.name == cause.of))

    @cached_property
    def device_with_causes(self) -> Device:
        """The device with the causes' effects at their starting values."""
        added, values = [], {}
        for cause, start in zip(self.causes, self.starts, strict=True):
            if cause.effect == PARAMETER:
                number = next(q for path, _, q in numbers(self.device) if path == cause.path)
                low, high = _reach(number)
                values[cause.path] = min(max(start["value"], low), high)  # a stage of negative size cannot be built
                continue
            channel = self.channel_of(cause)
            law = cause.law
            numbers_ = {
                p.name: written(_inside(_fixed(start[p.name], p, cause, channel), p, channel), channel.unit_of(p))
                for p in law.params
            }
            added.append(law(cause.at, numbers_, cause.of))
        return changed(self.device, values).model_copy(update={"effect": (*self.device.effect, *added)})

    @cached_property
    def free_parameters(self) -> tuple[FreeParameter, ...]:
        """The device's uncertain numbers, then every parameter of every cause."""
        causes = {c.path for c in self.causes if c.effect == PARAMETER}
        acting = _movable(self.device)
        sections = {path: (section, number) for path, section, number in numbers(self.device)}
        rows = []
        for path, sd in nuisances(self.device).items():
            if path in acting and path not in causes:
                q = sections[path][1]
                rows.append(
                    FreeParameter(path, written_unit(q.text), q.si, *_around(q.si, FIT.nuisance_reach * sd), sd, sd)
                )
        k = len(self.device.effect)
        for index, (cause, start) in enumerate(zip(self.causes, self.starts, strict=True)):
            if cause.effect == PARAMETER:
                q = sections[cause.path][1]
                rows.append(
                    FreeParameter(
                        cause.path,
                        written_unit(q.text),
                        q.si,
                        *_reach(q),
                        (abs(q.si) or 1e-3) * 1e-3,
                        None,
                        index,
                        True,
                    )
                )
                continue
            channel, law = self.channel_of(cause), cause.law
            for p in law.params:
                if cause.prior.of(p).fixed_range:  # present or absent: nothing to fit
                    continue
                low, high = cause.bounds(p, channel)
                off = 0.0 if p.off is None else channel.si(p.off, p)
                size = (
                    max(abs(start[p.name] - off), 1e-6 * (high - low))
                    if p.off is not None
                    else abs(start[p.name]) or high - low
                )
                rows.append(
                    FreeParameter(
                        f"effect[{k}].{p.name}",
                        channel.unit_of(p),
                        off,
                        low,
                        high,
                        size,
                        None,
                        index,
                        p is law.amplitude(),
                    )
                )
            k += 1
        return tuple(rows)

    @cached_property
    def start(self) -> np.ndarray:
        """Where a fit begins, one SI number an unknown."""
        values = []
        for unknown in self.free_parameters:
            if unknown.cause is None:
                values.append(
                    min(max(self.nominal_starts.get(unknown.path, unknown.nominal), unknown.low), unknown.high)
                )
            else:
                values.append(min(max(self.starts[unknown.cause][unknown.name], unknown.low), unknown.high))
        return np.array(values)

    def simulators(self, recording: Recording, cache: dict[Any, Any]) -> dict[Timing, Simulator]:
        """One simulator for every timing in the recording."""
        timings = {r.timing for r in recording.records}
        free = tuple(u.path for u in self.free_parameters)
        found = {}
        for timing in timings:
            key = (self.causes, timing, tuple(cause.effect for cause in self.causes))
            if key not in cache:
                cache[key] = Simulator(self.device_with_causes, free, recording.channels, *timing)
            found[timing] = cache[key]
        return found


def _fixed(value: float, p: Param, cause: Hypothesis, channel: Channel) -> float:
    """The middle of the range in which an amplitude is fixed; the value where it is free."""
    fixed = cause.prior.of(p).fixed_range
    return value if fixed is None else channel.si(sum(fixed) / 2, p)


def _inside(value: float, p: Param, channel: Channel) -> float:
    low, high = (channel.si(b, p) for b in p.bounds)
    return min(max(value, low), high)


def _around(value: float, reach: float) -> tuple[float, float]:
    """Bounds of an uncertain number, which does not change its sign."""
    low, high, least = value - reach, value + reach, FIT.smallest_share * value
    return (max(low, least), high) if value > 0 else (low, min(high, least)) if value < 0 else (low, high)


def _reach(number: Quantity) -> tuple[float, float]:
    """How far a suspected number is looked for [SI]: a tenth to ten times of it, half a radian for an angle."""
    span = (
        (abs(number.si) or 1e-3) * FIT.suspected_reach
        if written_unit(number.text) not in ("deg", "rad")
        else FIT.suspected_angle
    )
    return number.si - span, number.si + 10 * span


_MOVABLE: dict[int, tuple[Device, frozenset[str]]] = {}


def _movable(device: Device) -> frozenset[str]:
    if id(device) not in _MOVABLE:
        _MOVABLE.clear()  # the device is kept with its answer, so that no other one gets its id meanwhile
        _MOVABLE[id(device)] = (device, frozenset(movable(device)))
    return _MOVABLE[id(device)][1]

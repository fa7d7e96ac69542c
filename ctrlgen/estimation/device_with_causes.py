"""A device with suspected causes added to it: effects of the library, and numbers of its own at other values."""

from __future__ import annotations

from collections.abc import Sequence

from ctrlgen.devices import Device
from ctrlgen.devices.changed_numbers import changed, written
from ctrlgen.effects import Channel, Effect, Param
from ctrlgen.estimation.free_parameters import suspected_range
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, numbers
from ctrlgen.estimation.number_sizes import sizes_of_numbers


def device_with_causes(device: Device, causes: Sequence[Hypothesis], values: Sequence[dict[str, float]]) -> Device:
    """`device` with the `causes` at their `values` ({parameter: SI}, one mapping a cause), as far as they can be built."""
    described = {path: number for path, _, number in numbers(device)}
    effects, changes = [], {}
    for cause, value in zip(causes, values, strict=True):
        if cause.effect == PARAMETER:
            low, high = suspected_range(cause, described[cause.path], sizes_of_numbers(device)[cause.path])
            # a stage of negative size cannot be built
            changes[cause.path] = min(max(value["value"], low), high)
        else:
            effects.append(_effect(cause, cause.channel_on(device), value))
    device = changed(device, changes)
    return device.model_copy(update={"effect": (*device.effect, *effects)})


def _effect(cause: Hypothesis, channel: Channel, values: dict[str, float]) -> Effect:
    """The effect of a cause; an amplitude that is present or absent in the middle of its range."""
    quantities = {}
    for p in cause.law.params:
        fixed = cause.prior.of(p).fixed_range
        value = values[p.name] if fixed is None else channel.si(sum(fixed) / 2, p)
        quantities[p.name] = written(_inside(value, p, channel), channel.unit_of(p))
    return cause.law(cause.at, quantities, cause.of)


def _inside(value: float, p: Param, channel: Channel) -> float:
    low, high = (channel.si(b, p) for b in p.bounds)
    return min(max(value, low), high)

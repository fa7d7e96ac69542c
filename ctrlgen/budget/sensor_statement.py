"""[sensor] of uncertainty.toml: how well the sensor is known with which runs are learnt from and specimens are calibrated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType

from ctrlgen.budget.deviation import Deviation, parse_share
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import parse_difference, shown_difference_unit
from ctrlgen.devices import Signal
from ctrlgen.devices.section import Section


class SensorSection(Section):
    """What is not known exactly of the sensor that reads the followed signal. It moves no open-loop drive by itself: learning from runs
    leaves to the sensor what it may feign, and `budget` counts it, since drives learnt and numbers calibrated with this sensor carry its
    error. Calibration, which has no scenario, takes an `sd` of the sensor laws in the device file instead."""

    scale: Deviation | None = None
    """Of every channel's scale, as a share, such as "0.1 %", independent of each other."""
    zero: dict[str, Deviation] = {}
    """Of the zero at the beginning of the first run, by channel, such as `delta_x = { sd = "5 nm", source = "..." }`; left out: it
    is known."""
    clock: Deviation | None = None
    """Of the moments at which it is read, against those at which the drives change, such as "20 us"."""


@dataclass(frozen=True)
class Known:
    """A standard deviation [SI] with its text and source."""

    sd: float
    text: str
    source: str


@dataclass(frozen=True)
class SensorStatement:
    """How well a sensor is known: a share of its `scale`, its `zero` [SI] by channel, its `clock` [s]; None where nothing is stated."""

    scale: Known | None = None
    zero: Mapping[str, Known] = field(default_factory=lambda: MappingProxyType({}))
    clock: Known | None = None


def stated_sensor(section: SensorSection | None, signal: Signal, path: Path | str) -> SensorStatement:
    """The statement of a file at `path` about the channels of a `signal`. Raises InputError with every fault."""
    if section is None:
        return SensorStatement()
    faults = list[Fault]()

    def known(where: str, stated: Deviation | None, read: Callable[[str], float]) -> Known | None:
        if stated is None:
            return None
        try:
            sd = read(stated.sd)
            if sd < 0:
                raise ValueError(f"{stated.sd!r} is below zero")
        except ValueError as error:
            faults.append(Fault(f"sensor.{where}.sd", str(error)))
            return None
        return Known(sd, stated.sd, stated.source)

    units = dict(zip(signal.channels, signal.units, strict=True))
    zeros = dict[str, Known]()
    for channel, stated in section.zero.items():
        if channel not in units:
            faults.append(Fault(f"sensor.zero.{channel}", f"is not a channel; they are {', '.join(units)}"))
            continue
        unit = shown_difference_unit(units[channel])
        zero = known(f"zero.{channel}", stated, partial(parse_difference, unit=unit))
        if zero is not None:
            zeros[channel] = zero
    scale = known("scale", section.scale, parse_share)
    clock = known("clock", section.clock, partial(parse_difference, unit="s"))
    if faults:
        raise InputError(path, faults)
    return SensorStatement(scale, zeros, clock)

"""What all actuators have that follow their drive in proportion: its range, its rate, its lag; and what they make of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Annotated, Any

import casadi as ca
from pydantic import field_validator, model_validator

from ctrlgen.core.names import Name
from ctrlgen.core.units import In, Quantity, same_dimension, written_unit
from ctrlgen.devices.limit import Limit, rate_limit
from ctrlgen.devices.section import Section
from ctrlgen.devices.signal import AxisSignal, Signal

PerDrive = Annotated[Quantity, In(None)]


class Driven(Section):
    """An actuator and the range of its drive."""

    name: Name
    """Of the axis and its drive."""
    low: PerDrive
    """Lowest drive; its unit is that of the drive."""
    high: PerDrive
    """Highest drive."""
    rate: tuple[PerDrive, PerDrive] | None = None
    """Largest change of the drive by time, such as "5 V/ms", or the lowest and the highest, such as ["-2 V/ms", "5 V/ms"]."""
    time_constant: Annotated[Quantity, In("ms", positive=True)] | None = None
    """Time constant with which the actuator follows the drive; left out: at once."""

    @field_validator("rate", mode="before")
    @classmethod
    def _is_to_both_sides(cls, stated: Any) -> Any:
        """Reads a single rate as the largest to both sides."""
        return (f"-{stated}", stated) if isinstance(stated, str) else stated

    @model_validator(mode="after")
    def _has_a_range(self) -> Driven:
        faults = []
        if self.rate is not None:
            slowest, fastest = self.rate
            if any(not same_dimension(written_unit(q.text), f"({self.drive_unit})/s") for q in self.rate):
                faults.append(
                    f"rate: {fastest.text!r} is no rate of a drive in {self.drive_unit}; write for example {self.drive_unit}/ms"
                )
            elif not slowest.si < 0 < fastest.si:
                faults.append("rate: must be above zero, or a rate below zero and one above")
        if not same_dimension(self.drive_unit, written_unit(self.high.text)):
            faults.append(f"high: {self.high.text!r} is not of the dimension of low = {self.low.text!r}")
        elif not self.low.si < self.high.si:
            faults.append(f"low = {self.low.text!r} is not below high = {self.high.text!r}")
        if faults:
            raise ValueError("; ".join(faults))
        return self

    @property
    def drive_unit(self) -> str:
        """The unit in which the drive is written."""
        return written_unit(self.low.text)

    @property
    def largest_drive(self) -> float:
        """The largest size of its drive [SI]."""
        return max(abs(self.low.si), abs(self.high.si))

    def gain_faults(self, gain: Quantity, wanted: str, what: str) -> list[str]:
        """What is wrong with a `gain` that shall give a `what` in `wanted` per drive."""
        if same_dimension(f"({written_unit(gain.text)})*({self.drive_unit})", wanted):
            return []
        said = f"{gain.text!r} is no {what} per drive in {self.drive_unit}"
        return [f"gain: {said}; write for example {wanted}/{self.drive_unit}"]


@dataclass(frozen=True)
class Transduction:
    """Drive u, heat w = heat(u), states x' = rates(x, w), force(u, x) (n,) on the axes; `drive_range` and `state_range` by axis [SI].
    `power` shows the heat of heaters."""

    drive: Signal
    drive_range: tuple[tuple[float, float], ...]
    force: Callable[[ca.SX, ca.SX], ca.SX]
    force_scale: float
    state: Signal | None = None
    rest: tuple[float | ca.SX, ...] = ()
    state_range: tuple[tuple[float, float], ...] = ()
    rates: Callable[[ca.SX, ca.SX], ca.SX] = lambda x, heat: ca.SX(0, 1)
    heat: Callable[[ca.SX], ca.SX] = lambda u: u
    power: AxisSignal | None = None

    def limits(self, signal: SimpleNamespace) -> list[Limit]:
        """The ranges of drive and state, axis by axis."""
        limits = []
        for name, of, expr, ranges in (
            ("drive", self.drive, signal.drive, self.drive_range),
            ("output" if self.power is None else "temperature", self.state, signal.state, self.state_range),
        ):
            if of is not None:
                for i, (axis, unit, span) in enumerate(zip(of.channels, of.units, ranges, strict=True)):
                    limits.append(Limit(f"{name}_{axis}", f"{of.label} of {axis}", (axis,), unit, expr[i], *span))
        return limits

    def rate_limits(self, sections: Sequence[Any]) -> tuple[Limit, ...]:
        """The rates that the tables of the actuators state, axis by axis."""
        return tuple(
            rate_limit(self.drive, i, s.rate[0].si, s.rate[1].si, written_unit(s.rate[1].text))
            for i, s in enumerate(sections)
            if getattr(s, "rate", None) is not None
        )


def proportional(
    axes: tuple[str, ...], sections: Sequence[Driven], gains: Sequence[Any], sizes: Sequence[float], lags: Sequence[Any]
) -> Transduction:
    """What actuators make of their drives: gain times drive, at once or with a lag of first order, `lags` of all or None of all.

    `gains` and `lags` (n,) are SI numbers or symbols, `sizes` (n,) the gains as the file states them.
    """
    units, ranges = tuple(s.drive_unit for s in sections), tuple((s.low.si, s.high.si) for s in sections)
    largest = tuple(s.largest_drive for s in sections)
    gain, n = ca.vertcat(*gains), len(axes)
    drive = Signal("drive", "drive", axes, units, "u_", ca.SX.sym("u", n), largest)
    scale = float(max(abs(g) * size for g, size in zip(sizes, largest, strict=True)))
    if any(tau is None for tau in lags):
        return Transduction(drive, ranges, lambda u, x: gain * u, scale)
    state = Signal("state", "amplifier output", axes, units, "x_", ca.SX.sym("x", n), largest)
    rates = lambda x, u: (u - x) / ca.vertcat(*lags)  # noqa: E731
    return Transduction(drive, ranges, lambda u, x: gain * x, scale, state, (0.0,) * n, ranges, rates)

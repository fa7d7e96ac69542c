"""The numbers that a fit may change: uncertain numbers of the device, and the parameters of suspected causes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

from ctrlgen.core.units import Quantity, written_unit
from ctrlgen.devices import Device
from ctrlgen.effects import Channel, Effect, Param
from ctrlgen.estimation.hypothesis import DEVICES_KEPT, PARAMETER, Hypothesis, is_of_effect, numbers
from ctrlgen.estimation.number_sizes import sizes_of_numbers
from ctrlgen.estimation.settings import FIT
from ctrlgen.model.assembly import movable

SHAPE_AT_BOUND = 1e-3
"""Share of the range of a shape, or of itself where it is positive, within which it is at its bound: a fit stops there, since what
the shape changes fades toward it."""


@dataclass(frozen=True)
class FreeParameter:
    """One free number [SI]: `sd` is its stated deviation from `nominal`, None where nothing is known beforehand.

    `cause` is the place of its hypothesis in the structure, None for the device's own uncertain numbers. `stated`: it is a number of the
    device file that a cause says is wrong.
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
    stated: bool = False

    @property
    def name(self) -> str:
        """The parameter's name in its effect; "value" for a number of the device."""
        return self.path.rpartition(".")[2] if is_of_effect(self.path) and not self.stated else "value"

    def shape_ends(self, value: float) -> tuple[bool, bool]:
        """Whether a fit that leaves this number of a law, no amplitude, at `value` has ended at its low bound, at its high one."""
        span = SHAPE_AT_BOUND * (value if self.low > 0 else self.high - self.low)
        return value <= self.low + span, value >= self.high - span


def free_parameters(
    device: Device, causes: Sequence[Hypothesis], starts: Sequence[dict[str, float]]
) -> Iterator[FreeParameter]:
    """The device's uncertain numbers, then every parameter of every cause; a fit begins the causes at `starts` [SI]."""
    described = {path: number for path, _, number in numbers(device)}
    suspected = {c.path for c in causes if c.effect == PARAMETER}
    for path, sd in nuisances(device).items():
        if path in _movable(device) and path not in suspected:
            q = described[path]
            yield FreeParameter(path, written_unit(q.text), q.si, *_around(q.si, FIT.nuisance_reach * sd), sd, sd)
    place = len(device.effect)
    for index, (cause, start) in enumerate(zip(causes, starts, strict=True)):
        if cause.effect == PARAMETER:
            yield _suspected_number(device, cause, described[cause.path], index)
            continue
        channel = cause.channel_on(device)
        for p in cause.law.params:
            # one with a fixed range is present or absent: nothing to fit
            if not cause.prior.of(p).fixed_range:
                yield _law_parameter(f"effect[{place}].{p.name}", p, cause, channel, start[p.name], index)
        place += 1


def _suspected_number(device: Device, cause: Hypothesis, number: Quantity, index: int) -> FreeParameter:
    """A number of the device that the cause `index` says is wrong."""
    unit, typical = written_unit(number.text), sizes_of_numbers(device)[cause.path]
    low, high = suspected_range(cause, number, typical)
    size = FIT.suspected_step * typical
    return FreeParameter(cause.path, unit, number.si, low, high, size, cause=index, amplitude=True, stated=True)


def _law_parameter(path: str, p: Param, cause: Hypothesis, channel: Channel, start: float, index: int) -> FreeParameter:
    """The parameter p of the law of the cause `index`; its size is how far `start` is from off. A period that begins where the records show
    that it repeats stays there."""
    low, high = cause.bounds(p, channel)
    if cause.prior.of(p).start_from_data == "spatial_periods" and low < start <= cause.longest_period:
        high = min(high, cause.longest_period)
    off = 0.0 if p.off is None else channel.si(p.off, p)
    size = abs(start) or high - low
    if p.off is not None:
        size = max(abs(start - off), 1e-6 * (high - low))
    amplitude = p is cause.law.amplitude()
    return FreeParameter(path, channel.unit_of(p), off, low, high, size, cause=index, amplitude=amplitude)


def suspected_range(cause: Hypothesis, number: Quantity, size: float) -> tuple[float, float]:
    """How far a suspected number of typical `size` [SI] is looked for: a tenth to ten times of it, half a radian for an angle; of a shift
    in time from none on."""
    if cause.shifts:
        return 0.0, cause.longest
    span = size * FIT.suspected_reach
    if written_unit(number.text) in ("deg", "rad"):
        span = FIT.suspected_angle
    return number.si - span, number.si + 10 * span


def nuisances(device: Device) -> dict[str, float]:
    """Path and standard deviation [SI] of every number with a stated `sd`, or of a section with a tolerance."""
    sds = {}
    for path, section, number in numbers(device):
        if isinstance(section, Effect):
            continue  # suspected, but no nuisance: a simulator keeps every sample of a delay that is free
        sd = number.sd if number.sd is not None else (section.relative_sd or 0.0) * abs(number.si)
        if sd and not number.whole:
            sds[path] = sd
    return sds


def _around(value: float, reach: float) -> tuple[float, float]:
    """Bounds of an uncertain number, which does not change its sign."""
    low, high, least = value - reach, value + reach, FIT.smallest_share * value
    return (max(low, least), high) if value > 0 else (low, min(high, least)) if value < 0 else (low, high)


@lru_cache(maxsize=DEVICES_KEPT)
def _movable(device: Device) -> frozenset[str]:
    return frozenset(movable(device))

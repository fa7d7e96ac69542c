"""The numbers of a law, and what their units mean at one channel of a device."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

from ctrlgen.core.units import split_unit, to_si

PLACEHOLDERS = ("channel", "travel", "partner", "force")
MOTION = (*PLACEHOLDERS, "s")
TIME = (*PLACEHOLDERS, "s", "Hz")
PACES = (1e-6, 1e6)
"""`Channel.pace` of a sample a nanosecond, and of one in a quarter of an hour: how fast any machine is."""


@dataclass(frozen=True)
class Param:
    """One number of a law: `bounds` in its `unit`; at `off` the whole effect vanishes (of one parameter, the amplitude).

    In `unit` the word `channel` stands for the unit of the signal that the effect acts on, `travel` for that of the stage
    displacement, `partner` for that of the other channel of a pair and `force` for that of the stage's force. Bounds then count in
    typical sizes of these signals, so that one law serves micrometres and degrees, nanonewtons and kilonewtons; beside `travel` the `s`
    counts in typical times (`Channel.time`), so that it serves a fan and a resonator. Of one that is `paced` bounds are those of records
    with a sample a millisecond and go with the sample time (`Channel.pace`): a scanner's filter and an oven's.
    """

    name: str
    unit: str
    bounds: tuple[float, float]
    doc: str
    off: float | None = None
    paced: bool = False

    @property
    def relative(self) -> bool:
        """Whether the unit depends on where the effect acts."""
        return _is_relative(self.unit)

    @property
    def of_motion(self) -> bool:
        """Whether it is a speed, or counts per speed or acceleration: how fast a machine moves no file says, but its records."""
        return "travel" in split_unit(self.unit, MOTION)[0] and "s" in split_unit(self.unit, MOTION)[0]

    @property
    def example(self) -> float:
        """A number within the bounds, in their unit, far from both: their geometric mean where both are positive, else a tenth of the way
        from the lower one, or from zero, to the upper one."""
        low, high = self.bounds
        return math.sqrt(low * high) if low > 0 else 0.1 * high + 0.9 * (low if high <= 0 else 0.0)

    @property
    def powers_of_time(self) -> float:
        """With which power of a time it goes: -1 of a rate or a frequency."""
        powers = split_unit(self.unit, TIME)[0]
        return powers.get("s", 0.0) - powers.get("Hz", 0.0)

    def at_any_pace(self, low: float, high: float) -> tuple[float, float]:
        """Its bounds over all `PACES`, from those of records with a sample a millisecond."""
        ends = [bound * pace**self.powers_of_time for bound in (low, high) for pace in PACES]
        return min(ends), max(ends)


@dataclass(frozen=True)
class State:
    """A memory of the effect, zero at rest; `scale` is a typical size in `unit`, counted as in `Param`.

    A `stepped` one changes once a sample, by `update`; a `ramp` is zero at the beginning of each sample and is integrated within it; a
    `clock` is the time since the record's common zero. With what a
    `free` one begins is unknown and differs by record: a diagnosis fits it there; elsewhere it begins at zero. One
    `per_record` is free and keeps its value through the record: outside a diagnosis it is the number zero, and no state. One
    `arbitrary` may have any value: what it is in one record tells nothing of another.
    """

    name: str
    unit: str
    scale: float
    stepped: bool = False
    ramp: bool = False
    clock: bool = False
    free: bool = False
    per_record: bool = False
    arbitrary: bool = False

    def __post_init__(self) -> None:
        if self.per_record:  # it changes by no law of its own
            object.__setattr__(self, "free", True)
        if self.per_record or self.ramp:
            object.__setattr__(self, "stepped", True)


@dataclass(frozen=True)
class Channel:
    """One channel an effect can act on: unit and typical size (SI) of its signal and of the stage displacement.

    `time` [s]: typical displacement over the speed that occurs, so that what counts in both is a speed, whatever stroke a file states;
    1 s where no record says how fast the stage moves. `pace`: the sample time of the records over a millisecond, to the nearest decade.
    `force_unit` and `force_scale` are those of the balance, as of `DevicePhysics`.
    """

    name: str
    unit: str
    scale: float
    travel_unit: str
    travel_scale: float
    partner: str | None = None
    partner_unit: str = "1"
    partner_scale: float = 1.0
    time: float = 1.0
    pace: float = 1.0
    force_unit: str = "N"
    force_scale: float = 1.0

    def paired_with(self, other: Channel) -> Channel:
        """The same channel as the first one of a pair."""
        return replace(self, partner=other.name, partner_unit=other.unit, partner_scale=other.scale)

    def unit_of(self, number: Param | State) -> str:
        """The unit of a law's number at this channel, such as 'N/um^3' for 'channel/travel^3'; '1' for what is per channel of its kind."""
        if number.unit == "channel/partner" and self.unit == self.partner_unit:
            return "1"
        here = (self.unit, self.travel_unit, self.partner_unit, self.force_unit)
        units = dict(zip(PLACEHOLDERS, here, strict=True))

        def in_place(word: re.Match[str]) -> str:
            unit = units[word[0]]
            return unit if unit.isalnum() or number.unit == word[0] else f"({unit})"

        return re.sub("|".join(PLACEHOLDERS), in_place, number.unit)

    def si(self, value: float, number: Param | State) -> float:
        """A bound, a start value or a scale of a law's number, in SI at this channel."""
        if isinstance(number, Param) and number.paced:
            value *= self.pace**number.powers_of_time
        if not _is_relative(number.unit):
            return to_si(value, number.unit)
        powers, rest = split_unit(number.unit, MOTION if "travel" in number.unit else PLACEHOLDERS)
        here = (self.scale, self.travel_scale, self.partner_scale, self.force_scale, self.time)
        size = 1.0
        for word, scale in zip(MOTION, here, strict=True):
            size *= scale ** powers.get(word, 0.0)
        return float(to_si(value, rest) * size)

    def allowed(self, p: Param) -> tuple[float, float]:
        """What a number of a law may be in a file [SI]: within its bounds; of one that is paced, at any pace; of one that counts in speeds
        only its sign is known."""
        if not p.of_motion:
            low, high = self.si(p.bounds[0], p), self.si(p.bounds[1], p)
            return p.at_any_pace(low, high) if p.paced else (low, high)
        low = p.bounds[0]
        return (-math.inf if low < 0 else math.ulp(0.0) if low > 0 else 0.0), math.inf


def _is_relative(unit: str) -> bool:
    return any(word in unit for word in PLACEHOLDERS)

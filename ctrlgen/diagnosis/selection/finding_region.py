"""The region of the operating range in which the law of a finding acts, with the intervals of its ends.

A law sets in over a way, and no form of its edge is nature's: the interval of an end holds the ramp about every edge that the interval of
the law's own number holds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Protocol

from pydantic import Field

from ctrlgen.effects import Effect, Side
from ctrlgen.reporting.result_file import FiniteOrNull, Keys


class Bounded(Protocol):
    """A number with its 95 % interval, in `unit`."""

    @property
    def value(self) -> float:
        """Estimate."""

    @property
    def ci95(self) -> tuple[float, float]:
        """95 % interval."""

    @property
    def unit(self) -> str:
        """Unit of both."""


class EndEntry(Keys):
    """One end of a region."""

    value: FiniteOrNull = Field(description="Estimate [unit].")
    ci95: tuple[FiniteOrNull, FiniteOrNull] = Field(description="95 % interval [unit].")


class RegionEntry(Keys):
    """Where a law acts that does not act everywhere."""

    quantity: str = Field(
        description="position, speed (its size), drive, time (on the records' common clock) or temperature (its rise)."
    )
    size: bool = Field(description="Whether the size of the quantity is meant, whatever its sign.")
    lower: EndEntry | None = Field(description="Lower end; null where it is open.")
    upper: EndEntry | None = Field(description="Upper end; null where it is open.")
    unit: str = Field(description="Unit of both ends.")


@dataclass(frozen=True)
class _End:
    value: float
    ci95: tuple[float, float]
    unit: str

    def shifted(self, way: float, unsure: float) -> _End:
        """The end at a distance whose 95 % interval is `unsure` to either side."""
        low, high = (abs(end - self.value) for end in self.ci95)
        value = self.value + way
        return _End(value, (value - hypot(low, unsure), value + hypot(high, unsure)), self.unit)


def region_of(law: type[Effect], numbers: Mapping[str, Bounded]) -> RegionEntry | None:
    """The region of a law with the `numbers` of a finding; None for a law that acts everywhere."""
    where = law.acts_in
    if where is None or where.at not in numbers:
        return None
    e = numbers[where.at]
    middle = _End(e.value, e.ci95, e.unit)
    lower: _End | None = middle
    upper: _End | None = None
    if where.side is Side.AROUND:
        length = numbers[where.length]
        half, unsure = length.value / 2, (length.ci95[1] - length.ci95[0]) / 4
        lower, upper = middle.shifted(-half, unsure), middle.shifted(half, unsure)
    elif where.side is Side.BELOW or (where.side is Side.OUTWARD and middle.value < 0):
        lower, upper = None, middle
    ramp = where.ramp * numbers[where.over].value / 2 if where.over in numbers else 0.0
    size = where.side is Side.BOTH or where.quantity == "speed"
    ends = (_entry(lower, ramp), _entry(upper, ramp))
    return RegionEntry(quantity=where.quantity, size=size, lower=ends[0], upper=ends[1], unit=e.unit)


def places_of(law: type[Effect]) -> Sequence[str]:
    """The parameters of a law that say where it acts."""
    where = law.acts_in
    return () if where is None else tuple(name for name in (where.at, where.length) if name)


def _entry(end: _End | None, ramp: float) -> EndEntry | None:
    """The entry of an end; the law sets in within `ramp` of it to either side."""
    return None if end is None else EndEntry(value=end.value, ci95=(end.ci95[0] - ramp, end.ci95[1] + ramp))

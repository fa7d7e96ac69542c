"""The region of the operating range in which the law of a finding acts, with the intervals of its ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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

    def shifted(self, way: float) -> _End:
        return _End(self.value + way, (self.ci95[0] + way, self.ci95[1] + way), self.unit)


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
        half = numbers[where.length].value / 2
        lower, upper = middle.shifted(-half), middle.shifted(half)
    elif where.side is Side.BELOW or (where.side is Side.OUTWARD and middle.value < 0):
        lower, upper = None, middle
    size = where.side is Side.BOTH or where.quantity == "speed"
    return RegionEntry(quantity=where.quantity, size=size, lower=_entry(lower), upper=_entry(upper), unit=e.unit)


def places_of(law: type[Effect]) -> Sequence[str]:
    """The parameters of a law that say where it acts."""
    where = law.acts_in
    return () if where is None else tuple(name for name in (where.at, where.length) if name)


def _entry(end: _End | None) -> EndEntry | None:
    return None if end is None else EndEntry(value=end.value, ci95=end.ci95)

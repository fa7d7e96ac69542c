"""How far an axis may move: a size to both sides of home, or its two ends."""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator, Discriminator, Tag

from ctrlgen.core.units import In, Quantity, same_dimension, written_unit

Ends: TypeAlias = tuple[Quantity, Quantity]
ONE, TWO = "one number", "two numbers"  # branches of the union, which messages leave out (`core.files`)


def _around_home(ends: Ends) -> Ends:
    low, high = ends
    if not same_dimension(written_unit(low.text), written_unit(high.text)):
        raise ValueError(f"{low.text!r} and {high.text!r} are not of one dimension")
    if not low.si <= 0 <= high.si or low.si == high.si:
        raise ValueError(
            f"{low.text!r} to {high.text!r} does not hold home, which is 0; give the lowest and the highest displacement"
        )
    return ends


def _branch(given: Any) -> str:
    return TWO if isinstance(given, list | tuple) else ONE


_Length = Annotated[Quantity, In("um")]
_Angle = Annotated[Quantity, In("rad")]
_Lengths = Annotated[tuple[_Length, _Length], AfterValidator(_around_home)]
_Angles = Annotated[tuple[_Angle, _Angle], AfterValidator(_around_home)]
_LengthSize = Annotated[Quantity, In("um", positive=True)]
_AngleSize = Annotated[Quantity, In("rad", positive=True)]

Travel = Annotated[Annotated[_LengthSize, Tag(ONE)] | Annotated[_Lengths, Tag(TWO)], Discriminator(_branch)]
"""Of a length, such as "500 um", or ["-10 um", "60 um"]."""
TravelOrTurn = Annotated[
    Annotated[_LengthSize | _AngleSize, Tag(ONE)] | Annotated[_Lengths | _Angles, Tag(TWO)], Discriminator(_branch)
]
"""Of a length or an angle."""


def ends_of(travel: Quantity | Ends) -> tuple[float, float]:
    """The lowest and the highest displacement [SI]."""
    return (-travel.si, travel.si) if isinstance(travel, Quantity) else (travel[0].si, travel[1].si)


def farthest(travel: Quantity | Ends) -> float:
    """The largest distance from home [SI]: a typical size."""
    return max(map(abs, ends_of(travel)))


def travel_unit(travel: Quantity | Ends) -> str:
    """The unit in which it is written."""
    return written_unit((travel if isinstance(travel, Quantity) else travel[1]).text)

"""Places and directions in a device file."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Strict

from ctrlgen.core.units import In, Quantity

Coordinate = Annotated[Quantity, In("mm")]
Place = tuple[Coordinate, Coordinate, Coordinate]
MOST, LEAST = 1e6, 1e-6  # of a direction's largest number: squares of others leave the range of numbers, or are none


def _of_some_size(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    largest = max(map(abs, direction))
    if largest > MOST or 0 < largest < LEAST:
        raise ValueError(
            f"{list(direction)} is no direction: write numbers of {LEAST:g} to {MOST:g}, such as [0, 1, 0]; its length does not count"
        )
    return direction


Direction = Annotated[
    tuple[Annotated[float, Strict()], Annotated[float, Strict()], Annotated[float, Strict()]],
    AfterValidator(_of_some_size),
]

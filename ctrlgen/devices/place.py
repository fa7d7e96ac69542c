"""Places and directions in a device file."""

from __future__ import annotations

from typing import Annotated

from ctrlgen.core.units import In, Quantity

Coordinate = Annotated[Quantity, In("mm")]
Place = tuple[Coordinate, Coordinate, Coordinate]
Direction = tuple[float, float, float]

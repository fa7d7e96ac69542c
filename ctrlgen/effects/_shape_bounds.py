"""What a law is where one of its shapes ends at a bound: itself still, or another law, under whose name it belongs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ShapeBounds:
    """What a law is where a shape is at its `low` or `high` bound, where the records say nothing of it (`untold`), and where it does what
    the law's size does and no more (`as_size`), as a friction that is still in proportion to the speed does; empty: the law itself, or
    nothing is known. A fit that ends there is rejected."""

    low: str = ""
    high: str = ""
    untold: str = ""
    as_size: str = ""


def itself(*shapes: str) -> dict[str, ShapeBounds]:
    """Of `shapes` at whose bounds the law keeps its name, or nothing is known."""
    return dict.fromkeys(shapes, ShapeBounds())


def either(other: str) -> ShapeBounds:
    """Of a shape at each of whose bounds the law is the `other` one, as where the records say nothing of it."""
    return ShapeBounds(low=other, high=other, untold=other)

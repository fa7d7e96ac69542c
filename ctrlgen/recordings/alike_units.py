"""Units that are taken for one another in logs, and which of them would fit."""

from __future__ import annotations

from ctrlgen.core.units import same_dimension, to_si

UNITS = (
    ("nm", "um", "mm", "m", "in"),
    ("urad", "mrad", "rad", "deg"),
    ("um/s", "mm/s", "m/s", "in/s"),
    ("mrad/s", "rad/s", "deg/s", "rpm"),
    ("mV", "V", "kV"),
    ("mA", "A"),
    ("mN", "N", "kN"),
    ("mN*m", "N*m"),
    ("mW", "W"),
)
"""Families; the first of each has the dimension of all."""
FULL = 1.2
"""Of its bounds that a drive may reach: they themselves, and the rounding of a file."""
LEAST = 1e-3
"""Of its bounds that a drive that was moved reaches at least."""


def size_of(unit: str) -> float:
    """What 1 of a unit is in SI, as a difference."""
    return to_si(1.0, unit) - to_si(0.0, unit)


def alike(unit: str) -> list[str]:
    """The units that are taken for `unit`, without those of its size."""
    return [
        other
        for family in UNITS
        if same_dimension(unit, family[0])
        for other in family
        if abs(size_of(other) / size_of(unit) - 1) > 1e-6
    ]


def unit_within(largest: float, bound: float, unit: str) -> str | None:
    """The unit with which numbers that reach `largest` [SI] in `unit` are within the `bound` [SI] of their signal; None where none is, or
    where a smaller number would be as likely."""
    reached = {o: largest * size_of(o) / size_of(unit) for o in alike(unit)}
    fitting = [o for o, value in reached.items() if LEAST * bound < value < FULL * bound]
    return max(fitting, key=size_of, default=None)

"""Which column of a measurement file is the temperature of what surrounds the device."""

from __future__ import annotations

from collections.abc import Sequence

from ctrlgen.core.units import same_dimension
from ctrlgen.recordings.look.column_facts import ColumnFacts
from ctrlgen.recordings.look.signal_words import words_of

SURROUNDINGS_WORDS = frozenset((
    "ambient", "room", "air", "environment", "env", "lab", "outside", "chamber", "raum", "umgebung", "luft", "amb",
))  # fmt: skip
"""Words of the name of a temperature that is rather that of the surroundings than that of a part."""


def temperature_of_surroundings(free: Sequence[ColumnFacts]) -> str | None:
    """The name of the one column among those that no signal is that states a temperature in every row; of several that of the surroundings
    by its name, None where its name does not tell."""
    warm = [c for c in free if c.unit is not None and same_dimension(c.unit, "K") and _whole(c)]
    if len(warm) > 1:
        warm = [c for c in warm if words_of(c.bare) & SURROUNDINGS_WORDS]
    return warm[0].name if len(warm) == 1 else None


def _whole(column: ColumnFacts) -> bool:
    return column.values is not None and len(column.finite) == len(column.values)

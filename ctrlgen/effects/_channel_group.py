"""Which channels the `at` of a law means: one of them, all, or all of one kind of quantity."""

from __future__ import annotations

from collections.abc import Sequence

from ctrlgen.core.units import base_unit, same_dimension

ALL = "all"
_IN = "all in "


def group(units: Sequence[str], at_unit: str) -> str:
    """The `at` of all channels that measure what `at_unit` does: "all" where those in `units` all do, else such as "all in rad"."""
    return ALL if all(same_dimension(unit, at_unit) for unit in units) else f"{_IN}{base_unit(at_unit)}"


def is_group(at: str) -> bool:
    """Whether `at` means several channels."""
    return at == ALL or at.startswith(_IN)


def means(at: str, channel: str, unit: str) -> bool:
    """Whether `at` means the channel of this name and unit; no channel is in a unit that is not known."""
    if not at.startswith(_IN):
        return at in (ALL, channel)
    try:
        return same_dimension(unit, at.removeprefix(_IN))
    except ValueError:
        return False


def overlap(first: str, second: str) -> bool:
    """Whether two `at` may mean one channel: both the same, or one of them several."""
    return first == second or is_group(first) or is_group(second)

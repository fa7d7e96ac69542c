"""Counts before a noun and names in a row, as messages print them."""

from __future__ import annotations

from collections.abc import Sequence


def number_of(count: int, one: str, more: str = "") -> str:
    """`count` with `one`, or with `more` where it is not 1: "1 axis", "2 axes", "0 readings are"; `more` left out is `one` with an s."""
    return f"{count} {one if count == 1 else more or f'{one}s'}"


def listed(names: Sequence[str]) -> str:
    """'x', 'x and y', 'x, y and z'."""
    return " and ".join([*([", ".join(names[:-1])] if names[1:] else []), *names[-1:]])

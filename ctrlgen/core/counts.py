"""Counts before a noun, as messages print them."""

from __future__ import annotations


def number_of(count: int, one: str, more: str = "") -> str:
    """`count` with `one`, or with `more` where it is not 1: "1 axis", "2 axes", "0 readings are"; `more` left out is `one` with an s."""
    return f"{count} {one if count == 1 else more or f'{one}s'}"

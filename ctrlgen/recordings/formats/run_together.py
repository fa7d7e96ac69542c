"""Columns of fixed width without blanks between them: -1.0000-104.9917 is two numbers, for nothing else has two decimal marks and a sign.

A number without a decimal mark may be a date, or an exponent of Fortran (1.5-104): such are left as they are.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from ctrlgen.recordings.formats.number_cells import DATE

NUMBER = r"\d*[.,]\d+(?:[eEdD][+-]?\d{1,3})?"
TOGETHER = re.compile(rf"(?<!\S)[+-]?{NUMBER}(?:[+-]{NUMBER})+(?!\S)", re.ASCII)
NEXT = re.compile(r"(?<=\d)(?=[+-]\d*[.,]\d)", re.ASCII)
UNSIGNED = re.compile(r"(?<!\S)[+-]?(\d*\.\d+\.\d+|\d*,\d+,\d+)(?!\S)", re.ASCII)
SAMPLED = 400  # lines of a file that are sought for it, from its beginning, and as many all over it


def parted(lines: Sequence[str]) -> tuple[list[str], list[str]]:
    """The lines with a blank before the sign of each number that the one before runs into, and a note with the first of them."""
    sample = [*lines[:SAMPLED], *lines[:: max(1, len(lines) // SAMPLED)]]
    if not any(TOGETHER.search(line) for line in sample):
        return list(lines), []
    apart = [TOGETHER.sub(lambda found: NEXT.sub(" ", found[0]), line) for line in lines]
    first = next(k for k, line in enumerate(lines) if line != apart[k])
    found = TOGETHER.search(lines[first])
    example = found[0] if found is not None else ""
    return apart, [f"numbers run into one another, such as {example!r} in line {first + 1}: parted before each sign"]


def two_in_one(line: str) -> str:
    """The first text of a line with two decimal marks and no sign between, which is no date; empty where there is none."""
    found = (match[0] for match in UNSIGNED.finditer(line))
    return next((text for text in found if not re.fullmatch(DATE, text, re.ASCII)), "")

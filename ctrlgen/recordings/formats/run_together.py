"""Columns of fixed width without blanks between them: -1.0000-104.9917 is two numbers, for nothing else has two decimal marks and a sign.

A number without a decimal mark may be a date, or an exponent of Fortran (1.5-104): such are left as they are.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from ctrlgen.recordings.formats.number_cells import DATE, is_reading
from ctrlgen.recordings.formats.text_cells import STARTS_WITH_NUMBER, cells_of, is_comment, separator_of, without_mark
from ctrlgen.recordings.formats.written_layout import Layout

NUMBER = r"\d*[.,]\d+(?:[eEdD][+-]?\d{1,3})?"
TOGETHER = re.compile(rf"(?<!\S)[+-]?{NUMBER}(?:[+-]{NUMBER})+(?!\S)", re.ASCII)
NEXT = re.compile(r"(?<=\d)(?=[+-]\d*[.,]\d)", re.ASCII)
UNSIGNED = re.compile(r"(?<!\S)[+-]?(\d*\.\d+\.\d+|\d*,\d+,\d+)(?!\S)", re.ASCII)
SEPARATORS = re.compile(r'[\t;|"]')  # a file that has them pads its columns with no blanks
SAMPLED = 400  # lines of a file that are sought for it, from its beginning, and as many all over it


def parted(lines: Sequence[str], layout: Layout) -> tuple[list[str], list[str]]:
    """The lines with a blank before the sign of each number that the one before runs into, and a note with the first of them.

    Parted are rows of a file that blanks separate, where they then have as many readings as most. What stands in a cell between other
    separators, in a remark or among names (`band 0.5-1.5`) is a text, and so is what has one name above it, such as 1.5+0.1.
    """
    sample = [*lines[:SAMPLED], *lines[:: max(1, len(lines) // SAMPLED)]]
    if not any(_runs_together(line) for line in sample):
        return list(lines), []
    rows = [k for k, line in enumerate(lines) if STARTS_WITH_NUMBER.match(line) and not is_comment(line)]
    apart = {k: TOGETHER.sub(lambda found: NEXT.sub(" ", found[0]), lines[k]) for k in rows}
    counts = {k: sum(map(is_reading, cells_of(line, " "))) for k, line in apart.items()}
    usual = Counter(counts.values()).most_common(1)[0][0]
    chosen = [k for k in rows if counts[k] == usual and apart[k] != lines[k]]
    if not chosen or not all(_of_blanks_alone(lines[k]) for k in chosen) or _are_named(lines, rows, usual):
        return list(lines), []
    whole = list(lines)
    for k in chosen:
        whole[k] = apart[k]
    if separator_of(whole, layout) != " ":
        return list(lines), []
    found = TOGETHER.search(lines[chosen[0]])
    example = found[0] if found is not None else ""
    return whole, [
        f"numbers run into one another, such as {example!r} in line {chosen[0] + 1}: parted before each sign"
    ]


def _runs_together(line: str) -> bool:
    return bool(TOGETHER.search(line) and STARTS_WITH_NUMBER.match(line)) and not is_comment(line)


def _of_blanks_alone(line: str) -> bool:
    """Whether nothing else in a line can be a separator: a comma is a decimal mark where numbers that run together have it."""
    marks = {mark for found in TOGETHER.findall(line) for mark in re.findall(r"[.,]", found)}
    return not SEPARATORS.search(line) and not ("," in TOGETHER.sub("", line) and "," not in marks)


def _are_named(lines: Sequence[str], rows: Sequence[int], usual: int) -> bool:
    """Whether the names above rows are those of their cells as they stand, between blanks or commas, and not of `usual` numbers each."""
    above = next((line for line in reversed(lines[: rows[0]]) if line.strip()), "")
    for separator in (" ", ","):
        names = cells_of(without_mark(above), separator)
        widths = Counter(len(cells_of(lines[k], separator)) for k in rows)
        most, count = widths.most_common(1)[0]
        are_names = 1 < len(names) == most and not any(map(is_reading, names))
        if are_names and count > len(rows) / 2 and (separator == "," or most != usual):
            return True
    return False


def two_in_one(line: str) -> str:
    """The first text of a line with two decimal marks and no sign between, which is no date; empty where there is none."""
    found = (match[0] for match in UNSIGNED.finditer(line))
    return next((text for text in found if not re.fullmatch(DATE, text, re.ASCII)), "")

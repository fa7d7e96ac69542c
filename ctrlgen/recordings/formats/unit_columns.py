"""Units that stand in a column of their own, the same in every row: `x, x unit`, `u.value, u.unit`."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

from ctrlgen.recordings.formats.number_cells import is_number, usual
from ctrlgen.recordings.formats.unit_texts import unit_of

NAMED = re.compile(r"(?P<of>.*?)[\s._/-]*units?", re.IGNORECASE)
VALUE = ("", ".value", "_value", ".val", ".v")
"""Ends of the name of the column of numbers, behind what it shares with that of its unit."""


def units_beside(
    names: Sequence[str], texts: Mapping[int, Sequence[object]], without: Collection[int]
) -> dict[int, int]:
    """The column of its unit of each column `without` one, by number: of the same name, or the column before one that is named `unit`
    alone. `texts`: the cells of columns of text."""
    found = dict[int, int]()
    for k, cells in texts.items():
        match = NAMED.fullmatch(names[k])
        stated = {cell for cell in cells if cell not in (None, "")}
        if match is None or len(stated) != 1 or unit_of(str(next(iter(stated)))) is None:
            continue
        ends = [match["of"] + end for end in VALUE] if match["of"] else []
        of = next((names.index(end) for end in ends if end in names), k - 1 if not match["of"] else -1)
        if of in without and (of not in texts or any(is_number(usual(str(cell))) for cell in texts[of])):
            found[of] = k
    return found

"""A factor that stands in a line of its own above a printed matrix and multiplies every number below: `1.0e+03 *`, of MATLAB and Octave."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from ctrlgen.recordings.formats.layout_question import Ambiguous
from ctrlgen.recordings.formats.text_blocks import Block, kind_of

NUMBER = r"(?P<number>[+-]?\d+\.?\d*[eEdD][+-]?\d{1,3}|10\^[({]?[+-]?\d{1,3}[)}]?)"
LINE = re.compile(rf"\s*(?:{NUMBER}\s*[*x\u00d7]|[*x\u00d7]\s*{NUMBER.replace('number', 'behind')})\s*", re.ASCII)
"""A power of ten alone beside the sign of a product."""


def factor_lines(lines: Sequence[str]) -> dict[int, float]:
    """The factor of each line, by its number from 0, that holds nothing else."""
    found = {k: match for k, line in enumerate(lines) if line.strip() and (match := LINE.fullmatch(line))}
    return {k: _value(match["number"] or match["behind"]) for k, match in found.items()}


def _value(text: str) -> float:
    text = re.sub(r"[(){}]", "", text)
    return float(text.replace("10^", "1e").replace("d", "e").replace("D", "e"))


def factor_of(lines: Sequence[str], factors: Mapping[int, float], block: Block, separator: str) -> tuple[int, float]:
    """The line from 0 and the factor that multiply a table; line -1 and 1 where none does.

    It is the last above the table, with no other row between: that of another matrix stands above rows of its own. Raises `Ambiguous` where
    one stands between the rows of a table.
    """
    first, last = block.rows[0], block.rows[-1]
    if inside := [k for k in factors if first < k < last]:
        what = f"states a factor in line {inside[0] + 1}, between rows that stand together"
        raise Ambiguous(f"{what}; save each matrix to a file of its own, best with writematrix")
    above = max((k for k in factors if k < first), default=-1)
    if above < 0 or any(kind_of(line, separator) == "row" for line in lines[above + 1 : first]):
        return -1, 1.0
    return above, factors[above]


def multiplied(columns: Sequence[np.ndarray], line: int, factor: float) -> tuple[list[np.ndarray], list[str]]:
    """The columns times the `factor` of a `line`, and a note. Raises `Ambiguous` where one of them holds text, which it cannot multiply."""
    if line < 0:
        return list(columns), []
    for column in columns:
        if column.dtype.kind == "O":
            text = next((cell for cell in column if isinstance(cell, str)), "")
            what = f"states the factor {factor:g} in line {line + 1} for every column below it, and one holds text, such as {text!r}"
            raise Ambiguous(f"{what}; save it with all digits, with writematrix")
    told = f"line {line + 1} states a factor for every column: all numbers below it are read times {factor:g}"
    return [factor * column for column in columns], [told]

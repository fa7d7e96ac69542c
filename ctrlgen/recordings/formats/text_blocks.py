"""Where the tables of a text file stand among other text."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from ctrlgen.core.counts import number_of
from ctrlgen.recordings.formats.layout_question import Ambiguous
from ctrlgen.recordings.formats.number_cells import OVER, is_number, is_reading
from ctrlgen.recordings.formats.run_together import two_in_one
from ctrlgen.recordings.formats.text_cells import cells_of, is_comment, width_of, without_mark

FEWEST_ROWS = 2  # of a table among other text
FOOTED = 20  # rows before a footer that must begin with a number
ALIKE = 30  # last rows whose last numbers have as many digits behind the point, or in the exponent, as all are written
LAST_DIGITS = re.compile(r"(?:[.,]|[eEdD][+-]?)\d+$", re.ASCII)
BEGUN = re.compile(r"[+-]?\d*(?:[.,]\d*)?(?:[eEdD][+-]?\d*)?(?<=.)", re.ASCII)
MOST_LISTED = 5  # bad lines that a message lists
STRICT = re.compile(
    r"(?:[\s\d.,;:|+\-\u2212/'\"]++|(?<=[\d.])[eEdD](?=[+\-\d])|(?<=\d)T(?=\d)|(?<=\d)Z(?![A-Za-z\d]))++"
)
"""A line that holds nothing but numbers, times and separators: a letter is an exponent or part of a time, not T1 of a name."""
Kind = Literal["blank", "remark", "row", "mixed", "text"]


@dataclass(frozen=True)
class Block:
    """A table of a text file by the numbers of its lines from 0: its rows of `width` cells, or `widest` with remarks behind them, the
    lines above it, its last line if that was not written to its end, and lines below it that are of its width but no rows."""

    rows: tuple[int, ...]
    width: int
    widest: int
    above: tuple[int, ...]
    cut: int | None = None
    below: tuple[int, ...] = ()


def kind_of(line: str, separator: str) -> Kind:
    """What a line is: a row of readings alone, one with other text in it, other text, a remark or nothing."""
    if not line.strip():
        return "blank"
    if is_comment(line):
        return "remark"
    if STRICT.fullmatch(line) and re.search(r"\d", line):
        return "row"
    cells = cells_of(line, separator)
    filled = [c for c in cells if c]
    readings = [c for c in filled if is_reading(c)]
    if filled and len(readings) == len(filled):
        return "row"
    return "mixed" if not filled or any(c.lower() not in OVER for c in readings) else "text"


def blocks_of(lines: Sequence[str], separator: str) -> list[Block]:
    """The tables of a file: runs of rows of readings, and rows of as many cells with a text that is none.

    Raises `Ambiguous` where rows of one table differ in their number of cells.
    """
    kinds = [kind_of(line, separator) for line in lines]
    filled = [k for k, kind in enumerate(kinds) if kind not in ("blank", "remark")]
    if not any(kinds[a] == kinds[b] == "row" for a, b in pairwise(filled)):
        kinds = _beside_text(lines, kinds, separator)
    blocks: list[Block] = []
    run: list[int] = []
    above: list[int] = []
    for k, kind in enumerate([*kinds, "text"]):
        if kind == "row" or (kind == "mixed" and run and _belongs(lines[k], lines[run[-1]], separator)):
            run.append(k)
        elif kind != "blank" and not (run and kind == "remark" and not _begins_again(lines, k, run, above, separator)):
            if len(run) >= FEWEST_ROWS or (run and _is_lost(lines[run[0]], blocks, separator)):
                blocks.append(_block(lines, run, above, separator))
                above = []
            else:
                above += run
            run = []
            above.append(k)
    return _of_several_columns(blocks)


def _begins_again(lines: Sequence[str], k: int, run: Sequence[int], above: Sequence[int], separator: str) -> bool:
    """Whether a remark below rows names columns again: it stands above them too, with as many names as they have cells."""
    if not any(lines[k] == lines[j] for j in above):
        return False
    width, text = width_of(lines[run[-1]], separator), without_mark(lines[k]).strip()
    names = [cells_of(text, separator), re.split(r"\s{2,}|\t", text)]
    return any(len(cells) == width and not any(map(is_number, cells)) for cells in names)


def _is_lost(line: str, blocks: Sequence[Block], separator: str) -> bool:
    """Whether a single row stands below a table of its width, from which some other text cut it off."""
    return bool(blocks) and width_of(line, separator) == blocks[-1].width


def _of_several_columns(blocks: list[Block]) -> list[Block]:
    """Without runs of single numbers where a table of several columns stands: those are counts in a header."""
    wide = [block for block in blocks if block.width > 1]
    return wide or blocks


def _beside_text(lines: Sequence[str], kinds: Sequence[Kind], separator: str) -> list[Kind]:
    """The kinds of lines of a file in which every row holds some text: lines of the usual number of cells are rows, and so are others
    between them that are partly numbers, which are then damaged."""
    widths = {k: width_of(lines[k], separator) for k, kind in enumerate(kinds) if kind in ("mixed", "row")}
    if not widths:
        return list(kinds)
    usual = Counter(widths.values()).most_common(1)[0][0]
    rows = [k for k, width in widths.items() if width == usual]
    inside = {k for k in widths if rows[0] <= k <= rows[-1]}
    head = next((k for k, after in pairwise(rows) if not _is_named(lines[k], lines[after], separator)), rows[0])
    return ["row" if k in inside and k >= head else kind for k, kind in enumerate(kinds)]


def _is_named(line: str, below: str, separator: str) -> bool:
    """Whether a line holds a text where the one below it, of as many cells, holds a number: it belongs to a header."""
    pairs = zip(cells_of(line, separator), cells_of(below, separator), strict=False)
    return any(not is_reading(cell) and is_number(under) for cell, under in pairs)


def _belongs(line: str, before: str, separator: str) -> bool:
    """Whether a line with text in it is a row of the table of the line `before`."""
    width = width_of(before, separator)
    return width_of(line, separator) == width or _longer_by_a_remark(line, width, separator)


def _block(lines: Sequence[str], run: list[int], above: list[int], separator: str) -> Block:
    """A run of rows as a table. Raises `Ambiguous` where they differ in their number of cells."""
    while len(run) > 1 and not lines[run[-1]].strip().strip(separator):
        run = run[:-1]  # a spreadsheet's empty rows
    run, below = _without_footer(lines, run, separator)
    widths = [width_of(lines[k], separator) for k in run]
    width = Counter(widths).most_common(1)[0][0]
    ends = run[-1] == len(lines) - 1 and len(run) > FEWEST_ROWS
    cut = run[-1] if ends and (widths[-1] < width or _ends_early([lines[k] for k in run], separator)) else None
    if cut is not None:
        run, widths = run[:-1], widths[:-1]
    usual = [k for k, w in zip(run, widths, strict=True) if w == width]
    remarks = all(
        kind_of(lines[k], separator) == "row" for k in usual[:FOOTED]
    )  # else the text is a cell that was pushed aside
    wrong = [
        (k, w)
        for k, w in zip(run, widths, strict=True)
        if w != width and not (remarks and _longer_by_a_remark(lines[k], width, separator))
    ]
    if wrong:
        listed = ", ".join(f"line {k + 1} has {w}" for k, w in wrong[:MOST_LISTED]) + (
            ", ..." if len(wrong) > MOST_LISTED else ""
        )
        if merged := next((text for k, _ in wrong if (text := two_in_one(lines[k]))), ""):
            what = f"two numbers run into one another in {merged!r}, and no sign parts them"
            raise Ambiguous(
                f"{listed.partition(' has')[0]}: {what}: write a blank or a comma between columns of fixed width"
            )
        mend = "(for one) with the line of the names, if these stand above the table, or repair them"
        raise Ambiguous(f"line {usual[0] + 1} has {number_of(width, 'cell')}, but {listed}", {"header = 5": mend})
    return Block(tuple(run), width, max(widths), tuple(above), cut, below)


def _ends_early(rows: Sequence[str], separator: str) -> bool:
    """Whether the last number of a file that ends without an end of its line has fewer digits than every one above it, all of which are
    written alike: it was not written to its end."""
    *above, last = (cells_of(row, separator)[-1] for row in rows[-ALIKE:])
    tails = [LAST_DIGITS.search(cell) for cell in above]
    if (
        len(above) < ALIKE - 1
        or not all(tails)
        or len({match[0][0] + str(len(match[0])) for match in tails if match}) > 1
    ):
        return False
    usual, tail = tails[0], LAST_DIGITS.search(last)
    assert usual is not None  # all of them are
    shorter = tail is None or tail[0][0].lower() != usual[0][0].lower() or len(tail[0]) < len(usual[0])
    return shorter and BEGUN.fullmatch(last) is not None


def _without_footer(lines: Sequence[str], run: list[int], separator: str) -> tuple[list[int], tuple[int, ...]]:
    """Rows without those at their end that begin with a text where all others begin with a number, such as means; and these."""
    last = len(run)
    while last > FEWEST_ROWS and not is_reading(cells_of(lines[run[last - 1]], separator)[0]):
        last -= 1
    begin_with_numbers = all(is_reading(cells_of(lines[k], separator)[0]) for k in run[max(0, last - FOOTED) : last])
    return (run[:last], tuple(run[last:])) if begin_with_numbers else (run, ())


def _longer_by_a_remark(line: str, width: int, separator: str) -> bool:
    """Whether the cells of a row beyond the table's are empty, or one remark in words."""
    beyond = [c for c in cells_of(line, separator)[width:] if c]
    return len(cells_of(line, separator)) > width and len(beyond) <= 1 and not any(map(is_number, beyond))

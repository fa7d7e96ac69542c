"""Lines of a text file as cells: which separator it uses, and quotes."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise

from ctrlgen.recordings.formats.layout_question import Ambiguous
from ctrlgen.recordings.formats.number_cells import DATE, is_number, is_reading
from ctrlgen.recordings.formats.written_layout import MARKS, Layout

SEPARATORS = ("\t", ";", "|", ",", " ")  # where two fit alike the earlier is meant: nobody writes numbers with it
COMMENTS = ("#", "%", "//", "!")  # at the beginning of a line
WORDED = re.compile(r"\s*(?:REM\b|\*\s+(?=[A-Za-z\[(]))")
"""The same before words: of BASIC, of SPICE. A star alone is a reading that did not fit."""
ERRORS = re.compile(
    r"\s*#(N/?A|NV|NUM!|VALUE!|DIV/0!|REF!|NAME\?)\s*[^\w\s]", re.IGNORECASE
)  # of a spreadsheet, and a separator
SAMPLED = 200  # lines by which a separator is known
ONE_CELL = re.compile(r"\s*[+-]?\d+,\d+\s*")
DECLARED = (
    re.compile(r'^"?sep=(.)"?\s*$'),  # Excel
    re.compile(r"^Separator\s+(Tab|Comma|Semicolon)\s*$", re.IGNORECASE),  # LabVIEW
    re.compile(r"^#\s*SEPARATOR\s*=\s*(\d+)\s*$"),  # GCS of Physik Instrumente: the code of the character
)
LONGEST_NAME = 40  # lines over which the names of one header may go
STARTS_WITH_NUMBER = re.compile(r'\s*"?[+-]?[.,]?\d')
INSIDE = re.compile(r"\d\s*[,;\t ]")  # a number and more: (12.3) alone is how accountants write -12.3
RULE = re.compile(r"[\s|+:=\-]*(?:-{2,}|={2,})[\s|+:=\-]*")
"""A line that is drawn between the names of a printed table and its rows: |---|---|."""
RULED = re.compile(r"[\s,;|]*[-=]{2,}(?:[\s,;|]+[-=]{2,})+[\s,;|]*")
"""The same between separators, under names and no row of numbers: ----,----."""
DRAWN = str.maketrans({**dict.fromkeys("\u2502\u2506\u2551", "|"), **dict.fromkeys("\u2500\u2550\u2501", "-"),
                       **dict.fromkeys("\u250c\u252c\u2510\u251c\u253c\u2524\u2514\u2534\u2518\u255e\u256a\u2561", "+")})  # fmt: skip
"""Signs of which tables are drawn."""
ARROW = re.compile(r"^\s*(\d[\d:.,]*)\s*->\s*(?=\S)")  # of Arduino's monitor, behind the time at which a line came in
STAMPED = re.compile(r"^(\s*\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d),(\d{3})(?=,)", re.ASCII)
BRACKETS = {("[", "]"), ("(", ")"), ("{", "}")}
NAMED = {"tab": "\t", "comma": ",", "semicolon": ";"}


def is_comment(line: str) -> bool:
    """Whether a line is a remark: in a header it may hold names, in a table it is skipped. #N/A of a spreadsheet begins a row."""
    return (line.lstrip().startswith(COMMENTS) and not ERRORS.match(line)) or bool(WORDED.match(line))


def without_mark(line: str) -> str:
    """A line without the mark of a comment."""
    return (
        re.sub(r"^\s*((#|%|//|!)+|REM\b|\*(?=\s))\s*", "", line)
        if WORDED.match(line)
        else re.sub(r"^\s*(#|%|//|!)+\s?", "", line)
    )


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line; a blank as `separator` is any run of blanks, and a date with its time of day is one cell."""
    if '"' in line:
        row = next(
            csv.reader([line.strip() if separator == " " else line], delimiter=separator, skipinitialspace=True), []
        )
        return [cell.strip() for cell in row]
    if separator == " ":
        cells = line.split()
        dated = len(cells) > 1 and ":" in cells[1] and re.fullmatch(DATE, cells[0], re.ASCII)
        return [f"{cells[0]} {cells[1]}", *cells[2:]] if dated else cells
    return [cell.strip() for cell in line.split(separator)]


def width_of(line: str, separator: str) -> int:
    """The number of cells of a line."""
    return line.count(separator) + 1 if separator != " " and '"' not in line else len(cells_of(line, separator))


def stray_quotes(lines: Sequence[str]) -> list[int]:
    """Numbers from 1 of the lines with a quote that is opened and not closed: a reader would take the next lines for its cell."""
    return [k for k, line in enumerate(lines, 1) if '"' in line and line.count('"') % 2]


def with_whole_stamps(lines: Sequence[str]) -> list[str]:
    """Lines of which most begin with a date, a time and thousandths behind a comma, as Python's logging writes them, with a point there,
    where the names are one fewer than the cells that commas part."""
    stamped = [k for k, line in enumerate(lines) if STAMPED.match(line)]
    if len(stamped) < 2 or 2 * len(stamped) <= sum(bool(line.strip()) for line in lines):
        return list(lines)
    head = next((lines[k] for k in range(stamped[0] - 1, -1, -1) if lines[k].strip()), "")
    if head.count(",") != lines[stamped[0]].count(",") - 1:
        return list(lines)
    return [STAMPED.sub(r"\1.\2", line) for line in lines]


def whole_lines(lines: Sequence[str]) -> list[str]:
    """Lines without what programs add to them: a name that goes on in the next lines of its quotes becomes one line, empty ones keep the
    numbers of the lines below; brackets around every row, the lines that a table is drawn with and the arrow behind a time are left out."""
    whole = _undrawn(with_whole_stamps(lines))
    stray = [k - 1 for k in stray_quotes(lines)]
    if len(stray) == 2 and stray[1] - stray[0] <= LONGEST_NAME:
        first, last = stray
        joined = " ".join(part.strip() for part in lines[first : last + 1])
        if not any(STARTS_WITH_NUMBER.match(line) for line in lines[first : last + 1]) and not _holds_rows(
            lines[:first]
        ):
            whole[first : last + 1] = [*([""] * (last - first)), joined]
    filled = [line.strip() for line in whole if line.strip() and not is_comment(line)]
    if len(filled) > 1 and all(
        (line[0], line.rstrip(",")[-1]) in BRACKETS and INSIDE.search(line.rstrip(",")[1:-1]) for line in filled
    ):
        whole = [line if is_comment(line) else line.strip().rstrip(",")[1:-1] for line in whole]
    return whole


def _undrawn(lines: Sequence[str]) -> list[str]:
    """Lines of a printed table without what it is drawn with, and with a blank for an arrow that stands in every line."""
    bars = sum("|" in line or "\u2502" in line or "\u2506" in line for line in lines)
    filled = sum(bool(line.strip()) for line in lines)
    if bars > filled / 2:
        lines = [line.translate(DRAWN) for line in lines]
        lines = ["" if RULE.fullmatch(line) and ("|" in line or "+" in line) else line for line in lines]
    lines = [
        "" if RULED.fullmatch(line) and not STARTS_WITH_NUMBER.match(above) else line
        for above, line in pairwise(["", *lines])
    ]
    arrows = sum(bool(ARROW.match(line)) for line in lines)
    if arrows > filled / 2:
        mark = Counter(c for line in lines for c in ARROW.sub("", line) if c in ";,\t").most_common(1)
        lines = [ARROW.sub(rf"\1{mark[0][0] if mark else ' '}", line) for line in lines]
    return list(lines)


def _holds_rows(lines: Sequence[str]) -> bool:
    return sum(bool(STARTS_WITH_NUMBER.match(line)) for line in lines) > 1


def separator_of(lines: Sequence[str], layout: Layout) -> str:
    """The separator of a text file: as stated, as the file declares it, or that by which most cells are readings.

    Raises `Ambiguous` where a comma may separate two numbers or be the decimal mark of one.
    """
    if layout.separator is not None:
        return MARKS.get(layout.separator, layout.separator)
    for line in lines[:SAMPLED]:
        for pattern in DECLARED:
            if match := pattern.match(line):
                return NAMED.get(match[1].lower(), chr(int(match[1])) if match[1].isdigit() else match[1])
    sample = _sample(lines)
    scores = {mark: _fit(sample, mark) for mark in SEPARATORS}
    best = max(scores.values(), default=0.0)
    separator = next((mark for mark in SEPARATORS if best and scores[mark] > best - 1e-9), ",")
    one = sample and all(ONE_CELL.fullmatch(line) for line in sample)
    if separator == "," and one and layout.decimal != ".":
        return _one_or_two(lines, layout)
    return separator


def _sample(lines: Sequence[str]) -> list[str]:
    """Lines that stand for the rows of a table: the header is before the middle, and most lines are rows."""
    rows = [line for line in lines[len(lines) // 2 :] if line.strip() and not is_comment(line)]
    rows = rows or [line for line in lines if line.strip() and not is_comment(line)]
    return rows[:: max(1, len(rows) // SAMPLED)]


def _fit(sample: Sequence[str], separator: str) -> float:
    """How well lines are rows of readings: the share of cells that are, times that of lines of the usual number of cells."""
    rows = [cells_of(line, separator) for line in sample]
    widths = Counter(map(len, rows))
    if not rows or widths.most_common(1)[0][0] < 2:
        return 0.0
    cells = [cell for row in rows for cell in row]
    sure = sum(is_number(c) or bool(c and is_reading(c)) for c in cells)
    empty = sum(not c for c in cells)
    return sure / max(len(cells) - empty, 1) * widths.most_common(1)[0][1] / len(rows)


def _one_or_two(lines: Sequence[str], layout: Layout) -> str:
    """The separator where every row is digits, a comma and digits. Names above tell whether they are one number or two."""
    if layout.decimal == ",":
        return ";"
    names = [line for line in lines if line.strip() and not is_comment(line) and not ONE_CELL.fullmatch(line)]
    if names:
        return "," if "," in names[-1] else ";"
    what = f"has rows such as {_sample(lines)[0].strip()!r}, which may be two numbers or one with a decimal comma"
    raise Ambiguous(what, {'separator = ","': "for two", 'decimal = ","': "for one"})

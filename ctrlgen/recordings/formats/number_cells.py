"""Numbers as text files write them: decimal mark, thousands, words for missing. What can be read two ways is asked."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ctrlgen.recordings.formats.layout_question import Ambiguous
from ctrlgen.recordings.formats.written_layout import Layout

MOST_LISTED = 5  # bad cells of a column that a message lists; the others are counted
FEW = 3  # different texts of digits in a column: as few may be codes of a fault
MOST_WORDS = 20  # different texts of a column that a proposed `missing` names
MISSING = frozenset(
    [
        "",
        "nan",
        "na",
        "n/a",
        "null",
        "none",
        "-nan",
        "nan(ind)",
        "-nan(ind)",
        "1.#qnan",
        "-1.#qnan",
        "1.#ind",
        "-1.#ind",
        "#n/a",
        "<na>",
        "nat",
        "n. def.",
        "n.def.",
    ]
)
"""Words of programs for a number that is not there."""
OVER = frozenset(
    [
        *(
            "--",
            "---",
            "----",
            "-----",
            "------",
            "***",
            "****",
            "*****",
            "******",
            "?",
            "??",
            "lost",
            "uncertain",
            "bad_quality",
        ),
        *(
            "overload",
            "ovld",
            "ovrld",
            "ovl",
            "overrange",
            "over-range",
            "overflow",
            "underrange",
            "underflow",
            "saturated",
            "sat",
        ),
        *(
            "ol",
            "o.l.",
            "0l",
            "+ol",
            "-ol",
            "\u221e",
            "+\u221e",
            "-\u221e",
            "inf",
            "+inf",
            "-inf",
            "infinity",
            "-infinity",
            "1.#inf",
            "-1.#inf",
            "unendlich",
            "+unendlich",
            "-unendlich",
        ),
        *("invalid", "bad", "err", "error", "#nv", "#num!", "#value!", "#div/0!", "#ref!", "#name?"),
    ]
)
"""Words of instruments for a reading beyond their range, or lost."""
NO_READING = re.compile(
    r"[-\u2013*#?_.<>~+=/ ]+|[-+]?(over|under|ovr|ofl|ovf|ol)[-+]?|no[ _]?(signal|data|reading|value)|[-+]?F{4,}|-?1\.#[A-Z]+\d*"
    r"|not ?a ?number|n\.a\.|\(null\)",
    re.IGNORECASE,
)
"""The same within a column of numbers: nothing but signs, as in a display without a reading, and words that are names elsewhere."""
WHOLE = re.compile(r"[+-]?\d{1,18}", re.ASCII)
DATE = (
    r"(?:\d{1,4}[-./]\d{1,2}[-./]\d{1,4}|\d{1,2}[-./ ][A-Z](?:[a-z]{2,8}|[A-Z]{2})[-./, ]+\d{4}"
    r"|\d{1,2}-[A-Z](?:[a-z]{2}|[A-Z]{2})-\d{2}(?!\d))"
)
CLOCK = r"(?:\d+ days? )?\d{1,3}:\d{2}(:\d{2})?([.,:;]\d+)?(\s*[AaPp]\.?[Mm]\.?)?"
ZONES = "(?:UTC|GMT|WES?T|BST|CES?T|MEZ|MESZ|EES?T|[ECMP][SD]T|[JK]ST)"
TIME = re.compile(
    rf"{DATE}|({DATE}[T ,;]\s*)?{CLOCK}\s*(Z|{ZONES}|[+-]\d{{2}}:?\d{{2}})?|\d{{8}}T\d{{6}}([.,]\d+)?Z?", re.ASCII
)
HEXADECIMAL = re.compile(r"0[xX][0-9A-Fa-f]+|[0-9A-Fa-f]+h|[0-9A-F]{4,}|(?=.*\d)[0-9A-F]{2,}", re.ASCII)
TOGETHER = re.compile(r"[+-]?\d+(?:[+-]\d+)*\+\d+(?:[+-]\d+)*", re.ASCII)
FORMULA = re.compile(r"=.+")
DIGITS = re.compile(r"[^A-Za-z]*\d[^A-Za-z]*")
IN_BRACKETS = re.compile(r"\([\d.,]*\d[\d.,]*\)", re.ASCII)
EXPONENT = r"([eEdD][+-]?\d{1,3})?"
GROUPS = "[.,'\u2019 \u00a0\u202f\u2009]"
ANY = re.compile(rf"(?=[+\u2212-]?[.,]?\d)[+\u2212-]?(\d+|\d{{1,3}}({GROUPS}\d{{3}})+)?([.,]\d*)?{EXPONENT}", re.ASCII)
"""A number in some style."""
OPEN = re.compile("[,'\u2019\u00a0\u202f\u2009]|\\d \\d|[.]\\d*[.]")
"""What in cells may be a decimal comma or stand between thousands."""
POINT = re.compile(r"(?<![\d.])(?:0|\d{4,})\.\d|\.(?:\d{1,2}|\d{4,})(?![\d.])", re.ASCII)
"""A point that stands between no thousands."""
OTHERWISE = (
    (re.compile(r"(?<=^[+\u2212-])[ ]+(?=[\d.,])"), ""),
    (re.compile(r"^([\d.,]*\d[\d.,]*)[-\u2212]$", re.ASCII), r"-\1"),
    (re.compile(r"^[\u2010-\u2015\ufe63\uff0d](?=[\d.,])"), "-"),
    (re.compile(r"(?<=[\d.,])\s*[*x\u00b7\u00d7]\s*10\s*\^\s*(?=[+-]?\d)"), "e"),
    (re.compile(r"(?<=[\d.,])[ ]+(?=[eE][+-]?\d)"), ""),
    (re.compile(r"^'(?=[+-]?[.\d])"), ""),
    (re.compile(r'^="([^"]*)"$'), r"\1"),
    (re.compile(r"^(?:np|numpy)\.\w+\(([^()]*)\)$"), r"\1"),
    (re.compile(r"^([+-]?(?:\d+\.\d*|\.\d+))f$", re.ASCII), r"\1"),
)
"""What programs write otherwise, and what stands in its place: blanks behind a sign, which fill a column; a minus behind its number; a dash
for a minus; 10 to a power; a blank before an exponent; the marks of texts of a spreadsheet; scalars of NumPy; floats of C."""
BLANKS = ("\u00a0", "\u202f", "\u2009", " ")


@dataclass(frozen=True)
class NumberStyle:
    """How a file writes its numbers: decimal mark, mark between thousands ('' for none), order of dates."""

    decimal: Literal[".", ","] = "."
    thousands: str = ""
    dates: Literal["day first", "month first"] | None = None

    @property
    def pattern(self) -> re.Pattern[str]:
        """A whole cell that is a number in this style, thousands only in groups of three."""
        mark = {"": None, "blank": "[\u00a0\u202f\u2009 ]", "'": "['\u2019]"}.get(
            self.thousands, re.escape(self.thousands)
        )
        digits = r"\d+" if mark is None else rf"(?:\d+|[1-9]\d{{0,2}}(?:{mark}\d{{3}})+)"
        decimal = re.escape(self.decimal)
        return re.compile(rf"[+\u2212-]?(?:{digits}(?:{decimal}\d*)?|{decimal}\d+){EXPONENT}", re.ASCII)

    def plain(self, cell: str) -> str:
        """A number of this style as Python writes it."""
        for mark in BLANKS if self.thousands == "blank" else "'\u2019" if self.thousands == "'" else self.thousands:
            cell = cell.replace(mark, "")
        return cell.replace(self.decimal, ".").replace("\u2212", "-").replace("d", "e").replace("D", "e")


@dataclass(frozen=True)
class Cells:
    """Cells as numbers (n,), NaN where there is none; rows of each word of an instrument; `bad` cells that are neither; whether some are
    truths; the first that is written `otherwise` than most programs do, empty where none is."""

    values: np.ndarray
    words: dict[str, list[int]] = field(default_factory=dict)
    bad: tuple[tuple[int, str], ...] = ()
    truths: bool = False
    otherwise: str = ""


def is_number(cell: str) -> bool:
    """Whether a cell is a number in some style."""
    return (ANY.fullmatch(cell) or ANY.fullmatch(usual(cell))) is not None


def has_unit(cell: str) -> bool:
    """Whether a cell is a number and a word of letters, as 0.5 mV."""
    return bool(re.fullmatch(r"[+-]?[\d.,]+([eE][+-]?\d+)?\s*[^\W\d_]{1,4}", cell))


def written_otherwise(cells: Sequence[str]) -> str:
    """What cells are that hold no plain numbers, and what to do, where all are of one kind; empty for others."""
    kinds = (
        (TOGETHER, "numbers that run into one another; write a blank or a comma between columns of fixed width"),
        (HEXADECIMAL, "hexadecimal numbers; write them as decimal ones, signed where they are"),
        (FORMULA, "a formula that was never calculated; open the file in a spreadsheet, let it calculate and save it"),
        (
            IN_BRACKETS,
            "numbers in brackets, as accountants write negative ones; write a minus before them where they are",
        ),
    )
    return next((told for pattern, told in kinds if all(pattern.fullmatch(cell) for cell in cells)), "")


def are_digits(words: Sequence[str]) -> bool:
    """Whether different texts are numbers with marks that are not known: digits in all of them, letters in none."""
    return len(words) > FEW and all(DIGITS.fullmatch(word) for word in words)


def is_reading(cell: str) -> bool:
    """Whether a cell stands in a column of numbers: a number, a time, or a word for a missing or lost one."""
    return is_number(cell) or _word(cell) in MISSING or _word(cell) in OVER or bool(TIME.fullmatch(cell))


def _word(cell: str) -> str:
    """A cell in small letters, without the zeros that Microsoft's library prints behind a word: 1.#INF00."""
    low = cell.lower()
    return re.sub(r"(#[a-z]+)0+$", r"\1", low) if "#" in low else low


def usual(cell: str) -> str:
    """A cell with its number as most programs write it: `OTHERWISE`."""
    for pattern, instead in OTHERWISE:
        cell = pattern.sub(instead, cell)
    return cell


def are_filled(cells: np.ndarray) -> np.ndarray:
    """Which cells of a column (n,) hold a number or a text: an OL was read in its row, an empty cell or signs alone were not."""
    if cells.dtype.kind == "O":
        texts = ("" if cell is None or cell != cell else str(cell) for cell in cells)
        return np.array([any(map(str.isalnum, text)) for text in texts], dtype=bool)
    return np.isfinite(cells) if cells.dtype.kind == "f" else np.ones(len(cells), dtype=bool)


def are_whole(cells: np.ndarray) -> bool:
    """Whether every cell is a whole number without thousands, as those of an epoch in nanoseconds are."""
    return len(cells) > 0 and all(isinstance(c, (str, int)) and WHOLE.fullmatch(str(c)) for c in cells)


def to_numbers(cells: np.ndarray, style: NumberStyle, missing: Sequence[str | int | float] = ()) -> Cells:
    """Cells of a text file (n,) as numbers; `missing` are the reader's own words for none."""
    values, words, bad = np.full(len(cells), np.nan), dict[str, list[int]](), list[tuple[int, str]]()
    pattern, truths, otherwise, own = style.pattern, False, "", {str(word).strip() for word in missing}
    for k, given in enumerate(cells):
        if not isinstance(given, str):
            values[k] = np.nan if given is None else float(given)
            continue
        cell = given.strip()
        if cell in own or _word(cell) in MISSING:
            continue
        if not pattern.fullmatch(cell) and pattern.fullmatch(usual(cell)):
            cell, otherwise = usual(cell), otherwise or cell
        if pattern.fullmatch(cell):
            values[k] = float(style.plain(cell))
        elif _word(cell) in OVER or NO_READING.fullmatch(cell):
            words.setdefault(cell, []).append(k)
        elif cell.lower() in ("true", "false"):
            values[k], truths = cell.lower() == "true", True
        else:
            bad.append((k, cell))
    return Cells(values, words, tuple(bad), truths, otherwise)


def style_of(columns: Iterable[Sequence[str]], layout: Layout, separator: str) -> tuple[NumberStyle, list[str]]:
    """The style in which the cells of `columns` write numbers, and notes of what is not plain.

    A mark decides itself where a cell cannot be read otherwise: 0,5 is no thousand, 1.234,5 has both. Raises `Ambiguous` where every
    cell with a mark has it before exactly three digits, or where cells speak for different styles.
    """
    columns = list(columns)
    plain = layout.decimal is None and layout.thousands is None and separator != ";"
    texts = ["\n".join(column) for column in columns] if plain else []
    if plain and not any(map(OPEN.search, texts)) and any(map(POINT.search, texts)):
        return NumberStyle(dates=layout.dates), []
    votes = _Votes()
    for column in columns:
        votes.count([usual(cell.strip()) for cell in column])
    decimal = layout.decimal or votes.decimal(separator)
    other = "." if decimal == "," else ","
    grouped = other if votes.seen[other] else ("'" if votes.seen["'"] else "blank" if votes.seen["blank"] else "")
    thousands = layout.thousands if layout.thousands is not None else grouped
    notes = ["decimal comma"] if decimal == "," else []
    if thousands:
        notes.append(f"{'blanks' if thousands == 'blank' else thousands} between thousands")
    return NumberStyle(decimal, thousands, layout.dates), notes


class _Votes:
    """What the cells of a file say of its marks: an example of each, for the question."""

    def __init__(self) -> None:
        self.sure = {".": "", ",": ""}  # cells in which the mark can only be the decimal one
        self.open = {".": "", ",": ""}  # cells in which it is that or stands between thousands
        self.seen = {".": False, ",": False, "'": False, "blank": False}
        self.mixed = False  # whether 1.682 stands in one column with 682, as whole numbers with thousands do

    def count(self, column: Sequence[str]) -> None:
        numbers = [c for c in column if is_number(c)]
        short = any(re.fullmatch(r"[+\u2212-]?[1-9]\d{0,2}", c) for c in numbers)
        long = any(re.match(r"[+\u2212-]?\d{4}", c) for c in numbers)  # a column that writes 1234 has no mark in 1,234
        for cell in numbers:
            body = re.sub(r"[eEdD].*", "", cell.lstrip("+\u2212-"))
            self.seen["'"] |= "'" in body or "\u2019" in body
            self.seen["blank"] |= any(mark in body for mark in BLANKS)
            marks = [c for c in body if c in ".,"]
            for mark in set(marks):
                self.seen[mark] = True
            if not marks:
                continue
            last, several = marks[-1], len(set(marks)) > 1
            grouped = re.fullmatch(rf"[1-9]\d{{0,2}}(?:{re.escape(last)}\d{{3}})+", body) and len(body) == len(
                cell.lstrip("+\u2212-")
            )
            if marks.count(last) > 1:  # only thousands repeat
                self.sure["." if last == "," else ","] = cell
            elif several or not grouped or long:
                self.sure[last] = cell
            else:
                self.open[last] = cell
                self.mixed |= short

    def decimal(self, separator: str) -> Literal[".", ","]:
        marks = {'decimal = ","': "", 'decimal = "."': ""}
        if self.sure["."] and self.sure[","]:
            raise Ambiguous(f"writes {self.sure['.']!r} and {self.sure[',']!r}: which mark is the decimal one?", marks)
        if self.sure["."]:
            return "."
        if self.sure[","]:
            return ","
        if self.open[","]:
            what = f"writes {self.open[',']!r}, and no cell tells whether that is {_read_two_ways(self.open[','])}"
            raise Ambiguous(what, marks)
        semicolons = separator == ";"  # as programs of countries with the decimal comma separate
        if self.open["."] and (semicolons or self.mixed):
            what = f"{'separates cells by semicolons and ' * semicolons}writes {self.open['.']!r}; no cell tells whether that is"
            raise Ambiguous(f"{what} {_read_two_ways(self.open['.'])}", marks)
        return "."


def _read_two_ways(cell: str) -> str:
    plain = cell.replace(",", ".")
    return f"{plain.replace('.', '', plain.count('.') - 1)} or {plain.replace('.', '')}"

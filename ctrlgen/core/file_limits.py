"""What a file of ctrlgen may be, asked before anything is done with it: its size, its depth, and the characters of its texts.

Every table that is read passes here, so that no writer meets a control character, and nobody waits for a file that cannot be meant.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from typing import Any

from ctrlgen.core.errors import Fault

LARGEST_TOML = 500_000
"""Bytes of a TOML file: half a second to parse, and ten times the largest description that is known."""
LARGEST_TEXT = 250_000_000
"""Bytes of a CSV of poses: a million samples of six channels with 40 characters each."""
DEEPEST = 100
"""Tables and lists inside one another; what is shipped has five."""
LONGEST_CHAIN = 32
"""Words of a dotted key. A parser's work grows with the square of it."""
MOST_DOTS = 1000
"""Dots in a line, the same where words are in quotes."""
LONGEST_TEXT = 2000
"""Characters of a text for readers, such as a source: a page."""
LONGEST_KEY = 200
"""Characters of a key."""
MOST_FAULTS = 20
"""Faults of one file that are listed."""

_SHOWN = {"\n", "\t", "\r", "\u200c", "\u200d"}  # line ends; joiners, without which some scripts cannot be written
_UNSEEN = {"Cc", "Cf", "Cs", "Co", "Zl", "Zp"}  # controls, marks of direction, surrogates, private use, separators
_STRING = re.compile(r'"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'')
_CHAIN = re.compile(rf"(?<![\w-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++){{{LONGEST_CHAIN}}}")


def unreadable_toml(text: str) -> Fault | None:
    """What keeps a TOML file from being parsed in a moment; None where nothing does."""
    if len(text) > LARGEST_TOML:
        what = f"has {len(text)} characters; a description has at most {LARGEST_TOML}: put long lists into a CSV file"
        return Fault("file", what)
    for number, line in enumerate(text.split("\n"), 1):
        dots = line.count(".")
        if dots > MOST_DOTS or (dots >= LONGEST_CHAIN and _CHAIN.search(_STRING.sub("s", line))):
            what = f"has a key of more than {LONGEST_CHAIN} words, or {MOST_DOTS} dots; write it in several lines"
            return Fault(f"line {number}", what)
    return None


def foreign_parts(table: Any) -> list[Fault]:
    """Faults of a table that has been read: too deep, or with texts that hold characters nobody sees, or that nobody reads to the end."""
    faults = list[Fault]()
    parts: list[tuple[str, int, Any]] = [("", 0, table)]
    while parts and len(faults) < MOST_FAULTS:
        where, depth, value = parts.pop()
        if depth > DEEPEST:
            return [Fault("syntax", TOO_DEEP)]
        if isinstance(value, str):
            faults += _faults(where or "file", value, LONGEST_TEXT, key=False)
        elif isinstance(value, dict):
            for key, member in value.items():
                if fault := [*_faults(f"{where or 'file'}: the key", str(key), LONGEST_KEY, key=True)]:
                    faults += fault
                else:
                    parts.append((f"{where}.{key}" if where else str(key), depth + 1, member))
        elif isinstance(value, list | tuple):
            parts += [(f"{where}[{k}]", depth + 1, member) for k, member in enumerate(value)]
    return faults[:MOST_FAULTS]


TOO_DEEP = f"lists or tables stand more than {DEEPEST} deep inside one another, which no file of ctrlgen needs; is it the right one?"


def _faults(where: str, text: str, longest: int, key: bool) -> Iterator[Fault]:
    if len(text) > longest:
        yield Fault(
            where, f"has {len(text)} characters; a {'key' if key else 'text'} has at most {longest}: shorten it"
        )
    elif unseen := unseen_character(text, lines=not key):
        place, name = unseen
        yield Fault(where, f"has a character that is not shown, {name}, after {place} others; remove it")


def unseen_character(text: str, lines: bool = True) -> tuple[int, str] | None:
    """(place, name) of the first character of `text` that is not shown: a control, a mark of direction; ends of `lines` are allowed."""
    if text.isascii() and text.isprintable():
        return None
    for place, character in enumerate(text):
        if unicodedata.category(character) in _UNSEEN and not (character in _SHOWN and (lines or character > " ")):
            return place, f"U+{ord(character):04X} {unicodedata.name(character, '')}".strip()
    return None

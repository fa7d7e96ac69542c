"""Names that a file gives: which characters they have and how long they are, for everything that is later written with them.

A name becomes part of C identifiers, columns of CSV, variables of an FMU and names of files, so it consists of ASCII letters, digits
and underscores alone. Texts for readers (titles, sources) are checked by `ctrlgen.core.file_limits` and escaped where they are written.
"""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Callable, Iterable
from typing import Annotated, Any

from pydantic import AfterValidator, Field

LONGEST_NAME = 40
"""Letters of a name: with the longest word that a public function adds to it within the 63 that C99 5.2.4.1 promises to tell apart."""

C_NAME, NAME, CHANNEL = r"^[a-z][a-z0-9_]*$", r"^[A-Za-z][A-Za-z0-9_]*$", r"^[A-Za-z0-9_]+$"
_RULES = {
    C_NAME: "is no C identifier in lower case: begin with a letter, then letters, digits and _, such as fast_hexapod",
    NAME: "is no name: begin with a letter, then letters, digits and _, such as stage_x",
    CHANNEL: "is no name of an axis: write letters, digits and _, such as 1X",
}


def checked(text: str, pattern: str = NAME) -> str:
    """`text` where it is a name of this pattern. Raises ValueError that says which characters it may have."""
    if not re.fullmatch(pattern.strip("^$"), text, re.ASCII):
        raise ValueError(f"{reprlib.repr(text)} {_RULES[pattern]}")
    if len(text) > LONGEST_NAME:
        raise ValueError(f"{reprlib.repr(text)} has {len(text)} letters; a name has at most {LONGEST_NAME}: shorten it")
    return text


def meant(name: str, known: Iterable[str], otherwise: str | None = None) -> str:
    """Which of the `known` names an unknown one was to be, or, where none is near, what `otherwise` says: all of them, if nothing else."""
    every = list(known)
    if near := difflib.get_close_matches(name, every, n=1):
        return f"did you mean {near[0]!r}?"
    return f"known are: {', '.join(every)}" if otherwise is None else otherwise


def is_name(text: object) -> bool:
    """Whether `text` can name a drive, an axis or a parameter of a device that is written in Python."""
    return isinstance(text, str) and len(text) <= LONGEST_NAME and re.fullmatch(NAME.strip("^$"), text) is not None


def _named(pattern: str) -> Any:
    def check(text: str) -> str:
        return checked(text, pattern)

    rule: Callable[[str], str] = check
    return AfterValidator(rule), Field(json_schema_extra={"pattern": pattern, "maxLength": LONGEST_NAME})


CName = Annotated[str, *_named(C_NAME)]
"""Of a device, a controller: begins the names of functions and files of C."""
Name = Annotated[str, *_named(NAME)]
"""Of a part of a device."""
ChannelName = Annotated[str, *_named(CHANNEL)]
"""Of an actuator or an axis, which papers number: "1X"."""


def distinct(names: tuple[str, ...]) -> tuple[str, ...]:
    """The same names. Raises ValueError where one occurs twice."""
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ValueError(f"two have the same name, {twice[0]!r}; name each once")
    return names

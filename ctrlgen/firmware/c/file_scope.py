"""Names of file scope in a C source begin with the file's own prefix, so that several sources may be one translation unit."""

from __future__ import annotations

import re

# What is not code: comments and texts.
QUOTED = re.compile(r'(/\*.*?\*/|"(?:[^"\\\n]|\\.)*")', re.DOTALL)
# What a file defines for itself: macros, and static functions and tables, which begin at the first column.
OWN = re.compile(r"^(?:#define (\w+)|static [\w ]*?[ *](\w+)(?= ?[\[(=;]))", re.MULTILINE)


def prefixed(text: str, prefix: str, header: str) -> str:
    """The C `text` with `prefix` before each name of file scope that lacks it, in capitals before one in capitals, and `_own` behind
    one that its `header` would then have too. A member of a structure is none, and comments stay."""
    found = {macro or static for macro, static in OWN.findall(text)}
    public = set(re.findall(r"\w+", header))
    wanted = {name: _with(prefix, name) for name in found if not name.lower().startswith(prefix.lower())}
    names = {name: own + ("_OWN" if own.isupper() else "_own") * (own in public) for name, own in wanted.items()}
    if not names:
        return text
    word = re.compile(rf"(?<![\w.])(?<!->)({'|'.join(sorted(names))})\b")
    parts = QUOTED.split(text)
    return "".join(part if k % 2 else word.sub(lambda match: names[match[0]], part) for k, part in enumerate(parts))


def _with(prefix: str, name: str) -> str:
    return f"{prefix.upper() if name.isupper() else prefix}_{name}"

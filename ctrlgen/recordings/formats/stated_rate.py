"""What a file says, beside its columns, of how often their rows were read: for the question that is asked where no column is a time, and
for the unit of a time that states none."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

STATED = re.compile(
    r"(?<![a-z])(?P<what>d_?t|f_?s|t_?inc|t_?interval|delta[ _]?[tx]|interval|increment|(?:abtast|mess)(?:rate|zeit|frequenz)"
    r"|(?:(?:log|scan)[ _]?)?rate|(?:gathering|trigger|servo)[ _]?period"
    r"|sampl\w*(?:[ _-]?(?:interval|time|period|cycle|rate|frequency))?)(?![a-z])[ _]*(?:\((?P<before>[^)]*)\)|\[(?P<square>[^\]]*)\])?"
    r"\s*(?P<mark>[=:;,\t ])\s*(?P<number>\d+(?:[.,]\d+)?(?:e[+-]?\d+)?)(?!\d)"
    r"(?:\s*[;,]?\s*(?P<unit>[kmg]?(?:hz|sa?/s|sps|samples?/s(?:ec(?:ond)?)?)(?![a-z])|[munµμ]?s(?![a-z/]))|[ ]*(?P<word>[a-z]+))?",
    re.IGNORECASE,
)
RATE_UNIT = re.compile(r"([kmg]?)(?:hz|sa?/s|sps|samples?/s(?:ec(?:ond)?)?)")
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
MANY = {"": 1.0, "k": 1e3, "m": 1e6, "g": 1e9}
PERIOD, RATE = (
    ("t", "inc", "interval", "increment", "time", "period", "cycle", "zeit", "x"),
    ("rate", "frequency", "frequenz"),
)
OWN_UNIT = re.compile(r"_(hz|khz|s|ms|us|ns)$")
"""A unit at the end of a key: sample_rate_hz."""
REMARK = "#%/!; \t"
RATES = ("fs", "f_s")
"""Names of variables that are a rate by convention, in Hz."""


def stated_rate(lines: Sequence[str]) -> tuple[str, float] | None:
    """The words of the first line that states it, and the rate [Hz]; None where none does, or in a unit that is not known."""
    for line in lines:
        for match in STATED.finditer(line.replace('"', "")):
            text = match["number"].partition(",")[0] if match["mark"] == "," else match["number"].replace(",", ".")
            number, what = float(text), match["what"].lower()
            own = OWN_UNIT.search(what)
            unit = (match["unit"] or match["before"] or match["square"] or (own[1] if own else "")).lower()
            rate = RATE_UNIT.fullmatch(unit)
            above = what == "rate" and line[: match.start()].strip(REMARK)  # another rate, such as that of a display
            if number <= 0 or above or match["word"] or (unit and unit not in SECONDS and rate is None):
                continue
            if rate is not None or (not unit and what != "rate" and what.endswith(RATE)):
                return match[0].strip(), number * (MANY[rate[1]] if rate else 1.0)
            if unit or what.endswith(PERIOD):
                return match[0].strip(), 1 / (number * SECONDS.get(unit, 1.0))
    return None


def rate_of(entries: Iterable[tuple[str, Any]]) -> tuple[str, float] | None:
    """The same of names and numbers or texts that stand beside the columns of a structure: `dt`, `Fs`, `sample_rate`."""
    for name, value in entries:
        try:
            line = f"{name} = {float(value):.12g}" + (" Hz" if name.lower() in RATES else "")
        except (TypeError, ValueError):
            line = f"{name} = {value}" if isinstance(value, str) else ""
        if (stated := stated_rate([line])) is not None:
            return line, stated[1]
    return None

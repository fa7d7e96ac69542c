"""What a file says, beside its columns, of how often their rows were read: for the question that is asked where no column is a time, and
for the unit of a time that states none."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

STATED = re.compile(
    r"(?<![a-z])(?P<what>d_?t|f_?s|t_?inc|t_?interval|delta[ _]?[tx]|interval|increment|(?:abtast|mess|me\u00df)(?:rate|zeit|frequenz)"
    r"|fps|(?:(?:log|scan|frame)[ _]?)?rate|(?:gathering|trigger|servo)[ _]?period"
    r"|sampl\w*(?:[ _-]?(?:interval|time|period|cycle|rate|frequency))?)(?![a-z])[ _]*(?:\((?P<before>[^)]*)\)|\[(?P<square>[^\]]*)\])?"
    r"\s*(?P<mark>[=:;,\t ])\s*(?P<number>\d{1,3}(?:,\d{3})+(?:\.\d+)?(?!\d)|\d+(?:[.,]\d+)?(?:e[+-]?\d+)?)(?!\d)"
    r"(?:\s*[;,]?\s*(?P<unit>[kmg]?(?:hz|sa?/s|sps|samples?/s(?:ec(?:ond)?)?)(?![a-z])|k(?![a-z])"
    r"|[munµμ]?s(?![a-z/]))|[ ]*(?P<word>[a-z]+))?",
    re.IGNORECASE,
)
RATE_UNIT = re.compile(r"([kmg]?)(?:hz|sa?/s|sps|samples?/s(?:ec(?:ond)?)?)")
FACTOR = re.compile(
    r"(?:decimation|down.?sampl|divider|divisor|prescal|every \d+|per channel)[^;()]{0,20}", re.IGNORECASE
)
"""Words beside a rate that say that fewer rows were written."""
SAME = 0.01  # of a rate: two that differ by less are one
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
MANY = {"": 1.0, "k": 1e3, "m": 1e6, "g": 1e9}
PERIOD, RATE = (
    ("t", "inc", "interval", "increment", "time", "period", "cycle", "zeit", "x"),
    ("rate", "frequency", "frequenz", "fps"),
)
OWN_UNIT = re.compile(r"_(hz|khz|s|ms|us|ns)$")
"""A unit at the end of a key: sample_rate_hz."""
REMARK = "#%/!; \t"
RATES = ("fs", "f_s")
"""Names of variables that are a rate by convention, in Hz."""


def stated_rate(lines: Sequence[str], decimal: str = ".") -> tuple[str, float] | None:
    """The words of the first line that states it, and the rate [Hz]; None where none does, or in a unit that is not known. Words of other
    lines that state another, or that fewer rows were written, are added: which one is that of the rows, they alone do not tell.

    `decimal`: the decimal mark of the file; a comma before three digits stands between thousands where it is the point.
    """
    found = [stated for line in lines for stated in _stated_in(line.replace('"', ""), decimal)]
    if not found:
        return None
    text, rate = found[0]
    more = [words for words, other in found[1:] if abs(other / rate - 1) > SAME]
    more += [match[0].strip() for line in lines for match in FACTOR.finditer(line)]
    return "; ".join(dict.fromkeys([text, *more])), rate


def _stated_in(line: str, decimal: str) -> list[tuple[str, float]]:
    """The words of one line that state a rate, and the rates [Hz]."""
    found = []
    for match in STATED.finditer(line):
        number, what = _number(match["number"], match["mark"], decimal), match["what"].lower()
        own = OWN_UNIT.search(what)
        unit = (match["unit"] or match["before"] or match["square"] or (own[1] if own else "")).lower()
        rate = RATE_UNIT.fullmatch(unit)
        above = what == "rate" and line[: match.start()].strip(REMARK)  # another rate, such as that of a display
        thousand = unit == "k" and what.endswith(RATE)
        if number <= 0 or above or match["word"] or (unit and unit not in SECONDS and rate is None and not thousand):
            continue
        if rate is not None or thousand or (not unit and what != "rate" and what.endswith(RATE)):
            found.append((match[0].strip(), number * MANY["k" if thousand else rate[1] if rate else ""]))
        elif unit or what.endswith(PERIOD):
            found.append((match[0].strip(), 1 / (number * SECONDS.get(unit, 1.0))))
    return found


def _number(text: str, mark: str, decimal: str) -> float:
    if mark == ",":
        return float(text.partition(",")[0])
    grouped = decimal == "." and re.fullmatch(r"[1-9]\d{0,2}(,\d{3})+(\.\d+)?", text)
    return float(text.replace(",", "" if grouped else "."))


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

"""What the text above a table says of how often its rows were read, for the question that is asked where no column is a time."""

from __future__ import annotations

import re
from collections.abc import Sequence

STATED = re.compile(
    r"(?<![a-z])(?P<what>d_?t|t_?inc|delta[ _]?[tx]|interval|increment|abtast(?:rate|zeit)|(?:log|scan)[ _]?rate"
    r"|sampl\w*(?:[ _-]?(?:interval|time|period|rate|frequency))?)(?![a-z])[ _]*(?:\((?P<before>[^)]*)\)|\[(?P<square>[^\]]*)\])?"
    r"\s*[=:;,\t ]\s*(?P<number>\d+(?:[.,]\d+)?(?:e[+-]?\d+)?)\s*(?P<unit>[munµμ]?s(?![a-z])|[km]?hz|s/s)?",
    re.IGNORECASE,
)
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
HERTZ = {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "s/s": 1.0}
PERIOD, RATE = ("t", "inc", "interval", "increment", "time", "period", "zeit", "x"), ("rate", "frequency")


def stated_rate(lines: Sequence[str]) -> tuple[str, float] | None:
    """The words of the first line that states it, and the rate [Hz]; None where none does."""
    for line in lines:
        for match in STATED.finditer(line):
            number = float(match["number"].replace(",", "."))
            unit = (match["unit"] or match["before"] or match["square"] or "").lower()
            what = match["what"].lower()
            if number <= 0 or not (unit in SECONDS or unit in HERTZ or (not unit and what.endswith((*PERIOD, *RATE)))):
                continue
            if unit in HERTZ or (not unit and what.endswith(RATE)):
                return match[0].strip(), number * HERTZ.get(unit, 1.0)
            return match[0].strip(), 1 / (number * SECONDS.get(unit, 1.0))
    return None

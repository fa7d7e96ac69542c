"""Numbers as text in reports."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from ctrlgen.core.to_digits import FEW, MANY, to_digits

# seconds of the units of a time, the largest that is no larger than it is read best
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
PREFIXES = {-12: "p", -9: "n", -6: "u", -3: "m", 3: "k", 6: "M", 9: "G"}
# at the beginning of a unit that is a quotient, without a prefix of its own; those of a reader's columns stay as they are
_QUOTIENT = re.compile(r"(\(?)([NWVA]\b[^/]*/.+)")


def number(value: float, digits: int = 4) -> str:
    """A number as text: '0.00412', '1.2e-07', '53800'."""
    if not math.isfinite(value):
        return "not known"
    return f"{value:.{digits - 1}e}" if _with_power(value) else to_digits(value, digits)


def _with_power(value: float) -> bool:
    """Whether a number is read best with a power of ten."""
    return value != 0 and not FEW <= abs(value) < MANY


def sized(unit: str, size: float) -> tuple[str, float]:
    """The unit in which a number as large as `size` [unit] is read best, and the factor into it: ("s", 1e-3) for 6085 ms,
    ("pN/um^3", 1e12) for 3.6e-10 N/um^3; the unit itself where no other is better.

    A time is told in s, ms or us by its size, a quotient with a prefix where `number` would write a power of ten.
    """
    if not (math.isfinite(size) and size):
        return unit, 1.0
    if unit in TIMES:
        best = next((u for u, seconds in TIMES.items() if abs(size) * TIMES[unit] >= 0.9995 * seconds), "us")
        return best, TIMES[unit] / TIMES[best]
    quotient = _QUOTIENT.fullmatch(unit)
    power = 3 * math.floor(math.log10(abs(size)) / 3)
    if quotient is None or "e" not in number(size) or power not in PREFIXES:
        return unit, 1.0
    return f"{quotient[1]}{PREFIXES[power]}{quotient[2]}", 10.0**-power


def with_unit(value: float, unit: str, digits: int = 4) -> str:
    """A number with its unit, in that in which it is read best: '6.085 s' of 6085 ms; '0.5' of a plain number."""
    best, factor = sized(unit, value)
    return f"{number(factor * value, digits)} {best}".removesuffix(" 1")


def with_deviation(value: float, sd: float) -> str:
    """A number with its standard deviation to two digits, both to the same decimal (GUM 7.2.6): '-1.5082 ± 0.0061'."""
    if not (math.isfinite(value) and math.isfinite(sd) and sd > 0):
        return number(value)
    decimals = max(0, 1 - math.floor(math.log10(sd)))
    return f"{value:.{decimals}f} ± {sd:.{decimals}f}"


def with_interval(value: float, ends: Sequence[float]) -> tuple[str, str, str]:
    """A number and the two ends of its 95 % interval to the decimal of the second digit of its standard deviation (GUM 7.2.6):
    ('25.81', '25.18', '26.44'); each by itself where the interval has no width."""
    low, high = ends
    sd = (high - low) / (2 * 1.96)
    if not (math.isfinite(value) and math.isfinite(sd) and sd > 0) or _with_power(value):
        return number(value, 6), number(low, 6), number(high, 6)
    decimals = max(0, 1 - math.floor(math.log10(sd)))
    return f"{value:.{decimals}f}", f"{low:.{decimals}f}", f"{high:.{decimals}f}"


def shares_text(shares: Sequence[float], decimals: int = 1) -> list[str]:
    """Shares as '12.3 %', rounded so that what is printed adds up to their sum as printed: 100 % where they are those of a whole.

    Each is rounded down, and the ones that lose most are rounded up (the method of largest remainders), so that each is within one
    last digit of its value.
    """
    unit = 10**decimals
    exact = [100 * unit * share for share in shares]
    shown = [math.floor(value) for value in exact]
    missing = round(math.fsum(exact)) - sum(shown)
    for i in sorted(range(len(exact)), key=lambda i: shown[i] - exact[i])[:missing]:
        shown[i] += 1
    return [f"{value / unit:.{decimals}f} %" for value in shown]

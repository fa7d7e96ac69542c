"""Numbers as text in reports."""

from __future__ import annotations

import math
from collections.abc import Sequence


def number(value: float, digits: int = 4) -> str:
    """A number as text: '0.00412', '1.2e-07', '53800'."""
    if not math.isfinite(value):
        return "not known"
    if value and (abs(value) >= 1e6 or abs(value) < 1e-4):
        return f"{value:.{digits - 1}e}"
    exact = f"{value:.{digits}g}"
    return f"{float(exact):.0f}" if "e" in exact else exact


def with_deviation(value: float, sd: float) -> str:
    """A number with its standard deviation to two digits, both to the same decimal (GUM 7.2.6): '-1.5082 ± 0.0061'."""
    if not (math.isfinite(value) and math.isfinite(sd) and sd > 0):
        return number(value)
    decimals = max(0, 1 - math.floor(math.log10(sd)))
    return f"{value:.{decimals}f} ± {sd:.{decimals}f}"


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

"""Numbers as text in reports."""

from __future__ import annotations

import math


def number(value: float, digits: int = 4) -> str:
    """A number as text: '0.00412', '1.2e-07', '53800'."""
    if not math.isfinite(value):
        return "not known"
    if value and (abs(value) >= 1e6 or abs(value) < 1e-4):
        return f"{value:.{digits - 1}e}"
    exact = f"{value:.{digits}g}"
    return f"{float(exact):.0f}" if "e" in exact else exact

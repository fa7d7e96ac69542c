"""Numbers as a reader writes them down."""

from __future__ import annotations

FEW, MANY = 1e-4, 1e6  # below the first, and from the second on, a power of ten is read better than its zeros


def to_digits(value: float, digits: int = 4) -> str:
    """`value` to so many significant digits, without a power of ten below a million: '2740' of 2739 to three, not '2.74e+03'."""
    text = f"{value + 0.0:.{digits}g}"  # no sign of a zero
    return f"{float(text):.0f}" if "e+0" in text and abs(float(text)) < MANY else text

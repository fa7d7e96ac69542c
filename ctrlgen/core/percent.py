"""Shares as percentages that are read at a glance: '+160 %', never '+1.6e+02 %'."""

from __future__ import annotations

import math


def percent(share: float, digits: int = 2, sign: bool = False) -> str:
    """The text of a share to so many significant `digits`, such as '160 %'; with its `sign` also where it is positive."""
    value = float(f"{100 * share:.{digits}g}")
    whole = math.isfinite(value) and abs(value) >= 10 ** (digits - 1)
    plus = "+" if sign else ""
    return f"{value:{plus}.0f} %" if whole else f"{value:{plus}.{digits}g} %"

"""How often a period repeats, in the words of a machine: 5 deg are 72 a turn, 0.25 mm are 4 a mm."""

from __future__ import annotations

import math

from ctrlgen.core.units import base_unit, difference, to_si
from ctrlgen.reporting.numbers import number

# what a period is counted in, by its SI unit: the size of one [SI], and its name
_COUNTED = {"rad": (2 * math.pi, "a turn"), "m": (1e-3, "a mm")}
# from so many on a decimal tells nothing
_MANY = 1000


def repeats(period: float, unit: str) -> str:
    """'72 a turn' of 5 deg, '4 a mm' of 0.25 mm, '71.3 a turn' where the number is not whole; nothing of a period that is longer than a
    turn or a millimetre, and of one that is neither an angle nor a way."""
    whole, name = _COUNTED.get(base_unit(unit), (0.0, ""))
    length = abs(to_si(period, unit)) if name else 0.0
    if not (math.isfinite(length) and 0 < length <= whole * (1 + 1e-9)):
        return ""
    count = whole / length
    return f"{count:.0f} {name}" if count >= _MANY else f"{count:.1f}".removesuffix(".0") + f" {name}"


def pitch(period: float, unit: str) -> str:
    """'a pitch of 0.25 mm (4 a mm)' of a `period` [SI], told in `unit`; 'a pitch' where no unit is known."""
    if not unit:
        return "a pitch"
    told = float(difference(period, unit))
    often = repeats(told, unit)
    return f"a pitch of {number(told, 3)} {unit}" + (f" ({often})" if often else "")

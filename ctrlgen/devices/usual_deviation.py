"""How far numbers are usually off of which the device file states no standard deviation.

A length L [mm] has the tolerance grade IT8, of ISO 286-1,

    IT8 = 25 i,  i = (0.45 L^(1/3) + 0.001 L) um,

whose ends are two standard deviations from its middle, s = IT8/4: 3 um of 1.6 mm, 12 um of 60 mm, 0.8 um of a beam of 22 um, which is
what parts that are milled, eroded or etched hold. Other numbers see below.
"""

from __future__ import annotations

from math import radians

from ctrlgen.core.units import Quantity, base_unit, written_unit

ASSUMED_SCALE = 5e-3
"""Standard deviation of the scale of each channel that is read, where nothing is stated. Judgement: position sensors that were not
calibrated in place are good to a per cent, which is two of it."""
ANGLE = radians(0.5) / 2
"""rad: half of the limit of ISO 2768-1 (fine and medium) for sides of 10 to 50 mm, 0.5 deg."""
TEMPERATURE = 2.0
"""K: of a room. Judgement."""
SHARE = 0.1
"""Of stiffnesses, of a material, of heat. Judgement: handbooks and measured parts differ by a tenth."""
GRADE = 25.0
"""Tolerance units i of the grade IT8, ISO 286-1."""


def usual_deviation(number: Quantity) -> float:
    """Standard deviation [SI] of a number of a device file that states none; 0 where the number is zero and of no unit that says more."""
    unit = base_unit(written_unit(number.text))
    if unit == "m":
        length = abs(number.si) * 1e3  # mm
        return GRADE / 4 * (0.45 * length ** (1 / 3) + 0.001 * length) * 1e-6
    if unit == "rad":
        return ANGLE
    if unit == "K":
        return TEMPERATURE
    return SHARE * abs(number.si)

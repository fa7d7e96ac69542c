"""A drive whose large values do more, or less, than small ones: another range of an amplifier, iron that saturates, a choked valve."""

import casadi as ca

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds, Side
from ctrlgen.effects._region import ramp


class DriveGainBeyond(Effect):
    """Delta u = g sgn(u) x^2/(x + e), x = |u| - L where positive: a slope of 1 + g beyond the level L; e = L/1000 rounds the corner.

    Holds for g > -1, so that more drive is not less; alike in both directions.
    """

    title = "A gain that changes above one level of the drive"
    place = Place.DRIVE
    family = Family.DRIVE
    requires = frozenset({"actuator"})
    source = "definition: a piecewise linear gain"
    params = (
        Param("gain", "1", (-1.0, 1.0), "g: change of the slope beyond the level", off=0.0),
        Param("level", "channel", (1e-3, 1.0), "L: drive beyond which the slope is another"),
    )
    at_bounds = {"level": ShapeBounds(low="a gain of the drive")}
    acts_in = ActsIn("drive", "level", Side.BOTH)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.gain * ca.sign(s.value) * ramp(ca.fabs(s.value) - p.level, p.level / 1000)

"""A sensor whose reading ends at a limit on one side: an amplifier at its supply, a target that leaves the range."""

import casadi as ca

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Side, itself
from ctrlgen.effects._region import ramp


class SensorLimit(Effect):
    """Delta y = -g sgn(L) x^2/(x + e), x = sgn(L) (y - L) where positive: y, but at most L > 0, or at least L < 0; e = |L|/1e4.

    g = 1 clips: beyond L the reading says no more than that it is beyond. The noise of what digitises it is added behind; readings that
    repeat one value to the last bit there are marked and count for nothing. Holds for a limit away from the zero of the reading.
    """

    title = "A sensor that reads no farther than a limit"
    place = Place.SENSOR
    family = Family.GEOMETRY
    source = "R. Isermann, Fault-Diagnosis Systems (2006): sensor faults; smooth form ours"
    params = (
        Param("share", "1", (0.0, 1.5), "1: nothing beyond the level is read", off=0.0),
        Param("level", "channel", (-1e4, 1e4), "L: reading that is not exceeded, to its own side"),
    )
    at_bounds = itself("level")
    acts_in = ActsIn("position", "level", Side.OUTWARD)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        side = ca.sign(p.level)
        return -p.share * side * ramp(side * (s.value - p.level), ca.fabs(p.level) / 1e4)

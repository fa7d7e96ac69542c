"""A drive that has a limit in one direction: a supply of one sign, an offset beside a limit, a valve that is open."""

import casadi as ca

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Side, itself
from ctrlgen.effects._region import ramp


class OneSidedSaturation(Effect):
    """Delta u = -g sgn(L) x^2/(x + e), x = sgn(L) (u - L) where positive: u, but at most L > 0, or at least L < 0; e = |L|/1e4.

    g = 1 clips, and what is beyond L cannot be recovered from what is delivered. Holds for a limit away from zero drive. A stop that does
    not give does the same to a stage without inertia; one that does, or that a mass runs into, is `end_stop`.
    """

    place = Place.DRIVE
    family = Family.DRIVE
    order = -2  # as `saturation`
    requires = frozenset({"actuator", "bipolar"})
    source = "R. Isermann, Fault-Diagnosis Systems (2006): actuator faults; smooth form ours"
    params = (
        Param("share", "1", (0.0, 1.5), "1: nothing beyond the level is delivered", off=0.0),
        Param("level", "channel", (-1.0, 1.0), "L: drive that is not exceeded, to its own side"),
    )
    at_bounds = itself("level")
    acts_in = ActsIn("drive", "level", Side.OUTWARD)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        side = ca.sign(p.level)
        return -p.share * side * ramp(side * (s.value - p.level), ca.fabs(p.level) / 1e4)

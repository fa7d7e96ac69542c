"""A limit in one direction: of a drive, as a supply of one sign, an offset beside a limit, a valve that is open; of a reading, as an
amplifier of the sensor at its supply, a target that leaves its range."""

import casadi as ca

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Side, itself
from ctrlgen.effects._region import ramp


class OneSidedLimit(Effect, listed=False):
    """Delta s = -g sgn(L) x^2/(x + e), x = sgn(L) (s - L) where positive: the signal s, but at most L > 0, or at least L < 0; e = |L|/1e4.

    g = 1 clips, and what is beyond L cannot be recovered. Holds for a limit away from the zero of the signal.
    """

    at_bounds = itself("level")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        side = ca.sign(p.level)
        return -p.share * side * ramp(side * (s.value - p.level), ca.fabs(p.level) / 1e4)


class OneSidedSaturation(OneSidedLimit):
    """Delta u = -g sgn(L) x^2/(x + e), x = sgn(L) (u - L): `OneSidedLimit` of a drive. Holds as that does. A stop that does not give does
    the same to a stage without inertia; one that does, or that a mass runs into, is `end_stop`."""

    place = Place.DRIVE
    family = Family.DRIVE
    order = -2  # as `saturation`
    requires = frozenset({"actuator", "bipolar"})
    source = "R. Isermann, Fault-Diagnosis Systems (2006): actuator faults; smooth form ours"
    params = (
        Param("share", "1", (0.0, 1.5), "1: nothing beyond the level is delivered", off=0.0),
        Param("level", "channel", (-1.0, 1.0), "L: drive that is not exceeded, to its own side"),
    )
    acts_in = ActsIn("drive", "level", Side.OUTWARD)


class SensorLimit(OneSidedLimit):
    """Delta y = -g sgn(L) x^2/(x + e), x = sgn(L) (y - L): `OneSidedLimit` of a reading. Holds as that does. The noise of what digitises
    the reading is added behind; readings that repeat one value to the last bit are marked and count for nothing."""

    title = "A sensor that reads no farther than a limit"
    place = Place.SENSOR
    family = Family.GEOMETRY
    source = "R. Isermann, Fault-Diagnosis Systems (2006): sensor faults; smooth form ours"
    params = (
        Param("share", "1", (0.0, 1.5), "1: nothing beyond the level is read", off=0.0),
        Param("level", "channel", (-1e4, 1e4), "L: reading that is not exceeded, to its own side"),
    )
    acts_in = ActsIn("position", "level", Side.OUTWARD)

"""A curve that levels off: an amplifier, iron or a sensor that approaches a limit and does not run into it."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds

ZERO = 1e-9  # of the limit: what is smaller counts as that, where |x|^n has no slope for every n
CORNER = ShapeBounds(high="a limit that is run into, `saturation`")
STRAIGHT = ShapeBounds(high="a curve that levels off nowhere", untold="no curve")


class LevellingOff(Effect, listed=False):
    """Delta x = g (c(x) - x), c(x) = x/(1 + |x/L|^n)^(1/n): x while it is small, and L at most; g = 1 is the curve.

    n = 1 is Froehlich's curve of iron. With n = 2.4 and L 3 % above the limit of a tanh it is that within 1 % of L up to three times L, and
    with n = 1.7 and L 7 % below that of an arctan, that: which limit such a curve has is known to a few per cent. With n large it has a
    corner, as `saturation`. Where it takes a few per cent, n = 2 is a cubic. Holds for a curve without memory that is alike to both sides,
    or of a signal of one sign. Near the limit what went in cannot be recovered.
    """

    source = (
        "C. Rapp, 2nd European Conf. on Satellite Communications (1991) 179: amplifiers; n = 1: O. Froehlich (1881)"
    )
    at_bounds = {"level": STRAIGHT, "sharpness": CORNER}

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        size = ca.sqrt((s.value / p.level) ** 2 + ZERO**2)
        return p.share * s.value * ((1 + size**p.sharpness) ** (-1 / p.sharpness) - 1)


SHARE = Param("share", "1", (0.0, 1.5), "g: 1 where the signal follows the curve", off=0.0)
SHARPNESS = Param("sharpness", "1", (0.7, 10.0), "n: how sharp the knee is")


class SoftSaturation(LevellingOff):
    """Delta u = g (c(u) - u): `LevellingOff` of a drive. Holds as that does."""

    title = "A drive that levels off toward a limit: smooth saturation"
    place = Place.DRIVE
    family = Family.DRIVE
    order = -2  # as `saturation`
    requires = frozenset({"actuator"})
    params = (SHARE, Param("level", "channel", (0.02, 50.0), "L: drive that is approached"), SHARPNESS)


class SensorSaturation(LevellingOff):
    """Delta y = g (c(y) - y): `LevellingOff` of a reading, about the sensor's own zero. Holds as that does."""

    title = "A sensor that levels off toward a limit: smooth saturation"
    place = Place.SENSOR
    family = Family.GEOMETRY
    order = -1  # as `cubic_sensor`
    params = (SHARE, Param("level", "channel", (0.01, 1e4), "L: reading that is approached"), SHARPNESS)

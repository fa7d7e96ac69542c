"""An actuator connected the wrong way round."""

from ctrlgen.effects import Effect, Param, Place


class Reversed(Effect):
    """Delta u = -2 g u: the other sign for g = 1. Holds as a whole number: below 1/2 it is a weak drive,
    which `drive_gain` says better."""

    place = Place.DRIVE
    requires = frozenset({"actuator", "bipolar"})
    source = "definition"
    params = (Param("share", "1", (0.0, 1.2), "1 where the sign is wrong", off=0.0),)

    def term(self, s, p):
        return -2 * p.share * s.value

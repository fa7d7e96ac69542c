"""A reading that tells one sign for both, all of it or in part: a rectifier, a count without direction."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class Rectified(Effect):
    """Delta y = g (|y| - y): what is negative counts (1 - 2 g). g = 1/2 cuts it off, g = 1 turns it over.

    Holds about the zero of the reading as it comes; one that is zeroed elsewhere has a `home_offset` too.
    """

    place = Place.SENSOR
    family = Family.GEOMETRY
    source = "definition"
    params = (Param("share", "1", (0.0, 2.0), "g: half of what a negative reading loses", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (ca.fabs(s.value) - s.value)

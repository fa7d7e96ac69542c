"""A graduation, or a gear, whose centre is beside the axis about which it turns."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself


class Eccentricity(Effect):
    """Delta y = A (sin(y + phi) - sin(phi)), A = e/R: centre beside the axis over radius of the graduation. Home is read as zero.

    Once a turn, whatever the graduation. Holds for A below 0.1, and for angles alone.
    """

    place = Place.SENSOR
    family = Family.PERIODIC
    channel_unit = "rad"
    source = "Dr. Johannes Heidenhain GmbH, Angle Encoders without Integral Bearing: errors of a graduation mounted off its axis"
    params = (
        Param("amplitude", "deg", (-5.0, 5.0), "largest error of a turn, e/R", off=0.0),
        Param("phase", "deg", (-360.0, 360.0), "where the offset points at home"),
    )
    at_bounds = itself("phase")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.amplitude * (ca.sin(s.value + p.phase) - ca.sin(p.phase))

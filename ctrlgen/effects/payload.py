"""A weight on a platform, or an unbalanced mass on an axis, whose moment bends the mechanism."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself


class Payload(Effect):
    """Delta theta = g (sin(theta + lambda) - sin(lambda)), g = m g_0 h C: weight times height of its centre times compliance.

    lambda = 0: upright over the axis; 90 deg: out sideways. Home is read with the load. Holds for g below 0.3.
    """

    place = Place.POSE
    family = Family.GAIN
    channel_unit = "rad"
    source = "definition: moment of a weight about a horizontal axis"
    params = (
        Param("share", "1", (-0.3, 0.3), "angle of bending per angle of lean, near upright", off=0.0),
        Param("lean", "deg", (-180.0, 180.0), "how far the centre of mass leans at home"),
    )
    at_bounds = itself("lean")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (ca.sin(s.value + p.lean) - ca.sin(p.lean))

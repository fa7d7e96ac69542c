"""A weight on a platform, or an unbalanced mass on an axis, that gives way to its moment."""

import casadi as ca

from ctrlgen.effects import Effect, Param, Place


class Payload(Effect):
    """Delta theta = g (sin(theta + lambda) - sin(lambda)), g = m g_0 h C: weight times height of its centre times the compliance.

    lambda = 0 stands upright over the axis, 90 deg hangs out sideways; home is loaded. Holds for g below 0.3.
    """

    place = Place.POSE
    channel_unit = "rad"
    source = "definition: moment of a weight about a horizontal axis"
    params = (
        Param("share", "1", (-0.5, 0.5), "angle of giving way per angle of lean", off=0.0),
        Param("lean", "deg", (-180.0, 180.0), "how far the centre of mass leans at home"),
    )

    def term(self, s, p):
        return p.share * (ca.sin(s.value + p.lean) - ca.sin(p.lean))

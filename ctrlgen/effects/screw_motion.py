"""A platform that turns while it moves: motion along a screw instead of a turn and a shift."""

import casadi as ca

from ctrlgen.effects import Effect, Param, Place


class ScrewMotion(Effect):
    """Delta delta = g theta x delta/2: the second order of the twist's exponential, g = 1 for a straight screw.

    Holds for angles below 0.1 rad; what is left is theta^2/6 of the motion.
    """

    place = Place.POSE
    requires = frozenset({"spatial"})
    channel_unit = "m"
    source = "R. M. Murray, Z. Li, S. S. Sastry, Robotic Manipulation (1994), chapter 2: exponential of a twist"
    params = (Param("share", "1", (-4.0, 4.0), "1 for motion along one screw", off=0.0),)

    def term(self, s, p):
        return p.share * ca.cross(s.all[:3], s.all[3:])[s.index - 3] / 2

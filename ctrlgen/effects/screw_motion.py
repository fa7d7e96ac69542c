"""A platform that rotates while it translates: motion along a screw instead of a rotation and a translation."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class ScrewMotion(Effect):
    """Delta delta = g theta x delta/2: second order of the exponential of the twist; g = 1 for a fixed screw axis.

    Holds for angles below 0.1 rad; the neglected third order is theta^2/6 of the motion.
    """

    place = Place.POSE
    family = Family.GEOMETRY
    requires = frozenset({"spatial"})
    channel_unit = "m"
    source = "R. M. Murray, Z. Li, S. S. Sastry, Robotic Manipulation (1994), chapter 2: exponential of a twist"
    params = (Param("share", "1", (-4.0, 4.0), "1: motion along one screw axis", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * ca.cross(s.all[:3], s.all[3:])[s.index - 3] / 2

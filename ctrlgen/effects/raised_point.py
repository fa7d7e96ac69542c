"""The measured point stands above the one that turns: it sinks and runs round as the platform tilts."""

import casadi as ca

from ctrlgen.effects import Effect, Param, Place


class RaisedPoint(Effect):
    """Delta delta = theta x (theta x h)/2, h = (0, 0, h): the second order of a point's way on its sphere.

    Holds for angles below 0.1 rad. The first order, theta x h, is an Abbe arm.
    """

    place = Place.POSE
    requires = frozenset({"spatial"})
    channel_unit = "m"
    source = "R. M. Murray, Z. Li, S. S. Sastry, Robotic Manipulation (1994), chapter 2: Rodrigues' formula"
    params = (Param("height", "mm", (-500.0, 500.0), "how far above", off=0.0),)

    def term(self, s, p):
        turn, arm = s.all[:3], ca.vertcat(0, 0, p.height)
        return ca.cross(turn, ca.cross(turn, arm))[s.index - 3] / 2

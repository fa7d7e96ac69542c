"""The measured point stands above the centre of rotation: it moves on a sphere as the platform tilts."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class RaisedPoint(Effect):
    """Delta delta = theta x (theta x h)/2, h = (0, 0, h): second order of the point's motion on its sphere.

    Holds for angles below 0.1 rad. The first order, theta x h, is `abbe_arm`.
    """

    place = Place.POSE
    family = Family.GEOMETRY
    requires = frozenset({"spatial"})
    channel_unit = "m"
    source = "R. M. Murray, Z. Li, S. S. Sastry, Robotic Manipulation (1994), chapter 2: Rodrigues' formula"
    params = (Param("height", "mm", (-500.0, 500.0), "h: height above the centre of rotation", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        turn, arm = s.all[:3], ca.vertcat(0, 0, p.height)
        return ca.cross(turn, ca.cross(turn, arm))[s.index - 3] / 2

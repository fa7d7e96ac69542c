"""Rotations that are not infinitesimal: links turn as the mechanism moves, its Jacobian is not the one at home."""

from ctrlgen.effects import Effect, Param, Place


class FiniteRotation(Effect):
    """Delta pose = g pose_2(d): the second order of the loop closure of links of constant length, g = 1 for pivots at their ends.

    Holds for travel far below the links' length; what is left is (d/l)^2 of the motion.
    """

    place = Place.POSE
    requires = frozenset({"second_order_kinematics"})
    source = "J.-P. Merlet, Parallel Robots (2006), chapter 4: loop closure, expanded to second order"
    params = (Param("share", "1", (-2.0, 4.0), "1 for links on ideal pivots", off=0.0),)

    def term(self, s, p):
        return p.share * s.second_order_kinematics()[s.index]

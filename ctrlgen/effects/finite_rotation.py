"""Finite rotations of the links: as the mechanism moves, its Jacobian is no longer the one at home."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class FiniteRotation(Effect):
    """Delta pose = g pose_2(d): second order of the loop closure for links of constant length; g = 1 for ideal pivots at their ends,
    or in a mechanism file for its flexures.

    Holds for travel d far below the links' length l; the neglected third order is (d/l)^2 of the motion.
    """

    place = Place.POSE
    family = Family.GEOMETRY
    requires = frozenset({"second_order_kinematics"})
    source = "J.-P. Merlet, Parallel Robots (2006), chapter 4: loop closure, expanded to second order"
    params = (Param("share", "1", (-2.0, 4.0), "1 for links on ideal pivots", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * s.second_order_kinematics()[s.index]

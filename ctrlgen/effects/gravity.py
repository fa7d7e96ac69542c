"""The weight of an unbalanced load about a joint that turns."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself


class Gravity(Effect):
    """F = -M sin(d + q0), M = m g r: weight times the distance of its centre from the axis; of a potential, -M cos(d + q0).

    d is the angle of the joint, so that a period is one turn of it. q0 = 0: hanging, 180 deg: upright. Holds for a horizontal axis,
    with M less by the cosine of its inclination for another; on an axis that does not turn a weight is a constant force.
    """

    place = Place.FORCE
    family = Family.ELASTIC
    channel_unit = "N*m"
    requires = frozenset({"force"})
    source = "B. Siciliano et al., Robotics (2009), section 7.2: gravity terms of the joint torques"
    params = (
        Param("torque", "channel", (0.0, 3.0), "M: largest torque of the weight", off=0.0),
        Param("phase", "deg", (-360.0, 360.0), "q0: of the centre of mass at home, from hanging straight down"),
    )
    at_bounds = itself("phase")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.torque * ca.sin(s.displacement + p.phase)

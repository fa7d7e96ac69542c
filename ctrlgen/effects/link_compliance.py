"""A compliant joint or strut: the platform tilts when it moves."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class LinkCompliance(Effect):
    """Delta theta = c delta: the joint's moment, proportional to the motion `of`, over its stiffness. Holds to first order."""

    place = Place.POSE
    family = Family.CROSS_TALK
    pairs = True
    channel_unit = "rad"
    partner_unit = "m"
    source = "L. L. Howell, Compliant Mechanisms (2001), chapter 5: pseudo-rigid-body joints"
    params = (Param("tilt", "channel/partner", (-3.0, 3.0), "rotation per motion", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.tilt * s.all[s.partner]

"""Two axes of a sensor that are not square to each other."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class Squareness(Effect):
    """Delta y_i = alpha y_j: the axis i of a grid plate, or of one of two scales, leans by alpha toward the axis j and reads that share
    of its way.

    Holds for angles below 0.1 rad: first order, the neglected part is y_i alpha^2/2, which is a gain. A stage that is carried along by
    its neighbour reads the same, and is where it reads: that is `coupling`.
    """

    place = Place.SENSOR
    family = Family.GEOMETRY
    pairs = True
    channel_unit = "m"
    partner_unit = "m"
    source = "ISO 230-1:2012: squareness error between two axes of linear motion"
    params = (Param("angle", "mrad", (-100.0, 100.0), "alpha: by which the axis leans toward the other", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.angle * s.all[s.partner]

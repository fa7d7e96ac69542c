"""A scale that changes with the place of another axis: a guide that yaws along it, a sensor that stands askew."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class CrossScale(Effect):
    """Delta y_i = c y_i y_j: per travel of the axis j the scale of the axis i changes by c.

    Holds while c y_j is a few tenths: first order in the place of j. A stage whose own ratio changes so reads the same.
    """

    place = Place.SENSOR
    family = Family.CROSS_TALK
    pairs = True
    channel_unit = "m"
    partner_unit = "m"
    source = "S. Awtar, A. H. Slocum, J. Mech. Des. 129 (2007) 816: cross-axis error of XY flexures, its terms of second order"
    params = (Param("rate", "1/channel", (-0.3, 0.3), "c: relative change of the scale per way of the other", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.rate * s.value * s.all[s.partner]

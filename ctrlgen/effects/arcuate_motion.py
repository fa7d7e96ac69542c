"""Parasitic motion of second order: a leaf spring shortens as it bends, and the axis across moves on an arc."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class ArcuateMotion(Effect):
    """Delta y_i = c y_j^2: a guide on leaf springs of length L that moves along j comes nearer by about 0.6 y_j^2/L, c = -0.6/L.

    Holds while c y_j is a few tenths: the next term is of fourth order. A straightness of second order of a guide reads the same.
    """

    place = Place.SENSOR
    family = Family.CROSS_TALK
    pairs = True
    channel_unit = "m"
    partner_unit = "m"
    source = "S. Awtar, A. H. Slocum, J. Mech. Des. 129 (2007) 816: parasitic error motion of a parallelogram flexure, 3 y^2/(5 L)"
    params = (Param("rate", "1/channel", (-0.3, 0.3), "c: per square of the way of the other axis", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.rate * s.all[s.partner] ** 2

"""One stage carries its neighbour along."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class Coupling(Effect):
    """Delta d_i = g d_j: a share of the travel of the axis `of`. Holds to first order, for nested or parallel stages."""

    place = Place.DISPLACEMENT
    family = Family.CROSS_TALK
    pairs = True
    partner_unit = "channel"
    source = "S. Awtar, A. H. Slocum, J. Mech. Des. 129 (2007) 816: cross-axis error of XY flexures"
    params = (Param("gain", "1", (-0.3, 0.3), "travel per travel of the other axis", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.gain * s.all[s.partner]

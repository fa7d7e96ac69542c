"""Stages that stiffen: they yield less to the load of the links, the further they are driven."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class LinkLoad(Effect):
    """Delta d = g (c(0) - c(d)) W, W the links' load on the stage and c(d) its compliance at d; a linear mechanism yields by c(0) W always.

    Holds to first order in the load.
    """

    place = Place.DISPLACEMENT
    family = Family.ELASTIC
    requires = frozenset({"tangent_compliance"})
    source = "S1 eq. (12) and (16): stages in series with struts, at the stage's tangent stiffness"
    params = (Param("share", "1", (-2.0, 4.0), "1 for the stage's own law", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * s.tangent_compliance()[s.index]

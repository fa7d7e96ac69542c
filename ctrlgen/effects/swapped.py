"""Two actuators whose leads are exchanged."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class Swapped(Effect):
    """Delta u_i = g (u_j - u_i) and Delta u_j = g (u_i - u_j), exchanged for g = 1. Holds for g = 1 only: in between it is
    crosstalk of the leads."""

    place = Place.DRIVE
    family = Family.CROSS_TALK
    pairs = True
    symmetric = True
    requires = frozenset({"actuator"})
    partner_unit = "channel"
    source = "definition"
    params = (Param("share", "1", (0.0, 1.2), "1: the two are exchanged", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (s.all[s.partner] - s.value)

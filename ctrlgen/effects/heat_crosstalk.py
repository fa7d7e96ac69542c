"""Heaters on one chip warm each other."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class HeatCrosstalk(Effect):
    """Delta P_i = kappa sum_{j != i} P_j: a share of the other heaters' power arrives here.

    Holds in steady state and for changes slower than the chip's own thermal time constant.
    """

    place = Place.HEAT
    family = Family.CROSS_TALK
    requires = frozenset({"heat"})
    source = "definition"
    params = (Param("share", "1", (0.0, 0.1), "power arriving per power of another heater", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (ca.sum1(s.all) - s.value)

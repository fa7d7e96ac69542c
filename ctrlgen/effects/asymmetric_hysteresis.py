"""Hysteresis that is stronger on one side of home than on the other."""

import casadi as ca

from ctrlgen.effects import (
    Effect,
    Expression,
    Family,
    LawInputs,
    LawNumbers,
    Param,
    Place,
    Plainer,
    State,
    either,
    itself,
)


class AsymmetricHysteresis(Effect):
    """F = -k z w', w(d) = d + a (sqrt(d^2 + L^2) - L), w' = 1 + a d/sqrt(d^2 + L^2), dz = dw (1 - sgn(dw) z/r).

    Dahl's law in the warped displacement w; L is the typical travel. F dd = -k z dw, so it dissipates as Dahl's law does.
    Holds for reversals farther apart than a sample.
    """

    place = Place.FORCE
    family = Family.HYSTERESIS
    requires = frozenset({"force"})
    source = "P. R. Dahl, AIAA Journal 14 (1976) 1675; the warped displacement is our extension"
    params = (
        Param("stiffness", "channel/travel", (0.0, 1e2), "stiffness right after a reversal at home", off=0.0),
        Param("reach", "travel", (1e-3, 5.0), "travel over which the force settles"),
        Param("skew", "1", (-0.95, 0.95), "a: relative excess of stiffness far on the positive side"),
    )
    at_bounds = {"reach": either("dry friction, or a spring"), **itself("skew")}
    plainer = Plainer("bouc_wen", {"skew": 0.0}, {"loop": 1.0})
    states = (State("z", "travel", 0.1, stepped=True, free=True), State("w", "travel", 1.0, stepped=True))

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        slope = 1 + p.skew * s.displacement / ca.sqrt(s.displacement**2 + s.travel**2)
        return -p.stiffness * s.states.z * slope

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        w = s.displacement + p.skew * (ca.sqrt(s.displacement**2 + s.travel**2) - s.travel)
        step = w - s.states.w
        settled = 1 - ca.exp(-ca.fabs(step) / p.reach)
        return {"z": s.states.z + (ca.sign(step) * p.reach - s.states.z) * settled, "w": w}

"""Play that is wider on one side of home than on the other: a screw or a rack that is worn where it works most."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself
from ctrlgen.effects._gap import DRIVEN, behind, carried


class WornBacklash(Effect):
    """w = max(min(w, d + h), d - h), h = b (1 + a d/sqrt(d^2 + l^2))/2, Delta d = 0.999 (w - d).

    Holds as `backlash` does, for a b below 2 l: the driven side does not turn back where the gap closes.
    """

    place = Place.DISPLACEMENT
    family = Family.HYSTERESIS
    order = 1
    source = "M. Nordin, P.-O. Gutman, Automatica 38 (2002) 1633: controlling systems with backlash; wear along the way"
    params = (
        Param("gap", "travel", (0.0, 1.9), "b: full width of the gap at home", off=0.0),
        Param("wear", "1", (-0.95, 0.95), "a: relative excess of the gap far on the positive side"),
        Param("spread", "travel", (0.02, 3.0), "l: way from home on which the wear changes"),
    )
    at_bounds = itself("wear", "spread")
    states = DRIVEN

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return behind(s, p.gap)

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return carried(s, p.gap, lambda d: p.gap / 2 * (1 + p.wear * d / ca.sqrt(d**2 + p.spread**2)))

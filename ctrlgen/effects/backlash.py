"""Play in a gear, a nut or a joint."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place
from ctrlgen.effects._gap import DRIVEN, behind, carried


class Backlash(Effect):
    """w = max(min(w, d + b/2), d - b/2), Delta d = 0.999 (w - d): the driven side stands still until b is crossed.

    The gap is entered where the motion reversed, also between two samples. Inside the gap a thousandth of the motion is
    transmitted, so that an inverse exists. Holds where friction keeps the driven side at rest inside the gap; a driven side that a
    spring pulls back follows the flank instead.
    """

    place = Place.DISPLACEMENT
    family = Family.HYSTERESIS
    order = 1
    source = "M. Nordin, P.-O. Gutman, Automatica 38 (2002) 1633: controlling systems with backlash"
    params = (Param("gap", "travel", (0.0, 10.0), "full width of the gap", off=0.0),)
    states = DRIVEN

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return behind(s, p.gap)

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return carried(s, p.gap, lambda d: p.gap / 2)

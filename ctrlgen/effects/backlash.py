"""Play in a gear, a nut or a joint."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, LawInputs, LawNumbers, Param, Place, State
from ctrlgen.effects._play_operators import beginning
from ctrlgen.effects._reversal_points import reversal_point

TOUCH = 1e-9  # typical travels from a side of the gap that count as touching it: at rest the sides stay in contact


class Backlash(Effect):
    """w = max(min(w, d + b/2), d - b/2), Delta d = 0.999 (w - d): the driven side stands still until b is crossed.

    The gap is entered where the motion reversed, also between two samples. Inside the gap a thousandth of the motion is
    transmitted, so that an inverse exists. Holds where friction keeps the driven side at rest inside the gap; a driven side that a
    spring pulls back follows the flank instead.
    """

    place = Place.DISPLACEMENT
    order = 1
    source = "M. Nordin, P.-O. Gutman, Automatica 38 (2002) 1633: controlling systems with backlash"
    params = (Param("gap", "travel", (0.0, 10.0), "full width of the gap", off=0.0),)
    states = (
        State("w", "travel", 1.0, stepped=True),  # counted from where it begins
        State("start", "1", 1.0, per_record=True),  # w begins at start b/2
        State("d", "travel", 1.0, stepped=True),
        State("v", "travel/s", 100.0, stepped=True),
    )

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return 0.999 * (s.states.w + beginning(s, p.gap / 2) - s.displacement)

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        first, touch = beginning(s, p.gap / 2), TOUCH * s.travel
        w = s.states.w + first
        for d in (reversal_point(s, s.states.d, s.states.v), s.displacement):
            low, high = d - p.gap / 2, d + p.gap / 2
            w = ca.if_else(w > high - touch, high, ca.if_else(w < low + touch, low, w))
        return {"w": w - first, "d": s.displacement, "v": 0 if s.velocity is None else s.velocity}

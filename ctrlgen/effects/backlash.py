"""Play in a gear, a nut or a joint."""

import casadi as ca

from ctrlgen.effects import Effect, Param, Place, State
from ctrlgen.effects._reversal_points import turned_at


class Backlash(Effect):
    """w = max(min(w, d + b/2), d - b/2), Delta d = 0.999 (w - d): what is carried stands still until b is crossed.

    A reversal between two samples is crossed where it happened, not where the samples stand. A thousandth of the
    motion comes through inside the gap, or no inverse could cross it. Holds where friction keeps the carried side at rest there.
    """

    place = Place.DISPLACEMENT
    order = 1
    source = "M. Nordin, P.-O. Gutman, Automatica 38 (2002) 1633: controlling systems with backlash"
    params = (Param("gap", "travel", (0.0, 1.0), "whole play", off=0.0),)
    states = (
        State("w", "travel", 1.0, stepped=True),
        State("d", "travel", 1.0, stepped=True),
        State("v", "travel/s", 100.0, stepped=True),
    )

    def term(self, s, p):
        return 0.999 * (s.w - s.displacement)

    def update(self, s, p):
        w = s.w
        for d in (turned_at(s, s.d, s.v), s.displacement):
            w = ca.fmax(ca.fmin(w, d + p.gap / 2), d - p.gap / 2)
        return {"w": w, "d": s.displacement, "v": 0 if s.velocity is None else s.velocity}

"""A driven side that stands still until a gap is crossed, which may be wider at one place than at another."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from ctrlgen.effects._law_inputs import Expression, LawInputs
from ctrlgen.effects._parameter import State
from ctrlgen.effects._play_operators import beginning
from ctrlgen.effects._reversal_points import reversal_point

TOUCH = 1e-9  # typical travels from a side of the gap that count as touching it: at rest the sides stay in contact
CARRIED = 0.999  # of the motion outside the gap; inside a thousandth is transmitted, so that an inverse exists
DRIVEN = (
    State("w", "travel", 1.0, stepped=True),  # counted from where it begins
    State("start", "1", 1.0, per_record=True),  # w begins at start b/2
    State("d", "travel", 1.0, stepped=True),
    State("v", "travel/s", 100.0, stepped=True),
)


def behind(s: LawInputs, gap: Expression) -> Expression:
    """0.999 (w - d)."""
    return CARRIED * (s.states.w + beginning(s, gap / 2) - s.displacement)


def carried(s: LawInputs, gap: Expression, half: Callable[[Expression], Expression]) -> dict[str, Expression]:
    """The states after w = max(min(w, d + h), d - h), h = half(d), first where the motion reversed, then at the sample."""
    first, touch = beginning(s, gap / 2), TOUCH * s.travel
    w = s.states.w + first
    for d in (reversal_point(s, s.states.d, s.states.v), s.displacement):
        low, high = d - half(d), d + half(d)
        w = ca.if_else(w > high - touch, high, ca.if_else(w < low + touch, low, w))
    return {"w": w - first, "d": s.displacement, "v": 0 if s.velocity is None else s.velocity}

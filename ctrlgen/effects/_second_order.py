"""A filter of two poles, or of one: what stands behind it, and how that moves."""

from __future__ import annotations

from ctrlgen.effects._law_inputs import Expression, LawInputs, LawNumbers
from ctrlgen.effects._parameter import Param, State

TAU = Param("tau", "s", (1e-4, 1e2), "one over the corner frequency in rad/s")
DAMPING = Param("damping", "1", (0.3, 20.0), "D: damping ratio")
FILTER_STATES = (State("w", "channel", 1.0), State("v", "channel", 1.0))


def behind_filter(s: LawInputs, p: LawNumbers) -> Expression:
    """g (w - x): what a filter of the share g makes of the value x."""
    return p.share * (s.states.w - s.value)


def filter_rates(s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
    """tau dw/dt = v, tau dv/dt = x - w - 2 D v."""
    return {"w": s.states.v / p.tau, "v": (s.value - s.states.w - 2 * p.damping * s.states.v) / p.tau}

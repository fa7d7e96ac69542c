"""A filter of two poles, or of one, of a reading or of a drive."""

from __future__ import annotations

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, State, itself

TAU = Param("tau", "s", (1e-4, 1e2), "one over the corner frequency in rad/s", paced=True)
DAMPING = Param("damping", "1", (0.3, 20.0), "D: damping ratio")


class SecondOrderFilter(Effect, listed=False):
    """tau dw/dt = v, tau dv/dt = x - w - 2 D v, Delta x = g (w - x): one law, named once per place."""

    family = Family.TIMING
    at_bounds = itself("tau", "damping")
    states = (State("w", "channel", 1.0), State("v", "channel", 1.0))

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (s.states.w - s.value)

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"w": s.states.v / p.tau, "v": (s.value - s.states.w - 2 * p.damping * s.states.v) / p.tau}

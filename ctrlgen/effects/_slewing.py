"""A drive that follows no faster than at a rate, up and down."""

from __future__ import annotations

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State

SHARE = Param("share", "1", (0.0, 1.5), "1: nothing of the drive changes faster", off=0.0)


class Slewing(Effect, listed=False):
    """dv/dt = R sign(u - v) until v = u; Delta u = g (v - u): one law, named for one rate both ways and for two.

    Over a sample h, with c the part of u - v before it that is within -R h (down) and +R h (up), and k = |c|/(R h): v grows by c in the
    time k h, and then stays. What acts is the line over the sample that has the mean v + c (1 - k/2) of this and its first moment: it
    rises by c k (3 - 2 k), and is v itself where k = 1.
    """

    place = Place.DRIVE
    family = Family.TIMING
    order = -1  # of what is not clipped, and before the gains, which act on what is delivered
    requires = frozenset({"actuator", "sample_time"})
    source = "J. E. Solomon, IEEE J. Solid-State Circuits 9 (1974) 314: slew rate of a monolithic operational amplifier"
    limits_rate = "rate"
    states = (
        State("v", "channel", 1.0, stepped=True, free=True),
        State("mean", "channel", 1.0, stepped=True),
        State("rise", "channel", 1.0, stepped=True),
        State("w", "channel", 1.0, ramp=True),  # along the line, from its beginning
    )

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (s.states.mean - s.states.rise / 2 + s.states.w - s.value)

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"w": s.states.rise / s.sample_time}

    def resting(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"v": s.value, "mean": s.value, "rise": 0.0}

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        up, down = self.most(s, p)
        c = ca.fmax(ca.fmin(s.value - s.states.v, up), -down)
        k = ca.fmax(c / up, -c / down)
        return {
            "v": s.states.v + c,
            "mean": s.states.v + c * (1 - k / 2),
            "rise": c * k * (3 - 2 * k),
        }

    def most(self, s: LawInputs, p: LawNumbers) -> tuple[Expression, Expression]:
        """The largest change over a sample, up and down."""
        return p.rate * s.sample_time, p.rate * s.sample_time

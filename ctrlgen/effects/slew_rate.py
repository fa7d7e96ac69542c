"""An amplifier whose output changes at most so fast."""

from typing import ClassVar

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Plainer, State, itself


class SlewRate(Effect):
    """dv/dt = R sign(u - v) until v = u; Delta u = g (v - u): g = 1 is limited throughout.

    Over a sample h, with c the part of u - v before it that is within +-R h and k = |c|/(R h): v grows by c in the time k h, and then
    stays. What acts is the line over the sample that has the mean v + c (1 - k/2) of this and its first moment: it rises by
    c k (3 - 2 k), and is v itself where k = 1. Holds for a rate that is the same both ways and a drive held from sample to sample.
    """

    place = Place.DRIVE
    family = Family.TIMING
    order = -1  # of what is not clipped, and before the gains, which act on what is delivered
    requires = frozenset({"actuator", "sample_time"})
    source = "J. E. Solomon, IEEE J. Solid-State Circuits 9 (1974) 314: slew rate of a monolithic operational amplifier"
    params: ClassVar[tuple[Param, ...]] = (
        Param("share", "1", (0.0, 1.5), "1: nothing of the drive changes faster", off=0.0),
        Param("rate", "channel/s", (1e-3, 1e6), "R: fastest change of what is delivered", paced=True),
    )
    at_bounds = itself("rate")
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


class AsymmetricSlewRate(SlewRate):
    """As `slew_rate`, with rates of its own both ways: R (1 + a) rising and R falling for a > 0, R rising and R (1 - a) falling for a < 0.

    R is the slower one, which holds for a path in either direction. Holds as `slew_rate`.
    """

    title = "An amplifier whose output changes at most so fast, up faster than down or down faster than up"
    params = (*SlewRate.params, Param("excess", "1", (-9.0, 9.0), "a: by how much the quicker way is quicker"))
    at_bounds = itself("rate", "excess")
    plainer = Plainer("slew_rate", {"excess": 0.0})

    def most(self, s: LawInputs, p: LawNumbers) -> tuple[Expression, Expression]:
        up, down = super().most(s, p)
        return up * (1 + ca.fmax(p.excess, 0.0)), down * (1 + ca.fmax(-p.excess, 0.0))

"""An amplifier whose output changes at most so fast."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, itself


class SlewRate(Effect):
    """dv/dt = R sign(u - v) until v = u; Delta u = g (v - u): g = 1 is limited throughout.

    Over a sample h, with c the part of u - v before it that is within +-R h and k = |c|/(R h): v grows by c in the time k h, and then
    stays. What acts is the parabola that ends with the sample where v does, and has its mean and first moment: of sigma, the part of the
    sample that is left, v + c + c k (3 - 4 k) sigma - 6 c k (1 - k) sigma^2; v itself where k = 1. So a stage that has no inertia is
    where v holds it when it is read. Holds for a rate that is the same both ways and a drive held from sample to sample.
    """

    place = Place.DRIVE
    family = Family.TIMING
    order = -1  # of what is not clipped, and before the gains, which act on what is delivered
    requires = frozenset({"actuator", "sample_time"})
    source = "J. E. Solomon, IEEE J. Solid-State Circuits 9 (1974) 314: slew rate of a monolithic operational amplifier"
    params = (
        Param("share", "1", (0.0, 1.5), "1: nothing of the drive changes faster", off=0.0),
        Param("rate", "channel/s", (1e-3, 1e6), "R: fastest change of what is delivered"),
    )
    at_bounds = itself("rate")
    limits_rate = "rate"
    states = (
        State("v", "channel", 1.0, stepped=True, free=True),
        State("tilt", "channel", 1.0, stepped=True),
        State("bend", "channel", 1.0, stepped=True),
        State("w", "1", 1.0, ramp=True),  # part of the sample that has passed
    )

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        left = 1 - s.states.w
        return p.share * (s.states.v + s.states.tilt * left + s.states.bend * left**2 - s.value)

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"w": 1 / s.sample_time}

    def resting(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"v": s.value, "tilt": 0.0, "bend": 0.0}

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        most = p.rate * s.sample_time
        c = ca.fmax(ca.fmin(s.value - s.states.v, most), -most)
        k = ca.fabs(c) / most
        return {"v": s.states.v + c, "tilt": c * k * (3 - 4 * k), "bend": -6 * c * k * (1 - k)}

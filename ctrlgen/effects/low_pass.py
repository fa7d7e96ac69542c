"""A sensor, or its filter, of limited bandwidth."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, itself


class LowPass(Effect):
    """tau dw/dt = v, tau dv/dt = y - w - 2 D v, Delta y = g (w - y): g = 1 is a second-order filter; below, only that share is filtered.

    D < 1 rings, D = 1/sqrt(2) is Butterworth's, a large D is a single pole of time constant 2 D tau. Holds where
    the sampling resolves tau.
    """

    place = Place.SENSOR
    family = Family.TIMING
    order = 2
    source = "A. J. Fleming, Sensors and Actuators A 190 (2013) 106: sensor bandwidth"
    params = (
        Param("share", "1", (-0.5, 1.5), "share of the reading that is filtered", off=0.0),
        Param("tau", "s", (1e-4, 1e2), "one over the corner frequency in rad/s"),
        Param("damping", "1", (0.3, 20.0), "D: damping ratio"),
    )
    at_bounds = itself("tau", "damping")
    states = (State("w", "channel", 1.0), State("v", "channel", 1.0))

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (s.states.w - s.value)

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"w": s.states.v / p.tau, "v": (s.value - s.states.w - 2 * p.damping * s.states.v) / p.tau}

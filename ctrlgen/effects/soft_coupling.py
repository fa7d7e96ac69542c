"""A load behind a soft coupling, or a sensor on a springy mount: it rings."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, itself


class SoftCoupling(Effect):
    """dw/dt = W v, dv/dt = W (y - w - 2 D v), W = 2 pi f, Delta y = g (w - y): a mass on a spring that follows y, read in its place; g = 1.

    f = sqrt(k/m)/2 pi, D = c/2 sqrt(k m) below 0.3: a filter that rings less is a `low_pass`. Holds for one mode. Of an axis whose mass
    is described it is a `resonance`.
    """

    place = Place.SENSOR
    family = Family.DYNAMICS
    order = 2
    requires = frozenset({"actuator"})
    source = "J. P. Den Hartog, Mechanical Vibrations (1956), chapter 2: motion of the support"
    params = (
        Param("share", "1", (-0.5, 1.5), "share of the reading that rings", off=0.0),
        Param("frequency", "Hz", (0.5, 2e3), "frequency of the load", paced=True),
        Param("damping", "1", (1e-3, 0.3), "D: damping ratio"),
    )
    at_bounds = itself("frequency", "damping")
    states = (State("w", "channel", 1.0), State("v", "channel", 1.0))

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (s.states.w - s.value)

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        w = 2 * ca.pi * p.frequency
        return {"w": w * s.states.v, "v": w * (s.value - s.states.w - 2 * p.damping * s.states.v)}

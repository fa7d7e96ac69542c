"""A converter, counter or encoder of coarse resolution."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself


class Quantisation(Effect):
    """Delta y = s (q floor(y/q + 1/2) - y), s = 1 for true rounding to steps q.

    Holds for rounding to the nearest step. Linear in s; discontinuous in q and y, so that q is searched over
    values and not by its derivative.
    """

    place = Place.SENSOR
    family = Family.PERIODIC
    order = 5
    source = "B. Widrow, I. Kollar, Quantization Noise (2008)"
    params = (
        Param("share", "1", (0.0, 1.5), "1: every reading is rounded", off=0.0),
        Param("quantum", "channel", (1e-7, 1.0), "q: step"),
    )
    at_bounds = itself("quantum")
    in_steps = True

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (p.quantum * ca.floor(s.value / p.quantum + 0.5) - s.value)

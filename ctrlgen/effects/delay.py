"""A reading that reports what was some time ago."""

from math import prod

import casadi as ca

from ctrlgen.effect import Effect, Param, Place, State

SAMPLES = 5


class Delay(Effect):
    """Delta y(t) = y(t - tau) - y(t), by Lagrange's polynomial through the present and the last five samples.

    Holds up to five samples and below a fifth of the sampling rate; longer delays count as five samples.
    """

    place = Place.SENSOR
    needs = frozenset({"sample_time"})
    source = "T. I. Laakso et al., IEEE Signal Processing Magazine 13 (1996) 30: splitting the unit delay"
    params = (Param("delay", "ms", (0.0, 500.0), "age of the reading", off=0.0),)
    states = tuple(State(f"y{k}", "channel", 1.0, stepped=True) for k in range(SAMPLES + 1))

    def term(self, s, p):
        D = ca.fmin(p.delay / s.sample_time, SAMPLES)
        every = range(SAMPLES + 1)
        weights = [prod((D - m) / (k - m) for m in every if m != k) for k in every]
        return sum(w * (getattr(s, f"y{k}") - s.value) for k, w in enumerate(weights))

    def update(self, s, p):
        return {"y0": s.value, **{f"y{k}": getattr(s, f"y{k - 1}") for k in range(1, SAMPLES + 1)}}

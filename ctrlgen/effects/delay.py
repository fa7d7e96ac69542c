"""A reading that reports what was some time ago."""

import casadi as ca

from ctrlgen.effect import Effect, Param, Place, State

SAMPLES = 5
EVERY = range(SAMPLES + 1)


class Delay(Effect):
    """Delta y(t) = y(t - tau) - y(t), by cubic Hermite polynomials through values and slopes of the last five samples.

    Holds up to five samples (longer delays count as five) and below a fifth of the sampling rate. Where the slope of
    the signal is not known, it is that of the neighbouring samples.
    """

    place = Place.SENSOR
    rough = 0.002  # by interpolation
    needs = frozenset({"sample_time"})
    source = "T. I. Laakso et al., IEEE Signal Processing Magazine 13 (1996) 30: splitting the unit delay"
    params = (Param("delay", "ms", (0.0, 500.0), "age of the reading", off=0.0),)
    states = (
        *(State(f"y{k}", "channel", 1.0, stepped=True) for k in EVERY),
        *(State(f"r{k}", "channel/s", 10.0, stepped=True) for k in EVERY),
    )

    def term(self, s, p):
        D = ca.fmin(p.delay / s.sample_time, SAMPLES)
        total = 0.0
        for k in EVERY:
            t = k - D
            near = ca.fmax(1 - ca.fabs(t), 0)
            total += near**2 * (3 - 2 * near) * (getattr(s, f"y{k}") - s.value)
            total += t * near**2 * s.sample_time * getattr(s, f"r{k}")
        return total

    def update(self, s, p):
        slope = (s.value - s.y0) / s.sample_time if s.rate is None else s.rate
        new = {"y0": s.value, "r0": slope}
        for k in EVERY[1:]:
            new |= {f"y{k}": getattr(s, f"y{k - 1}"), f"r{k}": getattr(s, f"r{k - 1}")}
        if s.rate is None:
            new["r1"] = (s.value - s.y1) / (2 * s.sample_time)
        return new

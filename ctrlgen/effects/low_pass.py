"""A sensor, or its filter, that comes late."""

from ctrlgen.effect import Effect, Param, Place, State


class LowPass(Effect):
    """dw/dt = (y - w)/tau, Delta y = g (w - y): with g = 1 a first-order filter, below it a slow part only.

    Holds for one pole; the sampling must resolve tau.
    """

    place = Place.SENSOR
    source = "A. J. Fleming, Sensors and Actuators A 190 (2013) 106: sensor bandwidth"
    params = (
        Param("share", "1", (-0.5, 1.5), "part of the reading that is filtered", off=0.0),
        Param("tau", "s", (1e-4, 1e2), "time constant", grid=(1e-3, 5e-3, 0.025, 0.1, 0.5, 3.0)),
    )
    states = (State("w", "channel", 1.0),)

    def term(self, s, p):
        return p.share * (s.w - s.value)

    def rates(self, s, p):
        return {"w": (s.value - s.w) / p.tau}

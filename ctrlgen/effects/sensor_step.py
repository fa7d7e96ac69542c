"""A reading that jumps at a moment: counts lost, a target touched."""

import casadi as ca

from ctrlgen.effect import Effect, Param, Place, State


class SensorStep(Effect):
    """Delta y = b (1 + tanh((t - t_0)/w))/2, t from the common zero of the records' clock. Holds for one event."""

    place = Place.SENSOR
    domain = "disturbance"
    source = "definition"
    params = (
        Param("offset", "channel", (-1e3, 1e3), "after the step", off=0.0),
        Param("moment", "s", (-1e6, 1e6), "when it happens", grid=(0.3, 1.0, 3.0, 5.0, 10.0, 20.0, 30.0, 50.0)),
        Param("rise", "s", (1e-4, 1e2), "time it takes", grid=(0.02,)),
    )
    states = (State("t", "s", 1.0, clock=True),)

    def term(self, s, p):
        return p.offset * (1 + ca.tanh((s.t - p.moment) / p.rise)) / 2

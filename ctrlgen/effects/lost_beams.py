"""Beams, or a winding, that break at a moment."""

import casadi as ca

from ctrlgen.effect import Effect, Param, Place, State


class LostBeams(Effect):
    """Delta F = -g F (1 + tanh((t - t_0)/w))/2, t from the common zero of the records' clock. Holds for one event."""

    place = Place.FORCE
    needs = frozenset({"actuator", "force"})
    source = "R. Isermann, Fault-Diagnosis Systems (2006): abrupt faults"
    params = (
        Param("share", "1", (0.0, 1.0), "part of the force that is lost", off=0.0),
        Param("moment", "s", (-1e6, 1e6), "when it happens", grid=(0.3, 1.0, 3.0, 5.0, 10.0, 20.0, 30.0, 50.0)),
        Param("rise", "s", (1e-4, 1e2), "time it takes", grid=(0.02,)),
    )
    states = (State("t", "s", 1.0, clock=True),)

    def term(self, s, p):
        return -p.share * s.value * (1 + ca.tanh((s.t - p.moment) / p.rise)) / 2

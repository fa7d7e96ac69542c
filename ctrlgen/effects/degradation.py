"""An actuator that slowly loses strength."""

import casadi as ca

from ctrlgen.effects import Effect, Param, Place, State


class Degradation(Effect):
    """Delta u = -r T (1 - exp(-t/T)) u, t from the common zero of the records' clock: at first r a second, r T in the end.

    T far beyond the records is a steady loss. Holds while the loss is below 0.3.
    """

    place = Place.DRIVE
    requires = frozenset({"actuator"})
    source = "R. Isermann, Fault-Diagnosis Systems (2006): incipient faults"
    params = (
        Param("rate", "1/s", (-0.1, 0.1), "relative loss per time, at first", off=0.0),
        Param("levels_off", "s", (0.3, 1e6), "T: when the loss comes to its end"),
    )
    states = (State("t", "s", 1.0, clock=True),)

    def term(self, s, p):
        return -p.rate * p.levels_off * (1 - ca.exp(-s.t / p.levels_off)) * s.value

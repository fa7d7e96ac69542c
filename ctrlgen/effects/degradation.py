"""An actuator that slowly loses strength."""

from ctrlgen.effect import Effect, Param, Place, State


class Degradation(Effect):
    """Delta u = -r t u, t from the common zero of the records' clock. Holds while r t is below 0.3."""

    place = Place.DRIVE
    needs = frozenset({"actuator"})
    source = "R. Isermann, Fault-Diagnosis Systems (2006): incipient faults"
    params = (Param("rate", "1/s", (-0.1, 0.1), "relative loss per time", off=0.0),)
    states = (State("t", "s", 1.0, clock=True),)

    def term(self, s, p):
        return -p.rate * s.t * s.value

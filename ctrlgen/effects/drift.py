"""A reading that moves with time alone."""

from ctrlgen.effects import Effect, Param, Place, State


class Drift(Effect):
    """Delta y = r t, t from the common zero of the records' clock. Holds over times short against what drifts."""

    place = Place.SENSOR
    order = -1  # what warms or sags moves along the path: fringes count it
    source = "definition"
    params = (Param("rate", "channel/s", (-1.0, 1.0), "drift per time", off=0.0),)
    states = (State("t", "s", 1.0, clock=True),)

    def term(self, s, p):
        return p.rate * s.t

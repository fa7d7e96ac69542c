"""A reading that moves with time alone."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State


class Drift(Effect):
    """Delta y = r t, t from the common zero of the records' clock. Holds over times short against the time constant of what drifts."""

    place = Place.SENSOR
    family = Family.EVENTS
    order = -1  # before `cyclic`: what drifts moves the target along the fringes
    source = "definition"
    params = (Param("rate", "channel/s", (-1.0, 1.0), "drift per time", off=0.0, paced=True),)
    states = (State("t", "s", 1.0, clock=True),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.rate * s.states.t

"""A reading that drifts until the machine is warm."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, itself


class WarmUp(Effect):
    """Delta y = A (1 - exp(-t/tau)), t from the common zero of the records' clock: a body of one thermal time constant comes to the
    temperature of a source that is on from that moment; where it began earlier, A is what was still to come.

    With tau far beyond the recording it is a `drift` of A/tau. Holds for one time constant.
    """

    place = Place.SENSOR
    family = Family.EVENTS
    requires = frozenset({"sample_time"})  # poses are too few to tell it from a drift
    order = -1  # as `drift`
    source = "ISO 230-3:2020: thermal drift of a machine that warms up; the lumped body's exponential"
    params = (
        Param("size", "channel", (-1.0, 1.0), "A: drift in the end", off=0.0),
        Param("tau", "s", (0.3, 1e6), "time constant of the warming", paced=True),
    )
    at_bounds = itself("tau")
    states = (State("t", "s", 1.0, clock=True),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.size * (1 - ca.exp(-s.states.t / p.tau))

"""A reading that moves with time alone."""

from typing import ClassVar

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State


class Drift(Effect):
    """Delta y = r t, t from the common zero of the records' clock. Holds over times short against the time constant of what drifts."""

    place = Place.SENSOR
    family = Family.EVENTS
    order = -1  # before `cyclic`: what drifts moves the target along the fringes
    source = "definition"
    params = (Param("rate", "channel/s", (-1.0, 1.0), "drift per time", off=0.0, paced=True),)
    states: ClassVar[tuple[State, ...]] = (State("t", "s", 1.0, clock=True),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.rate * s.states.t


class DriftPerRecord(Drift):
    """Delta y = g (b + r t), db/dt = dr/dt = 0: b and r are constant within a record, others in each, and fitted there; g = 1.

    So drifts what warms up anew before each run. Holds as `drift`; outside a diagnosis b = r = 0.
    """

    title = "A reading that drifts with time, at another rate in each record"
    params = (Param("share", "1", (0.0, 2.0), "1: the rates are free", off=0.0),)
    states = (
        *Drift.states,
        State("zero", "channel", 1.0, per_record=True),
        State("drift", "channel/s", 1.0, per_record=True),
    )

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (s.states.zero + s.states.drift * s.states.t)

"""Beams, or a winding, that break at one moment."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself
from ctrlgen.effects._smooth_step import CLOCK, WHEN, smooth_step


class LostBeams(Effect):
    """Delta F = -g F e(t), e from 0 to 1 within the time T about the moment t_0. Holds for one event."""

    place = Place.FORCE
    family = Family.EVENTS
    requires = frozenset({"actuator", "force"})
    source = "R. Isermann, Fault-Diagnosis Systems (2006): abrupt faults"
    params = (
        Param("share", "1", (0.0, 1.0), "share of the force that is lost", off=0.0),
        *WHEN,
    )
    at_bounds = itself("moment", "rise")
    states = CLOCK

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.share * s.value * smooth_step(s, p)

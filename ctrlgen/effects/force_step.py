"""A force that sets in at a moment: something dropped on the stage, a cable that drags, air that is switched on."""

from ctrlgen.effects import Effect, Param, Place
from ctrlgen.effects._smooth_step import CLOCK, WHEN, happened


class ForceStep(Effect):
    """Delta F = f e(t), e from 0 to 1 within the time T about the moment t_0. Holds for one event."""

    place = Place.FORCE
    requires = frozenset({"force"})
    active = True
    source = "definition"
    params = (
        Param("force", "channel", (-1.0, 1.0), "after the step", off=0.0),
        *WHEN,
    )
    states = CLOCK

    def term(self, s, p):
        return p.force * happened(s, p)

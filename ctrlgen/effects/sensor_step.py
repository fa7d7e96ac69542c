"""A reading that jumps at a moment: counts lost, a target touched."""

from ctrlgen.effects import Effect, Param, Place
from ctrlgen.effects._smooth_step import CLOCK, WHEN, happened


class SensorStep(Effect):
    """Delta y = b e(t), e from 0 to 1 within the time T about the moment t_0. Holds for one event."""

    place = Place.SENSOR
    source = "definition"
    params = (
        Param("offset", "channel", (-1e3, 1e3), "after the step", off=0.0),
        *WHEN,
    )
    states = CLOCK

    def term(self, s, p):
        return p.offset * happened(s, p)

"""A lever whose arms are not as drawn."""

from ctrlgen.effects import Effect, Param, Place


class LeverRatio(Effect):
    """Delta d = g d: the mechanism is carried g further than the stage model says. Holds for small lever angles."""

    place = Place.DISPLACEMENT
    source = "definition"
    params = (Param("gain", "1", (-0.3, 0.3), "relative excess of travel", off=0.0),)

    def term(self, s, p):
        return p.gain * s.value

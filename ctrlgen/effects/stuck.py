"""A dead channel: it reports one number, whatever the motion."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself


class Stuck(Effect):
    """Delta y = -s (y - y_0), s = 1 for a channel that stands at y_0. Holds for a channel that is dead throughout."""

    place = Place.SENSOR
    family = Family.GAIN
    order = 5
    source = "R. Isermann, Fault-Diagnosis Systems (2006): sensor faults"
    params = (
        Param("share", "1", (0.0, 1.2), "1: nothing of the motion is read", off=0.0),
        Param("level", "channel", (-1e3, 1e3), "y_0: what is reported"),
    )
    at_bounds = itself("level")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.share * (s.value - p.level)

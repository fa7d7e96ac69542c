"""An actuator connected the wrong way round."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class Reversed(Effect):
    """Delta u = -2 g u: the sign is reversed for g = 1. Holds for g = 1 only: for g < 1/2 it is a weak drive,
    which is `drive_gain`."""

    place = Place.DRIVE
    family = Family.GAIN
    requires = frozenset({"actuator", "bipolar"})
    source = "definition"
    params = (Param("share", "1", (0.0, 1.2), "1: the sign is reversed", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -2 * p.share * s.value

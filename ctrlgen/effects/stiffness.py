"""A stage stiffer, or softer, than the drawing says."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class Stiffness(Effect):
    """E = k d^2/2, hence Delta F = -k d on the actuator bar. Holds for d below the flexure's thickness."""

    place = Place.FORCE
    family = Family.GAIN
    requires = frozenset({"force"})
    source = "definition"
    params = (Param("stiffness", "channel/travel", (-10.0, 10.0), "stiffness beyond the nominal one", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.stiffness * s.displacement

"""A flexure that is bent or loaded already at home: stiffer to one side than to the other."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class OneSidedStiffening(Effect):
    """E = k_2 d^3/3, hence Delta F = -k_2 d^2 on the actuator bar. Holds for k_2 d well below the stage's own stiffness."""

    place = Place.FORCE
    family = Family.ELASTIC
    requires = frozenset({"force", "bipolar"})
    source = "definition: second term of the power series of a restoring force"
    params = (Param("k2", "channel/travel^2", (-10.0, 10.0), "quadratic stiffness", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.k2 * s.displacement**2

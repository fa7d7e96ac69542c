"""A clamped flexure stretches as it bends."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class Stiffening(Effect):
    """E = k_3 d^4/4, hence Delta F = -k_3 d^3 on the actuator bar. Holds for d below the flexure's thickness.

    A negative k_3 is softening.
    """

    place = Place.FORCE
    family = Family.ELASTIC
    requires = frozenset({"force"})
    source = "S. Timoshenko, Strength of Materials II (1956), large deflection of clamped beams"
    params = (Param("k3", "channel/travel^3", (-10.0, 10.0), "cubic stiffness", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.k3 * s.displacement**3

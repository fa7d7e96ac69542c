"""Beams whose thermal expansion, or stiffness, depends on temperature differently from the model."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class Expansion(Effect):
    """Delta F = a (T - T_rest) F: thermal expansion whose coefficient grows by the share a per kelvin.

    Holds for a (T - T_rest) below 0.3.
    """

    place = Place.FORCE
    family = Family.THERMAL
    requires = frozenset({"state"})
    source = "Y. Okada, Y. Tokumaru, J. Appl. Phys. 56 (1984) 314: expansion of silicon between 300 and 1500 K"
    params = (Param("slope", "1/K", (-1e-2, 1e-2), "relative change of force per kelvin", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.slope * (s.temperature - s.temperature_at_rest) * s.value

"""A heater whose resistance changes with temperature, driven by an amplifier that was set for the cold heater."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class HeaterResistance(Effect):
    """R = R_0 (1 + a (T - T_rest)) at given voltage: Delta P = P (1/(1 + a (T - T_rest)) - 1).

    Holds for 1 + a (T - T_rest) > 0: metals and doped silicon up to 800 K. For a given current the sign of a is reversed, to first order.
    """

    place = Place.HEAT
    family = Family.DRIVE
    requires = frozenset({"heat", "state"})
    source = "definition: linear temperature coefficient of resistance"
    params = (Param("slope", "1/K", (-1e-3, 1e-2), "relative change of resistance per kelvin", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        rise = p.slope * (s.temperature - s.temperature_at_rest)
        return -s.value * rise / (1 + rise)

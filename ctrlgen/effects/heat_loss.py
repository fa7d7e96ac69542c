"""A heater that loses heat otherwise than in proportion to its temperature, as radiation, convection and silicon do."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself

STILL = 1e-3  # of T_rest: a rise below it counts as that much in the power, which has no slope at zero


class HeatLoss(Effect):
    """G = G_0 (1 + b DT (DT/T_rest)^(n-1)), DT = T - T_rest: the conductance to the surroundings changes with the temperature, by b DT at
    twice T_rest. Hence Delta P = -G_0 DT (G/G_0 - 1), and the time constant C/G changes with it.

    n = 1 is a linear coefficient, n = 1/4 free convection beside conduction. Up to DT = 500 K radiation (n about 1.5) and a conductivity
    that falls as T^-1.3, as silicon's (b < 0, n about 0.6), are met within 1.3 % of what they add; with n = 1 within 12 %. Holds while the
    loss rises with the temperature.
    """

    place = Place.HEAT
    family = Family.THERMAL
    requires = frozenset({"heat", "state"})
    source = "J. H. Lienhard, A Heat Transfer Textbook (2019), chapter 1: convection by a power of the rise, radiation"
    params = (
        Param("coefficient", "1/K", (-1e-3, 1e-2), "b: relative change of the conductance per kelvin", off=0.0),
        Param("power", "1", (0.2, 3.0), "n: 1 where the conductance is linear in the temperature"),
    )
    at_bounds = itself("power")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        rest = s.temperature_at_rest
        rise = s.temperature - rest
        size = ca.sqrt(rise**2 + (STILL * rest) ** 2) / rest
        return -s.holding_heat * p.coefficient * rise * size ** (p.power - 1)

"""A heater whose resistance changes with temperature by a curve: platinum's bends, doped silicon's rises and then falls."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Plainer, itself

LEAST = 0.05  # of R_0: a search may try numbers at which the parabola has no resistance any more


class HeaterResistanceOfSecondOrder(Effect):
    """R = R_0 (1 + a DT (1 + c DT)), DT = T - T_rest, at given voltage: Delta P = P (R_0/R - 1). R is at least a twentieth of R_0.

    In the words of Callendar and Van Dusen, from 0 degC, a = A and c = B/A: -1.5e-4 1/K of platinum. With c < 0 < a the resistance is
    largest at DT = -1/(2 c), as doped silicon's where it becomes intrinsic. Holds for metals, and for silicon up to where R falls steeply.
    """

    title = "A heater whose resistance rises with temperature and bends, or falls again"
    place = Place.HEAT
    family = Family.DRIVE
    requires = frozenset({"heat", "state"})
    source = "IEC 60751: the Callendar-Van Dusen equation"
    params = (
        Param("slope", "1/K", (-1e-3, 1e-2), "a: relative change of resistance per kelvin, at rest", off=0.0),
        Param("curvature", "1/K", (-5e-3, 5e-3), "c: relative change of that per kelvin"),
    )
    at_bounds = itself("curvature")
    plainer = Plainer("heater_resistance", {"curvature": 0.0})

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        warm = s.temperature - s.temperature_at_rest
        rise = p.slope * warm * (1 + p.curvature * warm)
        return s.value * (1 / ca.fmax(1 + rise, LEAST) - 1)

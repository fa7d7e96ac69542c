"""A reading that moves with the temperature of the surroundings above one temperature: a clearance that is used up, a seal that grips."""

import casadi as ca

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds, Side


class TemperatureSensitivityAbove(Effect):
    """Delta y = c max(T - T_0, 0), T the rise of the surroundings' temperature, T_0 that from which on the reading moves.

    Holds for changes slow against the instrument's thermal time constant.
    """

    title = "A reading that moves with the temperature of the surroundings above one temperature"
    place = Place.SENSOR
    family = Family.THERMAL
    order = -1  # before `cyclic`: what drifts moves the target along the fringes
    requires = frozenset({"ambient"})
    source = "definition"
    params = (
        Param("slope", "channel/K", (-10.0, 10.0), "c: change of the reading per kelvin of the surroundings", off=0.0),
        Param("reference", "K", (-30.0, 30.0), "T_0: rise above which the reading moves"),
    )
    at_bounds = {"reference": ShapeBounds(low="an error of every temperature")}
    acts_in = ActsIn("temperature", "reference", Side.ABOVE)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.slope * ca.fmax(s.ambient - p.reference, 0)

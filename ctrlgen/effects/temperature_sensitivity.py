"""A reading that moves with the temperature of the surroundings."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds


class TemperatureSensitivity(Effect):
    """Delta y = c (T - T_0), T the rise of the surroundings' temperature, T_0 its value when home was set.

    Holds for changes slow against the instrument's thermal time constant.
    """

    place = Place.SENSOR
    family = Family.THERMAL
    order = -1  # before `cyclic`: what drifts moves the target along the fringes
    requires = frozenset({"ambient"})
    source = "definition"
    params = (
        Param("slope", "channel/K", (-10.0, 10.0), "change of the reading per kelvin of the surroundings", off=0.0),
        Param("reference", "K", (-30.0, 30.0), "rise at which the reading is right, T_0"),
    )
    # far from where it is right, it is off by nearly the same at every temperature
    at_bounds = {"reference": ShapeBounds(low="an offset", high="an offset")}

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.slope * (s.ambient - p.reference)

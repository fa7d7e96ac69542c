"""A reading that moves with the temperature of the surroundings."""

from ctrlgen.effects import Effect, Param, Place


class TemperatureSensitivity(Effect):
    """Delta y = c (T - T_0), T the rise of the surroundings, T_0 the rise at which home was set.

    Holds for changes slow against the instrument's thermal time constant.
    """

    place = Place.SENSOR
    order = -1  # what warms or sags moves along the path: fringes count it
    requires = frozenset({"ambient"})
    source = "definition"
    params = (
        Param("slope", "channel/K", (-10.0, 10.0), "reading per rise of the surroundings", off=0.0),
        Param("reference", "K", (-30.0, 30.0), "rise at which the reading is right"),
    )

    def term(self, s, p):
        return p.slope * (s.ambient - p.reference)

"""A reading that moves with the temperature of the surroundings above one temperature: a clearance that is used up, a seal that grips."""

from ctrlgen.effects import ActsIn, Effect, Expression, LawInputs, LawNumbers, Param, Place, Side
from ctrlgen.effects._region import ramp

ROUNDING = 1e-3  # K


class TemperatureSensitivityAbove(Effect):
    """Delta y = c x^2/(x + e), x = T - T_0 where positive, T the rise of the surroundings' temperature; e = 1 mK rounds the corner.

    Holds for changes slow against the instrument's thermal time constant.
    """

    title = "A reading that moves with the temperature of the surroundings above one temperature"
    place = Place.SENSOR
    order = -1  # before `cyclic`: what drifts moves the target along the fringes
    requires = frozenset({"ambient"})
    source = "definition"
    params = (
        Param("slope", "channel/K", (-10.0, 10.0), "c: change of the reading per kelvin of the surroundings", off=0.0),
        Param("reference", "K", (-30.0, 30.0), "T_0: rise above which the reading moves"),
    )
    acts_in = ActsIn("temperature", "reference", Side.ABOVE)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.slope * ramp(s.ambient - p.reference, ROUNDING)

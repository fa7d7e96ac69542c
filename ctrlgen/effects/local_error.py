"""A reading that is off on a short stretch: a scratch or dirt on a scale, a damaged tooth, a bruised target."""

import casadi as ca

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Side, itself
from ctrlgen.effects._region import plateau


class LocalError(Effect):
    """Delta y = b (tanh(2 (x + w/2)/r) - tanh(2 (x - w/2)/r))/(2 tanh(w/r)), x = y - y_0: b on the stretch w about y_0, zero elsewhere,
    changing over r at both ends: a plateau for r well below w, a bell otherwise.

    Holds for slopes above -1, so that the reading still rises with the position; for positions and angles only.
    """

    place = Place.SENSOR
    family = Family.GEOMETRY
    channel_unit = ("m", "rad")
    source = "definition"
    params = (
        Param("error", "channel", (-0.1, 0.1), "b: error in the middle of the stretch", off=0.0),
        Param("position", "channel", (-2.0, 2.0), "y_0: middle of the stretch"),
        Param("length", "channel", (1e-4, 1.0), "w: length of the stretch"),
        Param("rounding", "channel", (1e-4, 0.5), "r: way over which it sets in and ends"),
    )
    at_bounds = itself("position", "length", "rounding")
    acts_in = ActsIn("position", "position", Side.AROUND, "length", "rounding")

    @classmethod
    def contradiction(cls, p: dict[str, float]) -> str:
        # the steepest slope of tanh(2 x/r)/2 is 1/r; of a bell it is less
        steep = abs(p["error"]) >= max(p["rounding"], p["length"] / 2)
        return "its error is so large beside its length that the reading would turn back" if steep else ""

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.error * plateau(s.value - p.position, p.length, p.rounding) / ca.tanh(p.length / p.rounding)

"""A reading that is off beyond one position: a scale of two pieces, a switched range, a wrong quadrant."""

import casadi as ca

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Side, itself


class StitchingError(Effect):
    """Delta y = b (1 + tanh(2 (y - y_0)/w))/2: zero before y_0, b beyond, changing over the width w.

    Holds for b > -w, so that the reading still rises with the position; for positions and angles only.
    """

    place = Place.SENSOR
    family = Family.GEOMETRY
    channel_unit = ("m", "rad")
    source = "definition"
    params = (
        Param("offset", "channel", (-0.1, 0.1), "b: error beyond the position", off=0.0),
        Param("position", "channel", (-2.0, 2.0), "y_0: position at which it sets in"),
        Param("width", "channel", (1e-4, 0.05), "w: width over which it sets in"),
    )
    at_bounds = itself("position", "width")
    acts_in = ActsIn("position", "position", Side.ABOVE)

    @classmethod
    def contradiction(cls, p: dict[str, float]) -> str:
        return (
            "its offset is so large beside its width that the reading would turn back"
            if p["offset"] <= -p["width"]
            else ""
        )

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.offset * (1 + ca.tanh(2 * (s.value - p.position) / p.width)) / 2

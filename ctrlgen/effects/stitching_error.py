"""A reading that is off beyond a place of its path: a scale of two pieces, a range switched, a quadrant taken for another."""

import casadi as ca

from ctrlgen.effects import Effect, Param, Place


class StitchingError(Effect):
    """Delta y = b (1 + tanh(2 (y - y_0)/w))/2: nothing before y_0, b beyond, changing over the width w.

    Holds for b below w in size where it is against the motion, so that the reading still rises; of positions and angles
    alone.
    """

    place = Place.SENSOR
    channel_unit = ("m", "rad")
    source = "definition"
    params = (
        Param("offset", "channel", (-0.1, 0.1), "error beyond the place", off=0.0),
        Param("position", "channel", (-2.0, 2.0), "place where it sets in"),
        Param("width", "channel", (1e-4, 0.05), "path over which it does"),
    )

    @classmethod
    def holds(cls, p):
        return p["offset"] > -p["width"]

    def term(self, s, p):
        return p.offset * (1 + ca.tanh(2 * (s.value - p.position) / p.width)) / 2

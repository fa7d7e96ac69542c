"""A platform frame turned against the drawing: one direction leaks into another."""

from ctrlgen.effect import Effect, Param, Place


class FrameTurn(Effect):
    """A frame turned by gamma about z: Delta delta_x = -gamma delta_y, Delta delta_y = gamma delta_x.

    The same holds for theta. First order in gamma; the error is gamma^2/2 of the motion.
    """

    place = Place.POSE
    needs = frozenset({"spatial"})
    source = "definition"
    params = (Param("angle", "mrad", (-50.0, 50.0), "turn of the platform frame about z", off=0.0),)

    def term(self, s, p):
        across = {0: -s.all[1], 1: s.all[0], 3: -s.all[4], 4: s.all[3]}
        return p.angle * across.get(s.index, 0.0)

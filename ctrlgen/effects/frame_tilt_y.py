"""A frame tilted about y against the drawing."""

from ctrlgen.effect import Effect, Param, Place


class FrameTiltY(Effect):
    """A frame turned by beta about y: Delta delta_z = -beta delta_x, Delta delta_x = beta delta_z.

    The same holds for theta. First order in beta; the error is beta^2/2 of the motion.
    """

    place = Place.POSE
    needs = frozenset({"spatial"})
    source = "definition"
    params = (Param("angle", "mrad", (-50.0, 50.0), "turn of the platform frame about y", off=0.0),)

    def term(self, s, p):
        across = {2: -s.all[0], 0: s.all[2], 5: -s.all[3], 3: s.all[5]}
        return p.angle * across.get(s.index, 0.0)

"""A frame tilted about x against the drawing."""

from ctrlgen.effect import Effect, Param, Place


class FrameTiltX(Effect):
    """A frame turned by alpha about x: Delta delta_y = -alpha delta_z, Delta delta_z = alpha delta_y.

    The same holds for theta. First order in alpha; the error is alpha^2/2 of the motion.
    """

    place = Place.POSE
    needs = frozenset({"spatial"})
    source = "definition"
    params = (Param("angle", "mrad", (-50.0, 50.0), "turn of the platform frame about x", off=0.0),)

    def term(self, s, p):
        across = {1: -s.all[2], 2: s.all[1], 4: -s.all[5], 5: s.all[4]}
        return p.angle * across.get(s.index, 0.0)

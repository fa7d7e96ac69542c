"""A frame tilted about x against the drawing."""

from ctrlgen.effects import Effect, Param, Place
from ctrlgen.effects._rotated_frame import turned


class FrameTiltX(Effect):
    """A frame turned by alpha about x: Delta delta_y = (cos alpha - 1) delta_y - sin alpha delta_z, Delta delta_z =
    (cos alpha - 1) delta_z + sin alpha delta_y.

    The same holds for theta. At one channel, its axis alone is turned.
    """

    place = Place.POSE
    requires = frozenset({"spatial"})
    source = "definition"
    params = (Param("angle", "mrad", (-50.0, 50.0), "turn of the platform frame about x", off=0.0),)

    def term(self, s, p):
        return turned(s, p.angle, 1, 2)

"""A frame tilted about y against the drawing."""

from ctrlgen.effects import Effect, Param, Place
from ctrlgen.effects._rotated_frame import turned


class FrameTiltY(Effect):
    """A frame turned by beta about y: Delta delta_z = (cos beta - 1) delta_z - sin beta delta_x, Delta delta_x =
    (cos beta - 1) delta_x + sin beta delta_z.

    The same holds for theta. At one channel, its axis alone is turned.
    """

    place = Place.POSE
    requires = frozenset({"spatial"})
    source = "definition"
    params = (Param("angle", "mrad", (-50.0, 50.0), "turn of the platform frame about y", off=0.0),)

    def term(self, s, p):
        return turned(s, p.angle, 2, 0)

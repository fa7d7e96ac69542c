"""A platform frame turned against the drawing: one direction leaks into another."""

from ctrlgen.effects import Effect, Param, Place
from ctrlgen.effects._rotated_frame import turned


class FrameTurn(Effect):
    """A frame turned by gamma about z: Delta delta_x = (cos gamma - 1) delta_x - sin gamma delta_y, Delta delta_y =
    (cos gamma - 1) delta_y + sin gamma delta_x.

    The same holds for theta. At one channel, its axis alone is turned.
    """

    place = Place.POSE
    requires = frozenset({"spatial"})
    source = "definition"
    params = (Param("angle", "mrad", (-50.0, 50.0), "turn of the platform frame about z", off=0.0),)

    def term(self, s, p):
        return turned(s, p.angle, 0, 1)

"""A frame tilted about y against the drawing."""

import casadi as ca

from ctrlgen.effect import Effect, Param, Place


class FrameTiltY(Effect):
    """A frame turned by beta about y: Delta delta_z = (cos beta - 1) delta_z - sin beta delta_x, Delta delta_x =
    (cos beta - 1) delta_x + sin beta delta_z.

    The same holds for theta. At one channel, its axis alone is turned.
    """

    place = Place.POSE
    needs = frozenset({"spatial"})
    source = "definition"
    params = (Param("angle", "mrad", (-50.0, 50.0), "turn of the platform frame about y", off=0.0),)

    def term(self, s, p):
        across = {2: -s.all[0], 0: s.all[2], 5: -s.all[3], 3: s.all[5]}
        if s.index not in across:
            return 0.0
        return ca.sin(p.angle) * across[s.index] + (ca.cos(p.angle) - 1) * s.value

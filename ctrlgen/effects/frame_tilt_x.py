"""A frame tilted about x against the drawing."""

import casadi as ca

from ctrlgen.effect import Effect, Param, Place


class FrameTiltX(Effect):
    """A frame turned by alpha about x: Delta delta_y = (cos alpha - 1) delta_y - sin alpha delta_z, Delta delta_z =
    (cos alpha - 1) delta_z + sin alpha delta_y.

    The same holds for theta. At one channel, its axis alone is turned.
    """

    place = Place.POSE
    needs = frozenset({"spatial"})
    source = "definition"
    params = (Param("angle", "mrad", (-50.0, 50.0), "turn of the platform frame about x", off=0.0),)

    def term(self, s, p):
        across = {1: -s.all[2], 2: s.all[1], 4: -s.all[5], 5: s.all[4]}
        if s.index not in across:
            return 0.0
        return ca.sin(p.angle) * across[s.index] + (ca.cos(p.angle) - 1) * s.value

"""An actuator that ignores small drives."""

import casadi as ca

from ctrlgen.effect import Effect, Param, Place


class DeadZone(Effect):
    """Delta u = -(sqrt((u + w)^2 + e^2) - sqrt((u - w)^2 + e^2))/2: nothing inside +-w, w less outside.

    e, 0.3 % of the typical drive, rounds the corners, so that the slope exists. Holds for w well above e.
    """

    place = Place.DRIVE
    needs = frozenset({"actuator"})
    source = "G. Tao, P. V. Kokotovic, IEEE Trans. Autom. Control 39 (1994) 59: plants with unknown dead-zones"
    params = (Param("width", "channel", (0.0, 0.5), "half width", off=0.0),)

    def term(self, s, p):
        corner = (3e-3 * s.scale) ** 2
        above, below = (ca.sqrt((s.value + side * p.width) ** 2 + corner) for side in (1, -1))
        return -(above - below) / 2

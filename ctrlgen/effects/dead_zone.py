"""An actuator that ignores small drives."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself


class DeadZone(Effect):
    """Delta u = -(sqrt((u + w)^2 + e^2) - sqrt((u - w)^2 + e^2))/2, e = r w: zero well inside +-w, reduced by w outside.

    r rounds the corners: 0.03 for contacts that open, 1 for an electronic crossover. Holds for w well below the largest drive.
    """

    place = Place.DRIVE
    family = Family.DRIVE
    order = -1  # contacts, crossovers, overlaps of a valve stand before what gives the power, whose gain scales what they let through
    requires = frozenset({"actuator"})
    source = "G. Tao, P. V. Kokotovic, IEEE Trans. Autom. Control 39 (1994) 59: plants with unknown dead-zones"
    params = (
        Param("width", "channel", (0.0, 0.5), "half width", off=0.0),
        Param("rounding", "1", (0.01, 5.0), "r: rounding of the corners, in widths"),
    )
    at_bounds = itself("rounding")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        corner = (p.rounding * p.width) ** 2 + (1e-6 * s.scale) ** 2
        above, below = (ca.sqrt((s.value + side * p.width) ** 2 + corner) for side in (1, -1))
        return -(above - below) / 2

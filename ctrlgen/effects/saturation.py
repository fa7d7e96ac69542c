"""An amplifier that saturates below its stated limit."""

import casadi as ca

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Side, itself


class Saturation(Effect):
    """Delta u = g (c(u) - u), c(u) = (sqrt((u + L)^2 + e^2) - sqrt((u - L)^2 + e^2))/2, e = L/200: u, but at most L.

    g = 1 clips. The corner is e wide, so that the derivative exists. Above L the
    drive cannot be recovered from what is delivered. Holds for a limit that is the same in both directions.
    """

    place = Place.DRIVE
    family = Family.DRIVE
    order = (
        -2
    )  # before the gains, which act on what is delivered, and before a rate, at which what is clipped is reached
    requires = frozenset({"actuator"})
    source = "R. Isermann, Fault-Diagnosis Systems (2006): actuator faults; smooth form ours"
    params = (
        Param("share", "1", (0.0, 1.5), "1: nothing above the level is delivered", off=0.0),
        Param(
            "level",
            "channel",
            (0.01, 1.0),
            "L: drive that is not exceeded",
        ),
    )
    at_bounds = itself("level")
    acts_in = ActsIn("drive", "level", Side.BOTH)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        corner = (p.level / 200) ** 2
        above, below = (ca.sqrt((s.value + side * p.level) ** 2 + corner) for side in (1, -1))
        return p.share * ((above - below) / 2 - s.value)

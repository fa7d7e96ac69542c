"""Hysteresis of a piezo stack: the displacement lags behind the voltage."""

from ctrlgen.effects import Effect, Param, Place, State
from ctrlgen.effects._play_operators import followed, lagging, names


class DriveHysteresis(Effect):
    """Delta u = g (sum_j w_j P_j - u), j = 1..8: P_j the play of u with radius r j/8, w_j ~ j^-q, sum w_j = 1.

    Prandtl-Ishlinskii with play operators, independent of rate. Holds for congruent loops through the origin.
    """

    place = Place.DRIVE
    order = 1
    requires = frozenset({"actuator"})
    source = "K. Kuhnen, Eur. J. Control 9 (2003) 407: modified Prandtl-Ishlinskii operators"
    params = (
        Param("share", "1", (0.0, 0.5), "part of the drive that lags", off=0.0),
        Param("reach", "channel", (1e-3, 2.0), "change of drive that all follow"),
        Param("taper", "1", (-1.0, 2.0), "q: how much more of the narrow ones"),
    )
    states = tuple(State(name, "channel", 1.0, stepped=True) for name in names())

    def term(self, s, p):
        return -p.share * lagging(s, s.value, p.taper)

    def update(self, s, p):
        return followed(s, [s.value], p.reach)

"""Hysteresis of a piezo stack: the displacement lags behind the voltage."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place
from ctrlgen.effects._play_operators import NO_LAG, ONE_PLAY, play_states, radii, updated_plays, weighted_lag


class DriveHysteresis(Effect):
    """Delta u = g (sum_j w_j P_j - u), j = 1..8: P_j is the play of u with radius r j/8, w_j ~ j^-q, sum w_j = 1.

    Prandtl-Ishlinskii with play operators, rate-independent. Holds for congruent loops through the origin, on actuators that
    push: where the drive is the displacement itself, its lag is `displacement_hysteresis`.
    """

    place = Place.DRIVE
    family = Family.HYSTERESIS
    order = 1
    requires = frozenset({"actuator", "force"})
    source = "K. Kuhnen, Eur. J. Control 9 (2003) 407: modified Prandtl-Ishlinskii operators"
    params = (
        Param("share", "1", (0.0, 0.999), "share of the drive that lags", off=0.0),
        Param("reach", "channel", (1e-3, 2.0), "r: change of drive after which all plays follow"),
        Param("taper", "1", (-3.0, 3.0), "q: weight of the narrow plays over the wide ones"),
    )
    at_bounds = {"reach": NO_LAG, "taper": ONE_PLAY}
    states = play_states("channel")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.share * weighted_lag(s, s.value, p.reach, p.taper)

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return updated_plays(s, [s.value], radii(p.reach))

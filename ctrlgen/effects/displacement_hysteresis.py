"""Hysteresis of a joint or guide between stage and mechanism: the displacement lags."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place
from ctrlgen.effects._play_operators import (
    BESIDE_GAIN,
    NO_LAG,
    ONE_PLAY,
    play_states,
    radii,
    updated_plays,
    weighted_lag,
)


class DisplacementHysteresis(Effect):
    """Delta d = g (sum_j w_j P_j - d + k d), j = 1..8: P_j is the play of d with radius r j/8, w_j ~ j^-q, sum w_j = 1.

    Prandtl-Ishlinskii with play operators, rate-independent; in a set of poses the memory goes from pose to pose in their
    order. The operator's own reversible part k decides where the loop leaves the gain as it is: k = 0 where all plays follow, 1
    at small motions, where none does; far beyond, the law would be a gain with a little lag. g < 0 leads, as behind a controller
    that overcompensates. Holds for congruent loops, behind the stage: what lags in its guide is the force `hysteresis`.
    """

    place = Place.DISPLACEMENT
    family = Family.HYSTERESIS
    order = 1
    requires = frozenset({"actuator"})
    source = "K. Kuhnen, Eur. J. Control 9 (2003) 407: modified Prandtl-Ishlinskii operators"
    params = (
        Param("share", "1", (-0.999, 0.999), "share of the displacement that lags", off=0.0),
        Param("reach", "travel", (1e-4, 10.0), "r: travel after which all plays follow"),
        Param("taper", "1", (-3.0, 3.0), "q: weight of the narrow plays over the wide ones"),
        Param("reversible", "1", (-0.5, 1.5), "k: reversible displacement over the share that lags"),
    )
    at_bounds = {"reach": NO_LAG, "taper": ONE_PLAY, "reversible": BESIDE_GAIN}
    states = play_states("travel")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.share * (weighted_lag(s, s.value, p.reach, p.taper) - p.reversible * s.value)

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return updated_plays(s, [s.value], radii(p.reach))

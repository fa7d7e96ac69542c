"""Hysteresis whose narrow and wide plays have weights of their own."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself
from ctrlgen.effects import _play_operators as plays

OF_REST = "f_{j}: part of play {j} in what the narrower plays leave"
PARTS = tuple(Param(f"part{j}", "1", (0.0, 1.0), OF_REST.format(j=j)) for j in range(1, plays.ELEMENTS))


class WeightedLag(Effect, listed=False):
    """Delta s = g (sum_j w_j P_j - s + k s), j = 1..8: P_j is the play of s with radius r (j/8)^2, w_j >= 0, sum w_j = 1.

    w_j = f_j (1 - w_1 - ... - w_{j-1}), f_8 = 1: any weights, most on the narrowest plays, the widest or two groups of them. Prandtl-
    Ishlinskii, rate-independent; k as of `displacement_hysteresis`. Holds for congruent loops on records that reach every play.
    """

    order = 1
    source = "K. Kuhnen, Eur. J. Control 9 (2003) 407: modified Prandtl-Ishlinskii operators"
    at_bounds = {"reach": plays.NO_LAG, "reversible": plays.BESIDE_GAIN, **itself(*(part.name for part in PARTS))}
    family = Family.HYSTERESIS

    @classmethod
    def from_plainer(cls, numbers: dict[str, float]) -> dict[str, float]:
        parts = plays.graded_parts(numbers.get("taper", 0.5))
        begun = {"share": numbers["share"], "reach": numbers["reach"], "reversible": numbers.get("reversible", 0.0)}
        return begun | {part.name: value for part, value in zip(PARTS, parts, strict=True)}

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        weights = plays.parted_weights([getattr(p, part.name) for part in PARTS])
        lags = plays.lags(s, s.value, plays.graded_radii(p.reach))
        return -p.share * (sum(w * lag for w, lag in zip(weights, lags, strict=True)) - p.reversible * s.value)

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return plays.updated_plays(s, [s.value], plays.graded_radii(p.reach))


def _shape(unit: str) -> tuple[Param, ...]:
    reversible = Param("reversible", "1", (-0.5, 1.5), "k: reversible part over the share that lags")
    return Param("reach", unit, (1e-4, 10.0), "r: way after which all plays follow"), reversible, *PARTS


class WeightedDisplacementHysteresis(WeightedLag):
    """s = d, the displacement, Delta d as of `WeightedLag`; in a set of poses the memory goes from pose to pose. Holds as above."""

    title = "Hysteresis of a joint behind the stage, each width of its plays with a weight of its own"
    place = Place.DISPLACEMENT
    requires = frozenset({"actuator"})
    params = (Param("share", "1", (-0.999, 0.999), "share of the displacement that lags", off=0.0), *_shape("travel"))
    states = plays.play_states("travel")


class WeightedDriveHysteresis(WeightedLag):
    """s = u, the drive: Delta u as of `WeightedLag`. Holds as above, on actuators that push."""

    title = "Hysteresis of an actuator, each width of its plays with a weight of its own"
    place = Place.DRIVE
    requires = frozenset({"actuator", "force"})
    params = (Param("share", "1", (-0.999, 0.999), "share of the drive that lags", off=0.0), *_shape("channel"))
    states = plays.play_states("channel")

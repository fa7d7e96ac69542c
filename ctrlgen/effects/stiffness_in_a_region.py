"""A stiffness that changes at one place: a spring that touches or lets go, a clearance that closes, a preload that is used up."""

from typing import ClassVar

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds, Side
from ctrlgen.effects._region import CORNER, ramp

STIFFNESS = Param("stiffness", "channel/travel", (-10.0, 10.0), "k: change of stiffness beyond the edge", off=0.0)


class RegionalStiffness(Effect, listed=False):
    """Delta F = -k x in a region, x the way beyond its edge: one law, named once per region."""

    place = Place.FORCE
    family = Family.ELASTIC
    requires = frozenset({"force"})
    source = "definition: a piecewise linear spring"
    outward: ClassVar[int]

    @classmethod
    def contradiction(cls, p: dict[str, float]) -> str:
        stop = p["stiffness"] > 0 and cls.outward * p["edge"] > 0
        return "a spring that is touched from a place on is a stop" if stop else ""

    @classmethod
    def meant(cls, numbers: dict[str, float]) -> tuple[str, dict[str, float]] | None:
        if not cls.contradiction(numbers):
            return None
        return "end_stop", {"stiffness": numbers["stiffness"], "gap": numbers["edge"], "power": 1.0}


class StiffnessAbove(RegionalStiffness):
    """Delta F = -k x^2/(x + e), x = d - d_0 where positive: another stiffness above the displacement d_0; e, a millionth of the
    typical travel, rounds the corner. Holds for springs without play."""

    title = "A stiffness that changes in the upper part of the travel"
    params = (STIFFNESS, Param("edge", "travel", (-5.0, 5.0), "d_0: displacement at which it changes"))
    at_bounds = {"edge": ShapeBounds(low="another stiffness everywhere")}
    acts_in = ActsIn("position", "edge", Side.ABOVE)
    outward = 1

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.stiffness * ramp(s.displacement - p.edge, CORNER * s.travel)


class StiffnessBelow(RegionalStiffness):
    """Delta F = k x^2/(x + e), x = d_0 - d where positive: another stiffness below the displacement d_0; e, a millionth of the
    typical travel, rounds the corner. Holds for springs without play."""

    title = "A stiffness that changes in the lower part of the travel"
    params = StiffnessAbove.params
    at_bounds = {"edge": ShapeBounds(high="another stiffness everywhere")}
    acts_in = ActsIn("position", "edge", Side.BELOW)
    outward = -1

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.stiffness * ramp(p.edge - s.displacement, CORNER * s.travel)

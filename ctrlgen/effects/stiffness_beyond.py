"""A stiffness that changes at one distance from home, alike on both sides: bumpers, a clearance that closes."""

import casadi as ca

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds, Side
from ctrlgen.effects._region import CORNER, ramp


class StiffnessBeyond(Effect):
    """Delta F = -k sgn(d) x^2/(x + e), x = |d| - d_0 where positive: another stiffness farther out on both sides; e, a millionth of
    the typical travel, rounds the corner. Holds for springs that touch alike on both sides."""

    title = "A stiffness that changes farther out, on both sides"
    place = Place.FORCE
    family = Family.ELASTIC
    requires = frozenset({"force", "bipolar"})
    source = "definition: a piecewise linear spring"
    params = (
        Param("stiffness", "channel/travel", (-10.0, 10.0), "k: change of stiffness beyond the edge", off=0.0),
        Param("edge", "travel", (1e-3, 5.0), "d_0: way from home at which it changes"),
    )
    at_bounds = {"edge": ShapeBounds(low="another stiffness everywhere")}
    acts_in = ActsIn("position", "edge", Side.BOTH)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.stiffness * ca.sign(s.displacement) * ramp(ca.fabs(s.displacement) - p.edge, CORNER * s.travel)

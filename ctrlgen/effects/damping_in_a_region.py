"""Damping in one part of the travel, or above one speed: a gap that narrows, grease at one end, an air film that starts."""

import casadi as ca

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds, Side
from ctrlgen.effects._region import EDGE, above, below, beyond_edge, ramp


class RegionalDamping(Effect, listed=False):
    """Delta F = -c v in a region: one law, named once per region."""

    place = Place.FORCE
    family = Family.DYNAMICS
    requires = frozenset({"velocity"})
    source = "definition: a linear damper, in a region"


class ViscousAbove(RegionalDamping):
    """Delta F = -c v (1 + tanh(2 (d - d_0)/W))/2: damping above the displacement d_0, W the width w or a quarter of a sample's way.
    Holds for slow flow."""

    title = "Damping in the upper part of the travel"
    params = (Param("damping", "channel*s/travel", (0.0, 100.0), "c: damping beyond the edge", off=0.0), *EDGE)
    at_bounds = above("damping everywhere")
    acts_in = ActsIn("position", "edge", Side.ABOVE, over="width")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.damping * s.velocity * beyond_edge(s, p, 1)


class ViscousBelow(RegionalDamping):
    """Delta F = -c v (1 - tanh(2 (d - d_0)/W))/2: damping below the displacement d_0, W the width w or a quarter of a sample's way.
    Holds for slow flow."""

    title = "Damping in the lower part of the travel"
    params = ViscousAbove.params
    at_bounds = below("damping everywhere")
    acts_in = ActsIn("position", "edge", Side.BELOW, over="width")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.damping * s.velocity * beyond_edge(s, p, -1)


class ViscousAtSpeed(RegionalDamping):
    """Delta F = -c sgn(v) x^2/(x + e), x = |v| - v_0 where positive: damping above the speed v_0 alone. e, a hundredth of v_0, rounds
    the corner. Holds for slow flow."""

    title = "Damping above one speed alone"
    params = (
        Param("damping", "channel*s/travel", (0.0, 100.0), "c: damping above the speed", off=0.0),
        Param("speed", "travel/s", (1e-5, 100.0), "v_0: speed at which it sets in"),
    )
    at_bounds = {"speed": ShapeBounds(low="damping everywhere")}
    acts_in = ActsIn("speed", "speed", Side.ABOVE)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.damping * ca.sign(s.velocity) * ramp(ca.fabs(s.velocity) - p.speed, 0.01 * p.speed)

"""Dry friction in one part of the travel, or from one moment on: a cable that drags, a seal that touches, dirt on a guide."""

from ctrlgen.effects import ActsIn, Expression, LawInputs, LawNumbers, Side, itself
from ctrlgen.effects._bristles import BRISTLES, CONTACT, CREEPS, RegionalFriction
from ctrlgen.effects._region import EDGE, above, below, beyond_edge
from ctrlgen.effects._smooth_step import CLOCK, WHEN, smooth_step


class CoulombAbove(RegionalFriction):
    """Delta F = -f z (1 + tanh(2 (d - d_0)/W))/2, z Dahl's bristles of `coulomb`: friction above the displacement d_0, W the width w
    or a quarter of a sample's way. Holds for contacts that do not wear."""

    title = "Dry friction in the upper part of the travel"
    params = (*CONTACT, *EDGE)
    at_bounds = CREEPS | above("dry friction everywhere")
    acts_in = ActsIn("position", "edge", Side.ABOVE, over="width")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * s.states.z * beyond_edge(s, p, 1)


class CoulombBelow(RegionalFriction):
    """Delta F = -f z (1 - tanh(2 (d - d_0)/W))/2, z Dahl's bristles of `coulomb`: friction below the displacement d_0, W the width w
    or a quarter of a sample's way. Holds for contacts that do not wear."""

    title = "Dry friction in the lower part of the travel"
    params = (*CONTACT, *EDGE)
    at_bounds = CREEPS | below("dry friction everywhere")
    acts_in = ActsIn("position", "edge", Side.BELOW, over="width")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * s.states.z * beyond_edge(s, p, -1)


class CoulombAfter(RegionalFriction):
    """Delta F = -f z e(t), z Dahl's bristles of `coulomb`, e from 0 to 1 within the time T about the moment t_0. Holds for one event."""

    title = "Dry friction that sets in at a moment"
    params = (*CONTACT, *WHEN)
    at_bounds = CREEPS | itself("moment", "rise")
    states = (*BRISTLES, *CLOCK)
    acts_in = ActsIn("time", "moment", Side.ABOVE, over="rise", ramp=1.0)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * s.states.z * smooth_step(s, p)

"""Dry friction that falls with the speed, in one part of the travel or from one moment on: a contact that sticks, then slips."""

from typing import ClassVar

from ctrlgen.effects import ActsIn, Expression, LawInputs, LawNumbers, Side, itself
from ctrlgen.effects._bristles import BRISTLES, FALLING, FALLS, FallingFriction
from ctrlgen.effects._region import EDGE, above, below, beyond_edge
from ctrlgen.effects._smooth_step import CLOCK, WHEN, smooth_step


class OnOneSide(FallingFriction, listed=False):
    """Delta F = -f z (1 + tanh(2 sigma (d - d_0)/W))/2, W the width w or a quarter of a sample's way. Holds for lubricated guides."""

    params = (*FALLING, *EDGE)
    side: ClassVar[int]

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * s.states.z * beyond_edge(s, p, self.side)


class StribeckAbove(OnOneSide):
    """`OnOneSide` with sigma = 1. Holds as above."""

    title = "Dry friction in the upper part of the travel that falls with the speed"
    acts_in = ActsIn("position", "edge", Side.ABOVE, over="width")
    at_bounds = FALLS | above("dry friction everywhere")
    side = 1


class StribeckBelow(OnOneSide):
    """`OnOneSide` with sigma = -1. Holds as above."""

    title = "Dry friction in the lower part of the travel that falls with the speed"
    acts_in = ActsIn("position", "edge", Side.BELOW, over="width")
    at_bounds = FALLS | below("dry friction everywhere")
    side = -1


class StribeckAfter(FallingFriction):
    """Delta F = -f z e(t), z the bristles of `stribeck`, e from 0 to 1 within the time T about the moment t_0. Holds for one event."""

    title = "Dry friction that sets in at a moment and falls with the speed"
    params = (*FALLING, *WHEN)
    at_bounds = FALLS | itself("moment", "rise")
    states = (*BRISTLES, *CLOCK)
    acts_in = ActsIn("time", "moment", Side.ABOVE, over="rise", ramp=1.0)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * s.states.z * smooth_step(s, p)

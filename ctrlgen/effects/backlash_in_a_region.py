"""Play in one part of the travel: a worn stretch of a screw, a rack or a guide."""

from typing import ClassVar

import casadi as ca

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Side
from ctrlgen.effects._gap import DRIVEN, behind, carried
from ctrlgen.effects._region import EDGE, above, below


class RegionalBacklash(Effect, listed=False):
    """`backlash` whose gap is b in a region and nothing elsewhere: one law, named once per region."""

    place = Place.DISPLACEMENT
    family = Family.HYSTERESIS
    order = 1
    source = "M. Nordin, P.-O. Gutman, Automatica 38 (2002) 1633: controlling systems with backlash; in a region"
    params = (Param("gap", "travel", (0.0, 10.0), "b: full width of the gap beyond the edge", off=0.0), *EDGE)
    states = DRIVEN
    side: ClassVar[int]

    @classmethod
    def contradiction(cls, p: dict[str, float]) -> str:
        turns = p["gap"] >= 2 * p["width"]
        return "its gap opens over so short a way that the driven side would turn back" if turns else ""

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return behind(s, p.gap)

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return carried(s, p.gap, lambda d: p.gap / 2 * (1 + ca.tanh(2 * self.side * (d - p.edge) / p.width)) / 2)


class BacklashAbove(RegionalBacklash):
    """w = max(min(w, d + h), d - h), h = b (1 + tanh(2 (d - d_0)/w_0))/4, Delta d = 0.999 (w - d): play above the displacement d_0, which
    opens over the width w_0. Holds as `backlash` does, for b below 2 w_0."""

    title = "Play in the upper part of the travel"
    acts_in = ActsIn("position", "edge", Side.ABOVE, over="width")
    at_bounds = above("play everywhere")
    side = 1


class BacklashBelow(RegionalBacklash):
    """w = max(min(w, d + h), d - h), h = b (1 - tanh(2 (d - d_0)/w_0))/4, Delta d = 0.999 (w - d): play below the displacement d_0, which
    opens over the width w_0. Holds as `backlash` does, for b below 2 w_0."""

    title = "Play in the lower part of the travel"
    acts_in = ActsIn("position", "edge", Side.BELOW, over="width")
    at_bounds = below("play everywhere")
    side = -1

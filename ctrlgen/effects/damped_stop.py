"""A buffer that is touched from one place on and takes energy away: rubber, a shock absorber, a wire that is bent."""

import casadi as ca

from ctrlgen.effects import (
    ActsIn,
    Effect,
    Expression,
    Family,
    LawInputs,
    LawNumbers,
    Param,
    Place,
    ShapeBounds,
    Side,
    itself,
)
from ctrlgen.effects._region import CORNER


class DampedStop(Effect):
    """Delta F = -s k x^2/(x + e) (1 + s v/w), s = sgn(gap), x = s (d - gap) where positive, and never a pull: a spring k whose force the
    speed w toward it doubles; e is a millionth of the typical travel.

    Exactly zero before contact; the force begins at zero, as the loss grows with the depth. Holds for buffers that spring back at once.
    """

    title = "A buffer that takes energy away, such as a rubber stop"
    place = Place.FORCE
    family = Family.ELASTIC
    requires = frozenset({"force", "velocity"})
    source = "K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440"
    params = (
        Param("stiffness", "channel/travel", (0.0, 1e3), "k: stiffness of the buffer", off=0.0),
        Param("gap", "travel", (-10.0, 10.0), "displacement at which it stands"),
        Param("speed", "travel/s", (1e-3, 1e4), "w: speed toward it that doubles its force"),
    )
    at_bounds = {**itself("gap"), "speed": ShapeBounds(low="a damper alone", high="a stop without loss")}
    acts_in = ActsIn("position", "gap", Side.OUTWARD)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        side = ca.sign(p.gap)
        x = ca.fmax(side * (s.displacement - p.gap), 0)
        loss = ca.fmax(1 + side * s.velocity / p.speed, 0)
        return -p.stiffness * side * x**2 / (x + CORNER * s.travel) * loss

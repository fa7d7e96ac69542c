"""Dry friction that differs between the two directions."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Plainer, State, itself
from ctrlgen.effects._bristles import SHARPEST


class DirectionalFriction(Effect):
    """dz/dt = (v - |v| z)/r, dw/dt = |v| (1 - w)/r, Delta F = -f (z + a w): sliding takes f (1 + a) forward, f (1 - a) backward.

    Dahl's law with a part that does not change its sign, once the contact has slid by about r. An axis that never stops nor
    turns back shows one of the two forces alone. Holds for contacts that do not wear.
    """

    place = Place.FORCE
    family = Family.FRICTION
    set_valued = True
    requires = frozenset({"velocity"})
    source = "B. Armstrong-Helouvry et al., Automatica 30 (1994) 1083: direction-dependent friction; P. R. Dahl (1976)"
    params = (
        Param("force", "channel", (0.0, 1.0), "force of sliding, mean of both directions", off=0.0),
        Param("skew", "1", (-0.95, 0.95), "a: relative excess of the force of sliding forward"),
        Param("reach", "travel", (1e-6, 0.03), "displacement over which the contact yields"),
    )
    at_bounds = itself("skew", "reach")
    plainer = Plainer("coulomb", {"skew": 0.0}, {"smoothing": SHARPEST}, constant="skew")
    states = (State("z", "1", 1.0), State("w", "1", 1.0))

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * (s.states.z + p.skew * s.states.w)

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        speed = ca.fabs(s.velocity)
        return {"z": (s.velocity - speed * s.states.z) / p.reach, "w": speed * (1 - s.states.w) / p.reach}

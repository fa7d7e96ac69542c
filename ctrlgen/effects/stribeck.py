"""Dry friction that falls as a lubricant film builds up."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, LawInputs, LawNumbers, Param, Place, Plainer, State
from ctrlgen.effects._bristles import SHARPEST


class Stribeck(Effect):
    """dz/dt = (v - |v| z/g(v))/r, Delta F = -f z, g = 1 + (b - 1) exp(-(v/v_s)^2): breakaway force b f, f at speed.

    The LuGre model without bristle damping. Holds for lubricated guides.
    """

    place = Place.FORCE
    set_valued = True
    requires = frozenset({"velocity"})
    source = "C. Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995) 419, eqs. (1)-(4)"
    params = (
        Param("force", "channel", (0.0, 1.0), "force of sliding at speed", off=0.0),
        Param("breakaway", "1", (1.0, 5.0), "b: breakaway force per sliding force at speed"),
        Param("speed", "travel/s", (1e-3, 1e3), "v_s: Stribeck speed, above which the excess has decayed"),
        Param("reach", "travel", (1e-6, 0.03), "displacement over which the contact yields"),
    )
    plainer = Plainer("coulomb", {"breakaway": 1.0}, {"smoothing": SHARPEST})
    states = (State("z", "1", 1.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * s.states.z

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        level = 1 + (p.breakaway - 1) * ca.exp(-((s.velocity / p.speed) ** 2))
        return {"z": (s.velocity - ca.fabs(s.velocity) * s.states.z / level) / p.reach}

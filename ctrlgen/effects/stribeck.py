"""Dry friction that falls as a lubricant film builds up."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Place, Plainer
from ctrlgen.effects._bristles import BRISTLES, FALLING, FALLS, SHARPEST, falling_rate


class Stribeck(Effect):
    """dz/dt = (v - |v| z/g(v))/r, Delta F = -f z, g = 1 + (b - 1) exp(-(v/v_s)^2): breakaway force b f, f at speed.

    The LuGre model without bristle damping. Holds for lubricated guides.
    """

    place = Place.FORCE
    family = Family.FRICTION
    set_valued = True
    requires = frozenset({"velocity"})
    source = "C. Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995) 419, eqs. (1)-(4)"
    params = FALLING
    at_bounds = FALLS
    plainer = Plainer("coulomb", {"breakaway": 1.0}, {"smoothing": SHARPEST})
    states = BRISTLES

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * s.states.z

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"z": falling_rate(s, p)}

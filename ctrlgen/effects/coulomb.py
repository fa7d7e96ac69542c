"""Dry friction."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Place
from ctrlgen.effects._bristles import BRISTLES, CONTACT, CREEPS, bristle_rate


class Coulomb(Effect):
    """dz/dt = v (1 - z/tanh(v/v_s))/r, Delta F = -f z: bristles that bend by about r, then slide with the force f.

    Dahl's law for v_s = 0, f tanh(v/v_s) for r = 0: a contact under a lasting load creeps at about v_s. Right after a reversal
    the bristles are a spring of stiffness f/r. Holds for contacts that do not wear.
    """

    place = Place.FORCE
    family = Family.FRICTION
    set_valued = True
    requires = frozenset({"velocity"})
    source = "P. R. Dahl, AIAA Journal 14 (1976) 1675: solid friction damping; smoothed by the usual tanh"
    params = CONTACT
    at_bounds = CREEPS
    states = BRISTLES

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * s.states.z

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"z": bristle_rate(s, p)}

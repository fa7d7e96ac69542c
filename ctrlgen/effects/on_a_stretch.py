"""Friction or damping on one stretch of the travel: a tight spot of a screw, a dented rail, dirt on a guide, a gap that narrows."""

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Side, itself
from ctrlgen.effects._bristles import CONTACT, CREEPS, RegionalFriction
from ctrlgen.effects._region import STRETCH, on_stretch, with_end

ENDS = itself("position", "length", "width")


class CoulombOnStretch(RegionalFriction):
    """Delta F = -f z (tanh(2 (x + w/2)/W) - tanh(2 (x - w/2)/W))/2, x = d - d_0, z Dahl's bristles of `coulomb`: friction on the stretch
    w about the displacement d_0, W the width r or a quarter of a sample's way. Holds for contacts that do not wear."""

    title = "Dry friction on one stretch of the travel"
    params = (*CONTACT, *STRETCH)
    at_bounds = CREEPS | ENDS
    acts_in = ActsIn("position", "position", Side.AROUND, "length", "width")
    from_plainer = staticmethod(with_end)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * s.states.z * on_stretch(s, p)


class ViscousOnStretch(Effect):
    """Delta F = -c v (tanh(2 (x + w/2)/W) - tanh(2 (x - w/2)/W))/2, x = d - d_0: damping on the stretch w about the displacement d_0, W
    the width r or a quarter of a sample's way. Holds for slow flow."""

    place = Place.FORCE
    family = Family.DYNAMICS
    requires = frozenset({"velocity"})
    source = "definition: a linear damper, on a stretch"
    title = "Damping on one stretch of the travel"
    params = (Param("damping", "channel*s/travel", (0.0, 100.0), "c: damping on the stretch", off=0.0), *STRETCH)
    at_bounds = ENDS
    acts_in = ActsIn("position", "position", Side.AROUND, "length", "width")
    from_plainer = staticmethod(with_end)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.damping * s.velocity * on_stretch(s, p)

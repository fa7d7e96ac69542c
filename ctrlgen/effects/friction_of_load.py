"""Dry friction that grows with the load: leaf springs that rub, guides and cables that the stage's own force presses together."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Plainer, ShapeBounds
from ctrlgen.effects._bristles import BRISTLES, CONTACT, CREEPS, bristle_rate

LIGHTEST, HEAVIEST = (
    1e-3,
    1e3,
)  # loads that double the friction, over those that occur: beyond, one of its two parts is nothing


class FrictionOfLoad(Effect):
    """Delta F = -f (1 + |F_s|/F_2) z, z Dahl's bristles of `coulomb`, F_s the force that the stage takes: f without a load, twice as much
    at the load F_2. With F_2 far below the loads that occur it is Amontons' mu |F_s|, mu = f/F_2. Holds for contacts that do not wear.
    """

    title = "Dry friction that grows with the load"
    place = Place.FORCE
    family = Family.FRICTION
    set_valued = True
    requires = frozenset({"velocity", "spring"})
    source = (
        "P. R. Dahl, AIAA Journal 14 (1976) 1675: solid friction damping; in proportion to the load: Amontons (1699)"
    )
    params = (*CONTACT, Param("load", "channel", (LIGHTEST, HEAVIEST), "F_2: load that doubles it"))
    at_bounds = CREEPS | {"load": ShapeBounds(high="dry friction that is the same under every load")}
    plainer = Plainer("coulomb", {"load": HEAVIEST})
    states = BRISTLES

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * (1 + ca.fabs(s.force) / p.load) * s.states.z

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"z": bristle_rate(s, p)}

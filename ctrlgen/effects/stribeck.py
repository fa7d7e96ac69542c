"""Friction that falls as a lubricant film builds up."""

import casadi as ca

from ctrlgen.effect import Effect, Param, Place


class Stribeck(Effect):
    """Delta F = -f exp(-(v/v_s)^2) tanh(10 v/v_s): the excess over dry friction at low speed.

    Holds for lubricated guides; the rest below v_s/10 is creep, not sticking.
    """

    place = Place.FORCE
    rough = 0.01
    rarity = 1.0  # dry friction that does not fall is the commoner
    sticks = True
    needs = frozenset({"velocity"})
    source = "B. Armstrong-Helouvry et al., Automatica 30 (1994) 1083, Gaussian form of Stribeck's curve"
    params = (
        Param("force", "channel", (0.0, 1.0), "excess of breakaway over sliding", off=0.0),
        Param("speed", "travel/s", (1e-3, 1e3), "speed v_s at which it is gone", grid=(0.01, 0.1, 1.0, 10.0, 100.0)),
    )

    def term(self, s, p):
        ratio = s.velocity / p.speed
        return -p.force * ca.exp(-(ratio**2)) * ca.tanh(10 * ratio)

"""Dry friction."""

import casadi as ca

from ctrlgen.effect import Effect, Param, Place


class Coulomb(Effect):
    """Delta F = -f tanh(v/v_s). Holds for speeds well above v_s; below it the contact creeps instead of sticking."""

    place = Place.FORCE
    rough = 0.01
    sticks = True
    needs = frozenset({"velocity"})
    source = "B. Armstrong-Helouvry et al., Automatica 30 (1994) 1083: friction in machines"
    params = (
        Param("force", "channel", (0.0, 1.0), "force of sliding", off=0.0),
        Param("smoothing", "travel/s", (1e-4, 1e3), "speed v_s of full force", grid=(1e-3, 0.01, 0.1, 1.0, 10.0)),
    )

    def term(self, s, p):
        return -p.force * ca.tanh(s.velocity / p.smoothing)

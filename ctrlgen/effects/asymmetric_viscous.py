"""Damping that differs between the two directions."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class AsymmetricViscous(Effect):
    """Delta F = -(c |v| + |c| v)/2: damping |c| forward only (c > 0) or backward only (c < 0).

    It always dissipates. Holds for a device that has damping of its own, which takes up the part -|c| v/2 of the derivative by c.
    """

    place = Place.FORCE
    family = Family.DYNAMICS
    requires = frozenset({"velocity"})
    source = "B. Armstrong-Helouvry et al., Automatica 30 (1994) 1083: direction-dependent friction"
    params = (Param("damping", "channel*s/travel", (-100.0, 100.0), "forward minus backward damping", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -(p.damping * ca.fabs(s.velocity) + ca.fabs(p.damping) * s.velocity) / 2

"""Drag of a fluid or an air film at speed."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class QuadraticDamping(Effect):
    """Delta F = -c v |v|. Holds for turbulent flow."""

    place = Place.FORCE
    family = Family.DYNAMICS
    requires = frozenset({"velocity"})
    source = "definition: drag at constant drag coefficient"
    params = (Param("damping", "channel*s^2/travel^2", (0.0, 1e4), "force per speed squared", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.damping * s.velocity * ca.fabs(s.velocity)

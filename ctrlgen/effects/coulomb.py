"""Dry friction."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, LawInputs, LawNumbers, Param, Place, State

STILL = 1e-6  # of v_s: keeps speed/tanh(speed) from being 0/0 at rest


class Coulomb(Effect):
    """dz/dt = v (1 - z/tanh(v/v_s))/r, Delta F = -f z: bristles that bend by about r, then slide with the force f.

    Dahl's law for v_s = 0, f tanh(v/v_s) for r = 0: a contact under a lasting load creeps at about v_s. Right after a reversal
    the bristles are a spring of stiffness f/r. Holds for contacts that do not wear.
    """

    place = Place.FORCE
    set_valued = True
    requires = frozenset({"velocity"})
    source = "P. R. Dahl, AIAA Journal 14 (1976) 1675: solid friction damping; smoothed by the usual tanh"
    params = (
        Param("force", "channel", (0.0, 1.0), "force of sliding", off=0.0),
        Param("reach", "travel", (1e-6, 0.03), "displacement over which the contact yields"),
        Param("smoothing", "travel/s", (1e-5, 1e3), "v_s, below which it creeps"),
    )
    states = (State("z", "1", 1.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * s.states.z

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        speed = ca.sqrt((s.velocity / p.smoothing) ** 2 + STILL**2)
        return {"z": (s.velocity - p.smoothing * speed / ca.tanh(speed) * s.states.z) / p.reach}

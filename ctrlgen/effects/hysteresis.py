"""Hysteresis of many small slipping contacts."""

import casadi as ca

from ctrlgen.effect import Effect, Param, Place, State
from ctrlgen.turning import turned_at

ELEMENTS = 8


class Hysteresis(Effect):
    """F = -k sum_j w_j e_j, j = 1..8: springs that slip at r_j = r j/8, e_j = d - (play of d with radius r_j).

    w_j ~ j^-q, sum w_j = 1: all alike for q = 0, more of the small ones for q > 0. Prandtl-Ishlinskii with stop
    operators (Iwan, Maxwell slip): independent of rate, dissipates. Holds for congruent loops.
    """

    place = Place.FORCE
    rough = 0.02
    family = "hysteresis"
    needs = frozenset({"force"})
    source = "W. D. Iwan, J. Appl. Mech. 33 (1966) 893; K. Kuhnen, Eur. J. Control 9 (2003) 407"
    params = (
        Param("stiffness", "channel/travel", (0.0, 1e2), "stiffness right after a reversal", off=0.0),
        Param("reach", "travel", (1e-3, 5.0), "travel at which all slip", grid=(0.03, 0.1, 0.3, 1.0, 2.0)),
        Param("taper", "1", (-1.0, 2.0), "q: how much more of the small ones", grid=(0.5,)),
    )
    states = (
        *(State(f"play{j}", "travel", 1.0, stepped=True) for j in range(1, ELEMENTS + 1)),
        State("d", "travel", 1.0, stepped=True),
        State("v", "travel/s", 100.0, stepped=True),
    )

    def term(self, s, p):
        weights = [float(j) ** -p.taper for j in range(1, ELEMENTS + 1)]
        stretch = [w * (s.displacement - getattr(s, f"play{j}")) for j, w in enumerate(weights, start=1)]
        return -p.stiffness * sum(stretch) / sum(weights)

    def update(self, s, p):
        new = {"d": s.displacement, "v": 0 if s.velocity is None else s.velocity}
        turn = turned_at(s, s.d, s.v)
        for j in range(1, ELEMENTS + 1):
            name, radius = f"play{j}", p.reach * j / ELEMENTS
            new[name] = getattr(s, name)
            for d in (turn, s.displacement):
                new[name] = ca.fmax(ca.fmin(new[name], d + radius), d - radius)
        return new

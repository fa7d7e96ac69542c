"""Hysteresis of many small slipping contacts."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, either, itself
from ctrlgen.effects._play_operators import play_states, radii, updated_plays, weighted_lag
from ctrlgen.effects._reversal_points import reversal_point


class Hysteresis(Effect):
    """F = -k sum_j w_j e_j, j = 1..8: springs that slip at r_j = r j/8, e_j = d - (play of d with radius r_j).

    w_j ~ j^-q, sum w_j = 1: equal weights for q = 0, more weight on the small radii for q > 0. Prandtl-Ishlinskii with stop
    operators (Iwan, Maxwell slip): rate-independent, dissipates. Holds for congruent loops.
    """

    place = Place.FORCE
    family = Family.HYSTERESIS
    requires = frozenset({"force"})
    source = "W. D. Iwan, J. Appl. Mech. 33 (1966) 893; K. Kuhnen, Eur. J. Control 9 (2003) 407"
    params = (
        Param("stiffness", "channel/travel", (0.0, 1e2), "stiffness right after a reversal", off=0.0),
        Param("reach", "travel", (1e-3, 5.0), "r: travel after which all springs slip"),
        Param("taper", "1", (-3.0, 3.0), "q: weight of the small radii over the large ones"),
    )
    at_bounds = {"reach": either("dry friction, or a spring"), **itself("taper")}
    states = (
        *play_states("travel"),
        State("d", "travel", 1.0, stepped=True),
        State("v", "travel/s", 100.0, stepped=True),
    )

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.stiffness * weighted_lag(s, s.displacement, p.reach, p.taper)

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        new = {"d": s.displacement, "v": 0 if s.velocity is None else s.velocity}
        return new | updated_plays(s, [reversal_point(s, s.states.d, s.states.v), s.displacement], radii(p.reach))

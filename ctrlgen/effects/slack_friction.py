"""Friction that grips only once a slack is crossed."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Plainer, State, itself
from ctrlgen.effects._play_operators import ELEMENTS, lags, play_states, radii, updated_plays
from ctrlgen.effects._reversal_points import reversal_point


class SlackFriction(Effect):
    """F = -f sum_j D(e_j)/sum_j r_j, r_j = r j/8, j = 1..8: slipping contacts, each in series with a slack of width b.

    e_j = d - P_j, P_j the play of d with radius r_j + b/2; D(e) = sign(e) max(|e| - b/2, 0). After a reversal each contact springs
    back, carries nothing while b is crossed, then is bent the other way and slides. Rate-independent, dissipates.
    Holds where what slides stands still while the slack is crossed; b = 0 is `hysteresis` of equal weights.
    """

    place = Place.FORCE
    family = Family.HYSTERESIS
    requires = frozenset({"force"})
    source = "W. D. Iwan, J. Appl. Mech. 33 (1966) 893, each element behind a gap; M. Nordin, P.-O. Gutman, Automatica 38 (2002) 1633"
    params = (
        Param("force", "channel", (0.0, 5.0), "f: force of sliding", off=0.0),
        Param("slack", "travel", (0.0, 10.0), "b: travel without force after a reversal"),
        Param("reach", "travel", (1e-3, 5.0), "r: travel after which all contacts slide, once the slack is crossed"),
    )
    at_bounds = itself("slack", "reach")
    plainer = Plainer("hysteresis", {"slack": 0.0}, {"taper": 0.0})
    states = (
        *play_states("travel"),
        State("d", "travel", 1.0, stepped=True),
        State("v", "travel/s", 100.0, stepped=True),
    )

    @classmethod
    def as_plainer(cls, numbers: dict[str, float]) -> dict[str, float]:
        # k = 8 f/sum_j r_j
        return {"reach": numbers["reach"], "stiffness": ELEMENTS * numbers["force"] / sum(radii(numbers["reach"]))}

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        bent = (
            ca.fmax(e - p.slack / 2, 0) + ca.fmin(e + p.slack / 2, 0) for e in lags(s, s.displacement, self.widths(p))
        )
        return -p.force * sum(bent) / sum(radii(p.reach))

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        new = {"d": s.displacement, "v": 0 if s.velocity is None else s.velocity}
        return new | updated_plays(s, [reversal_point(s, s.states.d, s.states.v), s.displacement], self.widths(p))

    @staticmethod
    def widths(p: LawNumbers) -> list[Expression]:
        """Radii of the plays."""
        return [r + p.slack / 2 for r in radii(p.reach)]

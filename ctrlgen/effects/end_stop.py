"""A stage that touches something."""

import casadi as ca

from ctrlgen.effect import Effect, Param, Place


class EndStop(Effect):
    """Delta F = -k x^2/(x + e), x = d - gap where positive: a spring k beyond the gap, on the negative side for gap < 0.

    e, a hundredth of the typical travel, rounds the corner. Exactly nothing before contact. Holds for elastic contact.
    """

    place = Place.FORCE
    needs = frozenset({"force"})
    source = "definition: a spring beyond a gap, its corner rounded"
    params = (
        Param("stiffness", "channel/travel", (0.0, 1e3), "stiffness of the stop", off=0.0),
        Param(
            "gap",
            "travel",
            (-10.0, 10.0),
            "where it stands",
            grid=(-0.97, -0.9, -0.7, -0.4, 0.4, 0.7, 0.9, 0.97),
            level=True,
        ),
    )

    def term(self, s, p):
        side = ca.sign(p.gap)
        x = ca.fmax(side * (s.displacement - p.gap), 0)
        return -p.stiffness * side * x**2 / (x + 0.01 * s.travel)

"""A stop, or a second spring, that is touched from one place on."""

import casadi as ca

from ctrlgen.effects import ActsIn, Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Side, itself

CORNER = 1e-3  # of e


class EndStop(Effect):
    """Delta F = -k x^2/(x + e/1000) (1 + x/e)^(n - 1), x = d - gap where positive; on the negative side for gap < 0.

    n = 1 is a spring of stiffness k, n = 1.5 Hertz's contact of a ball. e is a thousandth of the typical travel, k about the
    stiffness at first contact; a thousandth of e rounds the corner, less than what is touched. Exactly zero before contact. Holds for
    elastic contact.
    """

    place = Place.FORCE
    family = Family.ELASTIC
    requires = frozenset({"force"})
    source = "K. L. Johnson, Contact Mechanics (1985), eq. (4.23): Hertz; the corner is rounded"
    params = (
        Param("stiffness", "channel/travel", (0.0, 1e3), "stiffness of the stop at first contact", off=0.0),
        Param(
            "gap",
            "travel",
            (-10.0, 10.0),
            "displacement at which the stop stands",
        ),
        Param("power", "1", (1.0, 2.0), "n: how the force grows with the depth"),
    )
    at_bounds = itself("gap", "power")
    acts_in = ActsIn("position", "gap", Side.OUTWARD)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        side = ca.sign(p.gap)
        x = ca.fmax(side * (s.displacement - p.gap), 0)
        e = 1e-3 * s.travel
        return -p.stiffness * side * x**2 / (x + CORNER * e) * (1 + x / e) ** (p.power - 1)

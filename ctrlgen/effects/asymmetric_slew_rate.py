"""An amplifier whose output changes at most so fast, up faster than down or down faster than up."""

import casadi as ca

from ctrlgen.effects import Expression, LawInputs, LawNumbers, Param, Plainer, itself
from ctrlgen.effects._slewing import SHARE, Slewing


class AsymmetricSlewRate(Slewing):
    """dv/dt = R_up where u > v, -R_down where u < v; Delta u = g (v - u). R_up = R (1 + a) and R_down = R for a > 0, R_up = R and
    R_down = R (1 - a) for a < 0.

    R is the slower rate, which a path may have in either direction. Holds as `slew_rate`.
    """

    params = (
        SHARE,
        Param("rate", "channel/s", (1e-3, 1e6), "R: fastest change of what is delivered, the slower way", paced=True),
        Param("excess", "1", (-9.0, 9.0), "a: by how much the other way is quicker, above zero the way up"),
    )
    at_bounds = itself("rate", "excess")
    plainer = Plainer("slew_rate", {"excess": 0.0})

    def most(self, s: LawInputs, p: LawNumbers) -> tuple[Expression, Expression]:
        up, down = super().most(s, p)
        return up * (1 + ca.fmax(p.excess, 0.0)), down * (1 + ca.fmax(-p.excess, 0.0))

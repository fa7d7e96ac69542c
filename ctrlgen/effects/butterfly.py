"""Strain of a ferroelectric: it grows with the square of a polarisation that remembers."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself
from ctrlgen.effects._play_operators import following, play_states, radii, updated_plays, weighted_lag


class Butterfly(Effect):
    """Delta u = g (u_0 (P/P_0)^2 - l u), P = sum_j w_j P_j, j = 1..8: P_j is the play of u with radius r j/8, w_j ~ j^-q.

    u_0 is the typical drive, sum w_j = 1, and P_0 is what P comes to when u rises from rest to u_0. Electrostriction of a
    polarisation that is a Prandtl-Ishlinskii operator of the field: under a drive of both signs the loop has the two wings of a
    butterfly, under one sign it is that of hysteresis. l takes out the part that is not linear after all; g l = 1 is a
    ferroelectric without bias. Holds below the saturation of the polarisation.
    """

    place = Place.DRIVE
    family = Family.HYSTERESIS
    order = 1
    requires = frozenset({"actuator", "bipolar", "voltage"})
    source = "R. C. Smith, Smart Material Systems: Model Development (2005): electrostriction, strain as the square of polarisation"
    params = (
        Param("linear", "1", (-2.0, 2.0), "l: linear drive that is missing, per square"),
        Param("share", "1", (-2.0, 2.0), "g: square over the drive, at the drive's typical size", off=0.0),
        Param(
            "reach",
            "channel",
            (1e-3, 2.0),
            "r: change of drive after which all domains follow, twice the coercive drive",
        ),
        Param("taper", "1", (-1.0, 2.0), "q: weight of the domains that switch early over the late ones"),
    )
    at_bounds = itself("linear", "reach", "taper")
    states = play_states("channel")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        polarisation = s.value - weighted_lag(s, s.value, p.reach, p.taper)
        most = ca.fmax(following(s.scale, p.reach, p.taper), 1e-3 * s.scale)
        return p.share * (s.scale * (polarisation / most) ** 2 - p.linear * s.value)

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return updated_plays(s, [s.value], radii(p.reach))

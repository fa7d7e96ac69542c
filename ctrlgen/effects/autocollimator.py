"""An autocollimator reads where the normal of a face points, which is no component of the rotation vector."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place
from ctrlgen.effects._mirror_normal import turned_normal


class Autocollimator(Effect):
    """Delta theta_a = g (sigma atan(n_c/n_b) - theta_a), n = exp([theta x]) e_b: the angle, in the plane of b and c, of the normal of the
    face that looks along b; sigma = 1 where (a, b, c) are in cyclic order, else -1. g = 1 for an autocollimator, 0 for a sensor of the
    rotation vector.

    Holds for a face that stands square (its lean is `face_tilt`) and angles below 50 mrad, where tangent and angle part by 1e-3 of the
    angle; of second order it adds sigma theta_b theta_c/2. The turn about b itself it cannot see.
    """

    place = Place.SENSOR
    family = Family.GEOMETRY
    requires = frozenset({"spatial"})
    pairs = True
    channel_unit = "rad"
    partner_unit = "channel"
    source = "S0 section 3.2 and Fig. 5: angles about x and z from one face of a cube, about y from another"
    params = (Param("share", "1", (-2.0, 2.0), "1 for an autocollimator", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        assert s.partner is not None  # a law of pairs
        a, b = s.index, s.partner
        c = 3 - a - b
        sense = 1 if (b - a) % 3 == 1 else -1
        normal = turned_normal(s.all[:3], b)
        return p.share * (sense * ca.atan(normal[c] / normal[b]) - s.value)
